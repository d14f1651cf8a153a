//! What a bank of mode filters is made of: plant, sensors, modes, priors and how modes change.

use super::plant::Plant;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// How the samples of an interval are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Form {
    /// One after the other in order of time, covariances in Joseph's form; a lost packet is simply absent.
    #[default]
    Sequential,
    /// The same with triangular factors of the covariances.
    SequentialSquareRoot,
    /// The paper's Theorem 1: all at once, losses unknown, hold-last values; for comparison and replay.
    BatchUnobserved,
}

/// Which modes pass their amplitude on to each other.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mixing {
    /// Those that share the fault channel; every other amplitude restarts from its prior.
    #[default]
    SharedChannel,
    /// All, as in the paper: a long time without fault "learns" the amplitude 0.
    All,
}

/// One sensor: z = H x + v.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// Name, for messages.
    pub name: String,
    /// H, d x n_x.
    pub measurement_matrix: DMatrix<f64>,
    /// R, d x d, positive definite.
    pub noise_covariance: DMatrix<f64>,
    /// β: probability that a packet arrives; used by [`Form::BatchUnobserved`] only.
    pub arrival_probability: f64,
    /// y⁰: held before the first packet, in that form; `None` = H x̂₀.
    pub initial_held_value: Option<Vec<f64>>,
}

/// One mode: which fault channels are at work.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Name.
    pub name: String,
    /// D, n_f x p: channel amplitudes f = D φ.
    pub direction: DMatrix<f64>,
    /// q_φ, p: power spectral density of the random walk of each slot, channel²/s.
    pub random_walk_psd: Vec<f64>,
}

/// What is known at t_0.
#[derive(Clone, Debug, PartialEq)]
pub struct Prior {
    /// x̂₀, n_x.
    pub state: Vec<f64>,
    /// P₀, n_x x n_x.
    pub state_covariance: DMatrix<f64>,
    /// φ₀, p; also the restart value of [`Mixing::SharedChannel`].
    pub amplitude: Vec<f64>,
    /// P_φ0, p x p.
    pub amplitude_covariance: DMatrix<f64>,
    /// μ₀, M.
    pub mode_probability: Vec<f64>,
}

/// How modes follow each other.
#[derive(Clone, Debug, PartialEq)]
pub enum ModeTransition {
    /// The same rate between any two modes, such that a mode stays with `probability` over `period_s`.
    Stay {
        /// s, 1/M < s <= 1.
        probability: f64,
        /// τ, seconds.
        period_s: f64,
    },
    /// Γ, M x M, 1/s, rows sum to 0: Λ(h) = e^{Γh}.
    Rate(DMatrix<f64>),
    /// Λ, M x M, rows sum to 1, at every fusion instant whatever the interval (the paper).
    PerStep(DMatrix<f64>),
}

/// The whole design of a bank.
#[derive(Clone, Debug)]
pub struct ImmDesign {
    /// The plant.
    pub plant: Plant,
    /// The sensors, in the order of their numbers.
    pub sensors: Vec<Sensor>,
    /// The modes; the first is the normal one, D = 0.
    pub modes: Vec<Mode>,
    /// What is known at t_0.
    pub prior: Prior,
    /// How modes follow each other.
    pub transition: ModeTransition,
    /// How samples are used.
    pub form: Form,
    /// Which modes pass their amplitude on.
    pub mixing: Mixing,
}

impl ImmDesign {
    /// p, the number of amplitude slots.
    pub fn slots(&self) -> usize {
        self.prior.amplitude.len()
    }

    /// n = n_x + p.
    pub fn filter_states(&self) -> usize {
        self.plant.sizes().0 + self.slots()
    }

    /// Largest d of the sensors.
    pub(super) fn widest_sensor(&self) -> usize {
        let rows = self
            .sensors
            .iter()
            .map(|sensor| sensor.measurement_matrix.nrows());
        rows.max().unwrap_or(0)
    }
}
