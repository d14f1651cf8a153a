//! What varies from case to case: the kinds of plant, signal, loss and filter. All numbers follow from the seed.

use proptest::prelude::*;
use residual_diagnosis::unknown_input_filter::options::{
    GainRule, Initialisation, MissingPolicy, ResetRule, TestRule,
};

/// Shape of noise and disturbance within their bounds.
#[derive(Clone, Copy, Debug)]
pub enum Noise {
    Uniform,
    Vertex,
    Constant,
    Square,
}

/// Shape of the parameter error within its bound.
#[derive(Clone, Copy, Debug)]
pub enum Uncertainty {
    None,
    Constant,
    Vertex,
    Varying,
}

/// Shape of the command.
#[derive(Clone, Copy, Debug)]
pub enum Command {
    Constant,
    Switching,
    Feedback,
}

/// What is lost on the way.
#[derive(Clone, Copy, Debug)]
pub enum Loss {
    Nothing,
    Packets,
    Sensors,
    Commands,
    Mixed,
}

/// One random case.
#[derive(Clone, Debug)]
pub struct Case {
    pub seed: u64,
    /// The form as printed in the paper instead of the coupled one.
    pub paper: bool,
    pub test: TestRule,
    pub states: usize,
    pub outputs: usize,
    pub actuators: usize,
    pub disturbances: usize,
    pub noise: Noise,
    pub uncertainty: Uncertainty,
    pub command: Command,
    pub loss: Loss,
    pub gain: GainRule,
    pub sweeps: usize,
    pub extra_order: usize,
    pub policy: MissingPolicy,
    pub initialisation: Initialisation,
    pub reset: ResetRule,
    pub clear_samples: u32,
    pub outward_rounding: bool,
    pub pairs: bool,
    pub parity: bool,
    pub input_box: bool,
    pub state_box: bool,
    pub two_faults: bool,
}

/// Strategy over all cases.
pub fn cases() -> impl Strategy<Value = Case> {
    let plant = (any::<u64>(), 1..=5_usize, 2..=5_usize, 1..=3_usize, 0..=4_usize);
    let signals = (
        prop_oneof![
            Just(Noise::Uniform),
            Just(Noise::Vertex),
            Just(Noise::Constant),
            Just(Noise::Square)
        ],
        prop_oneof![
            Just(Uncertainty::None),
            Just(Uncertainty::Constant),
            Just(Uncertainty::Vertex),
            Just(Uncertainty::Varying)
        ],
        prop_oneof![
            Just(Command::Constant),
            Just(Command::Switching),
            Just(Command::Feedback)
        ],
        prop_oneof![
            Just(Loss::Nothing),
            Just(Loss::Packets),
            Just(Loss::Sensors),
            Just(Loss::Commands),
            Just(Loss::Mixed)
        ],
        any::<bool>(),
    );
    let form = (
        prop::bool::weighted(0.2),
        prop_oneof![Just(TestRule::Tight), Just(TestRule::Printed)],
    );
    let filter = (
        prop_oneof![
            Just(GainRule::RowWise),
            Just(GainRule::Fixed),
            Just(GainRule::Frobenius)
        ],
        prop_oneof![Just(0_usize), Just(2), Just(6)],
        prop_oneof![Just(1_usize), Just(6), Just(20)],
        prop_oneof![
            Just(MissingPolicy::BoundedFault),
            Just(MissingPolicy::UnboundedFault)
        ],
        prop_oneof![Just(Initialisation::Auto), Just(Initialisation::Prior)],
        any::<bool>(),
    );
    let bank = (
        prop_oneof![
            Just(ResetRule::Auto),
            Just(ResetRule::Copy),
            Just(ResetRule::None)
        ],
        prop_oneof![Just(0_u32), Just(8), Just(30)],
        any::<bool>(),
        any::<bool>(),
        any::<bool>(),
        any::<bool>(),
    );
    (plant, signals, form, filter, bank).prop_map(|(plant, signals, (paper, test), filter, bank)| Case {
        paper,
        test: if paper { test } else { TestRule::Tight },
        seed: plant.0,
        states: plant.1,
        outputs: plant.2,
        actuators: plant.3,
        disturbances: plant.4,
        noise: signals.0,
        uncertainty: signals.1,
        command: signals.2,
        loss: signals.3,
        two_faults: signals.4,
        gain: if paper { GainRule::RowWise } else { filter.0 },
        sweeps: if paper { 0 } else { filter.1 },
        extra_order: filter.2,
        policy: filter.3,
        initialisation: filter.4,
        outward_rounding: filter.5 && !paper,
        reset: bank.0,
        clear_samples: bank.1,
        pairs: bank.2,
        parity: bank.3 && !paper,
        input_box: bank.4,
        state_box: bank.5,
    })
}
