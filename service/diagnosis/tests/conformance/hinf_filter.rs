//! The fault detection filter on its paper's dynamics with sensor noise of its own, in each of its modes.

use crate::case::{Case, Promise, design};
use crate::conforms;
use crate::plant::{Draw, LinearPlant, Noise, Plant};
use nalgebra::{DMatrix, dmatrix};
use residual_diagnosis::hinf_filter::{
    options::HinfFilterOptions,
    plant::{Plant as ContinuousPlant, zoh},
};
use std::sync::OnceLock;

/// Disturbances: one of the state, one of each sensor. Faults: the actuator, the first sensor.
const MODEL: &str = "
[model]
A = [[-3.370, 1.636], [-0.325, -1.896]]
B = [[0.5], [0.4]]
C = [[1, 0], [0, 1]]
D = [[0], [0.267]]
Bd = [[0.1, 0, 0], [0.1, 0, 0]]
Dd = [[0, 0.02, 0], [0, 0, 0.02]]
";

const ACTUATOR_AND_SENSOR: &str = "Bf = [[0.5, 0], [0.4, 0]]\nDf = [[0, 1], [0, 0]]\n";
const BOTH_SENSORS: &str = "Bf = [[0, 0], [0, 0]]\nDf = [[1, 0], [0, 1]]\n";
const AMPLITUDE: &str = "[disturbance]\namplitude = [1, 1, 1]\n";

fn continuous(factor: f64) -> ContinuousPlant {
    ContinuousPlant {
        a: dmatrix![-3.370, 1.636; -0.325, -1.896] * factor,
        b: dmatrix![0.5; 0.4],
        c: DMatrix::identity(2, 2),
        d: dmatrix![0.0; 0.267],
        bd: dmatrix![0.1; 0.1],
        dd: DMatrix::zeros(2, 1),
        bf: DMatrix::zeros(2, 1),
        df: DMatrix::zeros(2, 1),
    }
}

fn plant_with(seed: u64, factor: f64, fault: f64, bias: f64) -> Box<dyn Plant> {
    let mut draw = Draw::new(seed, Noise::Bounded);
    let plant = continuous(factor);
    let (a, b) = zoh(&plant.a, &plant.b, 0.05);
    Box::new(LinearPlant {
        a,
        b,
        c: plant.c,
        feedthrough: plant.d,
        d: zoh(&plant.a, &plant.bd, 0.05).1,
        disturbance: vec![1.0],
        noise: vec![0.02; 2],
        command: vec![0.5],
        actuator_fault: vec![fault],
        sensor_fault: vec![bias, 0.0],
        state: draw.vector(&[0.5, 0.5]),
        draw,
        loss: 0.02,
        k: 0,
    })
}

fn actuator(seed: u64) -> Box<dyn Plant> {
    plant_with(seed, 1.0, 3.0, 0.0)
}

fn sensor(seed: u64) -> Box<dyn Plant> {
    plant_with(seed, 1.0, 0.0, 0.5)
}

/// Any of the listed plants is the true one.
fn one_of_three(seed: u64) -> Box<dyn Plant> {
    plant_with(seed, [1.0, 1.05, 0.95][seed as usize % 3], 3.0, 0.0)
}

fn case(faults: &str, tables: &str, plant: fn(u64) -> Box<dyn Plant>) -> Case {
    Case {
        tables: format!("{MODEL}{faults}{tables}"),
        design: design::<HinfFilterOptions>,
        period_ns: 50_000_000,
        plant,
        promise: Promise::NoFalseAlarm,
        designed: OnceLock::new(),
    }
}

fn riccati(more: &str) -> Case {
    case(ACTUATOR_AND_SENSOR, &format!("{AMPLITUDE}{more}"), actuator)
}

fn bank() -> Case {
    let isolation = "[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [4, 1]\n";
    case(ACTUATOR_AND_SENSOR, &format!("{AMPLITUDE}{isolation}"), actuator)
}

fn listed() -> Case {
    let models = [1.05, 0.95].map(|factor| {
        let a = continuous(factor).a;
        format!(
            "{{ A = [[{}, {}], [{}, {}]] }}",
            a[(0, 0)],
            a[(0, 1)],
            a[(1, 0)],
            a[(1, 1)]
        )
    });
    let faults = format!("{ACTUATOR_AND_SENSOR}listed_models = [{}]\n", models.join(", "));
    case(&faults, AMPLITUDE, one_of_three)
}

conforms! {
    riccati_discrete => riccati("");
    riccati_continuous_with_left_rectangle =>
        riccati("[synthesis]\ntype = \"riccati_ct\"\n[evaluation]\nwindow = 0.5\ninclude_current = false");
    cumulative => riccati("[evaluation]\nwindow = \"cumulative\"");
    one_residual_of_a_given_gain => riccati("[synthesis]\ntype = \"given\"\nL = [[0.02, 0.01], [0.01, 0.02]]\nV = [[1, -1]]");
    window_energy => case(
        ACTUATOR_AND_SENSOR,
        "[disturbance]\nwindow_energy = 1.7320508075688774\n[filter]\ninitial_error_norm = 1.0",
        actuator,
    );
    model_bank => listed();
    isolation_bank => bank();
    fault_estimate => case(
        BOTH_SENSORS,
        &format!("{AMPLITUDE}[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [1, 1]\nfault_slew = [1, 1]\nfault_estimate = true"),
        sensor,
    );
    first_order_hold => Case {
        promise: Promise::NoClaim("the hold leaks commands into the residual"),
        ..riccati("[synthesis]\ntype = \"riccati_ct\"\n[filter]\nrealisation = \"filter_foh\"")
    };
    zero_order_hold => Case {
        promise: Promise::NoClaim("the hold leaks commands into the residual"),
        ..riccati("[synthesis]\ntype = \"riccati_ct\"\n[filter]\nrealisation = \"filter_zoh\"")
    };
    constant_threshold => Case {
        promise: Promise::NoClaim("a constant threshold bounds nothing"),
        ..riccati("[evaluation]\nthreshold = \"constant\"\nconstant_threshold = 2.0")
    };
    gaussian_noise => Case {
        promise: Promise::NoClaim("noise has no bound"),
        ..case(
            ACTUATOR_AND_SENSOR,
            "[disturbance]\namplitude = [1, 1, 1]\nnoise_std = [0.01, 0.01]",
            actuator,
        )
    };
}
