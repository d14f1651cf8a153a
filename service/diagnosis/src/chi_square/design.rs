//! What the off-line design finds for a constant model: steady filter, blind windows, modes that cannot be told
//! apart (method sheet 3).

use super::{
    calibration::Calibration,
    engine::{Detectors, Engine, EngineDesign},
    filter::{Correction, Filter, FilterWork},
    glr::GlrDesign,
    glr_modes::FaultMode,
    plant::{Plant, StepModel},
    stability::Stability,
    thresholds::Thresholds,
};
use crate::matrix::{Matrix, dot};
use nalgebra::DMatrix;

/// Steps within which the filter has to become steady.
const STEADY_STEPS: usize = 20_000;
/// A residual non-centrality below this says nothing about a window.
const SILENT: f64 = 1e-6;
/// A window of one step equals the residual test up to this.
const ROUNDING: f64 = 1e-6;
/// Squared correlation of two signatures from which they count as hardly separable.
const ALIKE: f64 = 0.95;
/// Share of the energy below which the second half of the window adds nothing.
const FADED: f64 = 1e-3;

/// The filter of a constant model with complete data, after many steps.
#[derive(Clone, Debug, PartialEq)]
pub struct SteadyState {
    /// Steps until two successive factors of P agreed.
    pub steps: usize,
    /// P⁻, n x n.
    pub prediction_covariance: DMatrix<f64>,
    /// P, n x n.
    pub covariance: DMatrix<f64>,
    /// S, m x m.
    pub innovation_covariance: DMatrix<f64>,
    /// K, n x m.
    pub gain: DMatrix<f64>,
    /// Factor of P.
    pub(super) factor: Matrix,
}

/// A window that sees a constant sensor fault worse than the residual test.
#[derive(Clone, Debug, PartialEq)]
pub struct InsensitiveWindow {
    /// N.
    pub window_steps: usize,
    /// The sensor.
    pub sensor: usize,
    /// Non-centrality of the window over that of the residual, 4N instants after the step.
    pub ratio: f64,
}

/// Two modes of different components with nearly the same signature.
#[derive(Clone, Debug, PartialEq)]
pub struct InseparableModes {
    /// The mode to be isolated.
    pub mode: usize,
    /// The mode it resembles.
    pub other: usize,
    /// The size from which the noise-free difference of their statistics reaches the isolation margin.
    pub smallest_isolable_size: f64,
}

/// What the design found.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DesignReport {
    /// The modes of the model (of its period), where they are known.
    pub stability: Option<Stability>,
    /// The steady filter of a constant model.
    pub steady_state: Option<SteadyState>,
    /// Windows that are nearly blind.
    pub insensitive_windows: Vec<InsensitiveWindow>,
    /// Modes that are hard to tell apart.
    pub inseparable_modes: Vec<InseparableModes>,
    /// Modes whose energy stops growing: they leave a trace at their onset only.
    pub fading_modes: Vec<FaultMode>,
    /// Sensors that would not be excluded, because the others do not see every mode that does not decay.
    pub indispensable_sensors: Vec<usize>,
    /// For people, in the order found.
    pub warnings: Vec<String>,
}

/// Result of the off-line design.
#[derive(Clone, Debug)]
pub struct Design {
    /// The thresholds in force.
    pub thresholds: Thresholds,
    /// The simulation they come from, if one was needed.
    pub calibration: Option<Calibration>,
    /// What else was found.
    pub report: DesignReport,
}

/// Whether two successive factors agree, rows scaled to unit norm.
pub(super) fn has_settled(before: &Matrix, after: &Matrix, tolerance: f64) -> bool {
    before.iter_rows().zip(after.iter_rows()).all(|(before, after)| {
        let norm = dot(after, after).sqrt();
        let mut pairs = before.iter().zip(after);
        pairs.all(|(before, after)| (before - after).abs() <= tolerance * norm)
    })
}

/// Runs the covariance part with all rows until it is steady; `None` if it does not become so.
pub(super) fn steady_state(plant: &Plant, tolerance: f64) -> Option<SteadyState> {
    let model = plant.models.first()?;
    let [n, p, m, r] = model.counts();
    let (input, z) = (vec![0.0; p], vec![0.0; m]);
    let mut filter = Filter::new(&vec![0.0; n], &plant.initial_factor);
    let (mut work, mut update) = (FilterWork::new(n, m, r), Correction::new(n, m));
    for steps in 1..=STEADY_STEPS {
        let before = filter.covariance_factor.clone();
        filter.step(model, &input, &input, &z, &mut work, &mut update);
        if !filter.is_finite() {
            return None;
        }
        if has_settled(&before, &filter.covariance_factor, tolerance) {
            return Some(SteadyState::new(steps, model, &filter, &update));
        }
    }
    None
}

impl SteadyState {
    fn new(steps: usize, model: &StepModel, filter: &Filter, update: &Correction) -> Self {
        let factor = filter.covariance_factor.to_dense();
        let covariance = &factor * factor.transpose();
        let (phi, g) = (model.transition.to_dense(), model.noise_factor.to_dense());
        let innovation_factor = update.innovation_factor.to_dense();
        // K = K̄ L_S⁻¹: solve L_S' K' = K̄'.
        let gain = innovation_factor
            .tr_solve_lower_triangular(&update.gain.to_dense().transpose())
            .unwrap_or_else(|| DMatrix::zeros(update.gain.columns(), update.gain.rows()))
            .transpose();
        Self {
            steps,
            prediction_covariance: &phi * &covariance * phi.transpose() + &g * g.transpose(),
            covariance,
            innovation_covariance: &innovation_factor * innovation_factor.transpose(),
            gain,
            factor: filter.covariance_factor.clone(),
        }
    }
}

/// A steady engine: detectors empty, filter at zero.
struct SteadyRun<'a> {
    model: &'a StepModel,
    engine: Engine,
    filter: Filter,
    detectors: Detectors,
    input: Vec<f64>,
}

impl<'a> SteadyRun<'a> {
    fn new(model: &'a StepModel, design: EngineDesign, steady: &SteadyState) -> Self {
        let [n, p, ..] = model.counts();
        Self {
            model,
            filter: Filter::new(&vec![0.0; n], &steady.factor),
            detectors: Detectors::new(&design),
            engine: Engine::new(design),
            input: vec![0.0; p],
        }
    }

    fn step(&mut self, z: &[f64]) {
        let Self {
            model,
            engine,
            filter,
            detectors,
            input,
        } = self;
        engine.step(filter, detectors, model, input, input, z);
    }
}

/// The windows whose non-centrality 4N instants after a unit step of a sensor is below that of the residual.
pub(super) fn insensitive_windows(
    plant: &Plant,
    design: &EngineDesign,
    steady: &SteadyState,
) -> Vec<InsensitiveWindow> {
    let Some(model) = plant.models.first() else {
        return Vec::new();
    };
    let design = EngineDesign {
        plain: false,
        pair_reset_steps: None,
        cusum_reference: None,
        glr: None,
        ..design.clone()
    };
    let longest = design.window_steps.last().copied().unwrap_or(0);
    let mut found = Vec::new();
    for sensor in 0..design.measurements {
        let mut run = SteadyRun::new(model, design.clone(), steady);
        let mut z = vec![0.0; design.measurements];
        (0..longest).for_each(|_| run.step(&z));
        z[sensor] = 1.0;
        for after in 0..=4 * longest {
            run.step(&z);
            let outcome = &run.engine.outcome;
            let residual = outcome.residual.value;
            let due = outcome.windows().filter(|(steps, _)| 4 * steps == after);
            for (window_steps, statistic) in due {
                if residual >= SILENT && statistic.value < (1.0 - ROUNDING) * residual {
                    let ratio = statistic.value / residual;
                    found.push(InsensitiveWindow {
                        window_steps,
                        sensor,
                        ratio,
                    });
                }
            }
        }
    }
    found.sort_by_key(|window| window.window_steps);
    found
}

/// Products of the steady signatures, Σ g_i' g_j over the first half of the window and over all of it.
fn signature_products(
    model: &StepModel,
    design: &EngineDesign,
    glr: &GlrDesign,
    steady: &SteadyState,
) -> [DMatrix<f64>; 2] {
    let single = EngineDesign {
        plain: false,
        pair_reset_steps: None,
        window_steps: Vec::new(),
        cusum_reference: None,
        glr: Some(GlrDesign {
            stride: glr.window_steps,
            ..glr.clone()
        }),
        ..design.clone()
    };
    let mut run = SteadyRun::new(model, single, steady);
    let modes = glr.modes.len();
    let z = vec![0.0; design.measurements];
    let mut sum = DMatrix::zeros(modes, modes);
    let mut half = sum.clone();
    for k in 0..glr.window_steps {
        run.step(&z);
        if let Some(work) = &run.engine.outcome.glr {
            let g = work.signature.to_dense();
            sum += g.tr_mul(&g);
        }
        if k + 1 == glr.window_steps.div_ceil(2) {
            half = sum.clone();
        }
    }
    [half, sum]
}

/// Modes that are hard to tell apart, and modes whose energy stops growing.
pub(super) fn separability(
    plant: &Plant,
    design: &EngineDesign,
    steady: &SteadyState,
    margin: f64,
) -> (Vec<InseparableModes>, Vec<FaultMode>) {
    let (Some(model), Some(glr)) = (plant.models.first(), &design.glr) else {
        return (Vec::new(), Vec::new());
    };
    let [half, products] = signature_products(model, design, glr, steady);
    let mut alike = Vec::new();
    let mut fading = Vec::new();
    for (i, mode) in glr.modes.iter().enumerate() {
        let energy = products[(i, i)];
        if energy - half[(i, i)] <= FADED * energy {
            fading.push(*mode);
        }
        for (j, other) in glr.modes.iter().enumerate() {
            let squared = products[(i, j)].powi(2) / (energy * products[(j, j)]);
            if mode.component != other.component && squared > ALIKE {
                alike.push(InseparableModes {
                    mode: i,
                    other: j,
                    smallest_isolable_size: (margin / (energy * (1.0 - squared).max(0.0))).sqrt(),
                });
            }
        }
    }
    (alike, fading)
}
