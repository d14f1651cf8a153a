//! Plants: the paper's example, and random ones.

use crate::files::{list, reference_of};
use nalgebra::DMatrix;
use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::{
    decomposition::{SingularDecomposition, eigenvalues},
    hinf_filter::plant::zoh,
    norms::{System, h_infinity_continuous, h_infinity_discrete},
};
use residual_synthesis::hinf_filter::lmi::{ErrorPlant, Time};
use serde_json::Value;

/// A list of rows as a matrix.
pub fn matrix(value: &Value) -> DMatrix<f64> {
    let rows: Vec<Vec<f64>> = list(value);
    DMatrix::from_fn(rows.len(), rows[0].len(), |i, j| rows[i][j])
}

/// A plant that owns its matrices.
#[derive(Clone, Debug)]
pub struct Plant {
    pub a: DMatrix<f64>,
    pub bd: DMatrix<f64>,
    pub c: DMatrix<f64>,
    pub dd: DMatrix<f64>,
    pub bf: DMatrix<f64>,
    pub df: DMatrix<f64>,
}

impl Plant {
    pub fn of(value: &Value) -> Self {
        let [a, bd, c, dd, bf, df] = ["A", "Bd", "C", "Dd", "Bf", "Df"].map(|key| matrix(&value[key]));
        Self { a, bd, c, dd, bf, df }
    }

    /// The paper's example.
    pub fn paper() -> Self {
        Self::of(&reference_of("hinf_filter", "paper_facts.json")["plant"])
    }

    /// A detectable plant of order n with more outputs or fewer, poles about as far as 3 from 0, unstable if asked.
    pub fn random(random: &mut ChaCha8Rng, n: usize, unstable: bool) -> Self {
        let mut entries = |rows: usize, columns: usize, size: f64| {
            DMatrix::from_fn(rows, columns, |_, _| size * random.random_range(-1.0..1.0))
        };
        let a = entries(n, n, 2.0 / (n as f64).sqrt() + 1.0);
        let q = 1 + n.div_ceil(3);
        let (bd, c) = (entries(n, 2, 1.0), entries(q, n, 1.0));
        let (dd, bf, df) = (entries(q, 2, 0.5), entries(n, 1, 1.0), entries(q, 1, 1.0));
        let rightmost = eigenvalues(&a)
            .unwrap()
            .iter()
            .map(|pole| pole.re)
            .fold(f64::NEG_INFINITY, f64::max);
        let wanted = if unstable { 0.3 } else { -0.3 };
        let a = a + DMatrix::identity(n, n) * (wanted - rightmost);
        Self { a, bd, c, dd, bf, df }
    }

    pub fn error(&self) -> ErrorPlant<'_> {
        ErrorPlant {
            a: &self.a,
            bd: &self.bd,
            c: &self.c,
            dd: &self.dd,
        }
    }

    /// The sampled plant.
    pub fn sampled(&self, sample_time_s: f64) -> Self {
        let (a, bd) = zoh(&self.a, &self.bd, sample_time_s);
        let (_, bf) = zoh(&self.a, &self.bf, sample_time_s);
        Self {
            a,
            bd,
            bf,
            ..self.clone()
        }
    }

    /// From d to r with a gain.
    pub fn disturbance(&self, gain: &DMatrix<f64>) -> System {
        System::new(
            &(&self.a - gain * &self.c),
            &(&self.bd - gain * &self.dd),
            &self.c,
            &self.dd,
        )
    }

    /// From f to r with a gain.
    pub fn fault(&self, gain: &DMatrix<f64>) -> System {
        System::new(
            &(&self.a - gain * &self.c),
            &(&self.bf - gain * &self.df),
            &self.c,
            &self.df,
        )
    }
}

/// σ_max.
pub fn largest(matrix: &DMatrix<f64>) -> f64 {
    SingularDecomposition::new(matrix).largest()
}

/// ‖G‖∞ by bisection of the Hamiltonian's level sets.
pub fn norm(time: Time, system: &System) -> f64 {
    let norm = match time {
        Time::Continuous => h_infinity_continuous(system),
        Time::Discrete => h_infinity_discrete(system),
    };
    assert!(norm.confirmed);
    norm.value
}
