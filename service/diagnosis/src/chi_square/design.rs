//! What the off-line design finds for a constant model: steady filter, blind windows, modes that cannot be told
//! apart (method sheet 3).

use super::{
    calibration::Calibration,
    engine::{Detectors, Engine, EngineDesign},
    filter::Filter,
    glr::GlrDesign,
    glr_modes::FaultMode,
    plant::Plant,
    stability::Stability,
    steady::SteadyState,
    step_model::StepModel,
    thresholds::Thresholds,
};
use nalgebra::DMatrix;

/// A residual non-centrality below this says nothing about a window.
const SILENT: f64 = 1e-6;
/// A window of one step equals the residual test up to this.
const ROUNDING: f64 = 1e-6;
/// Squared correlation of two signatures from which they count as hardly separable.
const ALIKE: f64 = 0.95;
/// Share of the energy below which the second half of the window adds nothing.
const FADED: f64 = 1e-3;

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

/// A steady engine: detectors empty, filter at zero.
#[derive(Clone)]
pub(super) struct SteadyRun<'a> {
    model: &'a StepModel,
    pub engine: Engine,
    filter: Filter,
    detectors: Detectors,
    input: Vec<f64>,
}

impl<'a> SteadyRun<'a> {
    pub fn new(model: &'a StepModel, design: EngineDesign, steady: &SteadyState) -> Self {
        let [n, p, ..] = model.counts();
        Self {
            model,
            filter: Filter::new(&vec![0.0; n], &steady.factor),
            detectors: Detectors::new(&design),
            engine: Engine::new(design),
            input: vec![0.0; p],
        }
    }

    pub fn step(&mut self, z: &[f64]) {
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
