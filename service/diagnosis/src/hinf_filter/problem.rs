//! From the options to checked matrices and vectors.

use super::{
    checks::check_plant,
    error::HinfFilterError,
    faults::FaultSet,
    options::HinfFilterOptions,
    plant::{Plant, SampledPlant},
    reading::{
        Sign, at_least, read_disturbance, read_initial, read_listed, read_plant, read_window,
        sees_every_state,
    },
    synthesis::pseudo_inverse,
};
use crate::decomposition::SingularDecomposition;
use nalgebra::{DMatrix, DVector};

/// Default noise weight relative to σ_max(Dd diag(w_d)).
const DEFAULT_NOISE: f64 = 0.07;

/// What is known of the disturbance.
#[derive(Clone, Debug, PartialEq)]
pub struct DisturbanceBound {
    /// d̄, length m; `None` if only the energy is bounded.
    pub amplitude: Option<DVector<f64>>,
    /// ḋ̄, length m; zero for a disturbance that changes at sampling instants only.
    pub slew: DVector<f64>,
    /// M_w, units of d times √s.
    pub window_energy: Option<f64>,
}

/// What is known of the initial error.
#[derive(Clone, Debug, PartialEq)]
pub enum InitialError {
    /// |e₀| <= ē, component by component.
    Box(DVector<f64>),
    /// ‖e₀‖₂ <= ε.
    Ball(f64),
}

/// Where the filter begins.
#[derive(Clone, Debug, PartialEq)]
pub struct InitialRule {
    /// Whether from the first complete sample.
    pub first_output: bool,
    /// x̂₀, or the prior, length n.
    pub state: DVector<f64>,
    /// Around `state`.
    pub error: InitialError,
}

/// Everything that was configured, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The plant.
    pub plant: Plant,
    /// The plant, sampled.
    pub sampled: SampledPlant,
    /// Listed models.
    pub listed: Vec<(Plant, SampledPlant)>,
    /// Bounds of d.
    pub disturbance: DisturbanceBound,
    /// Standard deviations of measurement noise, length q.
    pub noise: Option<DVector<f64>>,
    /// w_d, length m.
    pub disturbance_weight: DVector<f64>,
    /// w_n, length q.
    pub noise_weight: DVector<f64>,
    /// N; `None` for all samples from the start on.
    pub window: Option<usize>,
    /// Where the filter begins.
    pub initial: InitialRule,
    /// Names and bounds of the faults, blind sets.
    pub faults: FaultSet,
}

impl Problem {
    /// Checks everything that needs no design.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn new(options: &HinfFilterOptions, sample_time_s: f64) -> Result<Self, HinfFilterError> {
        if !(sample_time_s.is_finite() && sample_time_s > 0.0) {
            return Err(HinfFilterError::OutOfRange {
                key: "sample_time_s".to_owned(),
                value: sample_time_s,
                allowed: "it must be positive",
            });
        }
        let plant = read_plant(&options.model)?;
        let (n, _, q, m, _) = plant.dimensions();
        let sampled = plant.sample(sample_time_s);
        check_plant(&plant, &sampled, options.model.require_stable)?;
        let listed = read_listed(options, &plant, sample_time_s)?;
        let disturbance = read_disturbance(options, m)?;
        let noise = &options.disturbance.noise_std;
        let noise = match noise.is_empty() {
            true => None,
            false => Some(at_least(
                "disturbance.noise_std",
                noise,
                q,
                "outputs",
                Sign::Positive,
            )?),
        };
        let disturbance_weight = match (&options.synthesis.disturbance_weight, &disturbance.amplitude) {
            (Some(weight), _) => at_least(
                "synthesis.disturbance_weight",
                weight,
                m,
                "disturbances",
                Sign::Positive,
            )?,
            (None, Some(amplitude)) => amplitude.clone(),
            (None, None) => DVector::from_element(m, 1.0),
        };
        let noise_weight = match (&options.synthesis.noise_weight, &noise) {
            (Some(weight), _) => at_least("synthesis.noise_weight", weight, q, "outputs", Sign::NotNegative)?,
            (None, Some(noise)) => noise.clone(),
            (None, None) => {
                let weighted = &plant.dd * DMatrix::from_diagonal(&disturbance_weight);
                DVector::from_element(q, DEFAULT_NOISE * SingularDecomposition::new(&weighted).largest())
            }
        };
        let problem = Self {
            window: read_window(options.evaluation.window, sample_time_s)?,
            initial: read_initial(options, &plant, n)?,
            faults: FaultSet::new(options.isolation.as_ref(), plant.bf.ncols())?,
            plant,
            sampled,
            listed,
            disturbance,
            noise,
            disturbance_weight,
            noise_weight,
        };
        problem.check_combinations(options)?;
        Ok(problem)
    }

    /// ē when the filter begins with this disturbance and these direct terms: as configured, or for the first output
    /// |C⁺||Dd| d̄ + |I - C⁺C| ē_prior (+ 6 |C⁺| σ).
    pub(super) fn initial_error(&self, direct: &DMatrix<f64>, amplitude: &DVector<f64>) -> InitialError {
        if !self.initial.first_output {
            return self.initial.error.clone();
        }
        let (inverse, unseen) = self.first_output();
        let mut bound = inverse.abs() * (direct.abs() * amplitude);
        bound += match &self.initial.error {
            InitialError::Box(prior) => unseen.abs() * prior,
            InitialError::Ball(radius) => {
                DVector::from_fn(unseen.nrows(), |i, _| unseen.row(i).norm() * radius)
            }
        };
        if let Some(noise) = &self.noise {
            bound += inverse.abs() * noise * 6.0;
        }
        InitialError::Box(bound)
    }

    /// C⁺ and I - C⁺C; the latter is exactly zero where C shows every state.
    pub(super) fn first_output(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let c = &self.plant.c;
        let n = c.ncols();
        let inverse = pseudo_inverse(c);
        let unseen = if sees_every_state(c) {
            DMatrix::zeros(n, n)
        } else {
            DMatrix::identity(n, n) - &inverse * c
        };
        (inverse, unseen)
    }

    /// The largest |d| at one instant: d̄, or M_w/√Ts if only the energy is bounded.
    pub(super) fn amplitude(&self) -> DVector<f64> {
        let instant = self.disturbance.window_energy.unwrap_or(0.0) / self.sampled.sample_time_s.sqrt();
        match &self.disturbance.amplitude {
            Some(amplitude) => amplitude.clone(),
            None => DVector::from_element(self.plant.bd.ncols(), instant),
        }
    }
}
