//! The gains of a run: all that the statistics multiply the whitened innovations with.
//!
//! They come from the very code that runs online, stepped with a measurement that has no innovation. A constant
//! model becomes steady; from then on the gains repeat themselves and are stored for one period only.

use crate::chi_square::{
    engine::{Detectors, Engine, EngineDesign},
    error::ChiSquareError,
    filter::Filter,
    model_options::Schedule,
    options::{ChiSquareOptions, StatisticKind},
    plant::Plant,
    propagator::Propagator,
    quadratic_form::QuadraticForm,
    steady::has_settled,
    thresholds::table,
};
use crate::matrix::Matrix;

/// Numbers that a table of gains may hold (1 GiB).
const LARGEST_TABLE: usize = 1 << 27;

/// λ/t = ‖W β‖² `inverse_threshold`.
pub(super) struct Whitening {
    /// W, d x n.
    pub rows: Matrix,
    /// 1/t_d; zero without degrees of freedom.
    pub inverse_threshold: f64,
}

/// The likelihood ratio's gains, slot by slot from the newest to the oldest, mode by mode.
pub(super) struct GlrGains {
    /// g, one row per measurement: m x (slots q).
    pub signature: Matrix,
    /// 1/E, zero where there is no test.
    pub inverse_energy: Vec<f64>,
}

/// The gains of one instant.
pub(super) struct InstantGains {
    /// Φ.
    pub transition: Matrix,
    /// K̄.
    pub gain: Matrix,
    /// diag(S)^-1/2 L_S.
    pub normalised: Matrix,
    /// 1/t_m of the residual test.
    pub inverse_residual: f64,
    pub plain: Option<Whitening>,
    pub pair: Option<Whitening>,
    /// M_i K̄_{k-i}, i = 0, 1, ...
    pub window_gains: Vec<Matrix>,
    /// (N, whitening), N ascending.
    pub windows: Vec<(usize, Whitening)>,
    pub glr: Option<GlrGains>,
}

/// The gains of every instant of a run.
pub(super) struct RunGains {
    instants: Vec<InstantGains>,
    /// The last instants that repeat themselves; 0: none do.
    period: usize,
}

impl RunGains {
    pub fn new(
        plant: &Plant,
        design: &EngineDesign,
        options: &ChiSquareOptions,
        kinds: &[StatisticKind],
    ) -> Result<Self, ChiSquareError> {
        let design = only(design, kinds);
        let steps = options.threshold.run_steps;
        let [_, p, m, _] = plant.counts();
        let mut engine = Engine::new(design.clone());
        let mut filter = Filter::new(&vec![0.0; design.states], &plant.initial_factor);
        let mut detectors = Detectors::new(&design);
        let recorder = Recorder::new(&design, options);
        let (input, z) = (vec![0.0; p], vec![0.0; m]);
        let mut gains = Self {
            instants: Vec::new(),
            period: 0,
        };
        let (memory, period) = (memory(&design), period(&design));
        let mut numbers = 0;
        let mut settled = 0;
        let mut last = None;
        for k in 1..=steps {
            let before = filter.covariance_factor.clone();
            let model = model_of(plant, k, steps);
            engine.step(
                &mut filter,
                &mut detectors,
                &plant.models[model],
                &input,
                &input,
                &z,
            );
            let instant = recorder.record(&plant.models[model].transition, &engine, &detectors);
            numbers += instant.numbers();
            if numbers > LARGEST_TABLE {
                return Err(ChiSquareError::setting(
                    "threshold.run_steps",
                    steps,
                    "the gains of so long a run of a model that does not become steady do not fit into memory; use \
                     fewer",
                ));
            }
            gains.instants.push(instant);
            let plain = detectors.plain.as_ref().map(|plain| plain.factor.clone());
            let tolerance = options.numerics.steady_state_tolerance;
            let still = plant.schedule == Schedule::Constant
                && has_settled(&before, &filter.covariance_factor, tolerance)
                && match (&last, &plain) {
                    (Some(last), Some(plain)) => has_settled(last, plain, tolerance),
                    (None, None) => true,
                    _ => false,
                };
            settled = if still { settled + 1 } else { 0 };
            last = plain;
            if settled >= memory + period {
                gains.period = period;
                break;
            }
        }
        Ok(gains)
    }

    /// The gains of instant k, from 1 on.
    pub fn at(&self, k: usize) -> &InstantGains {
        let stored = self.instants.len();
        let index = if k <= stored || self.period == 0 {
            k.clamp(1, stored) - 1
        } else {
            stored - self.period + (k - 1 - stored) % self.period
        };
        &self.instants[index]
    }

    /// Whether the gains become steady within the run.
    #[cfg(test)]
    pub fn repeats(&self) -> bool {
        self.period > 0
    }

    /// Degrees of freedom of a chi-square statistic in the last instant, the smallest of a bank.
    pub fn final_degrees(&self, kind: StatisticKind) -> Option<usize> {
        let last = self.instants.last()?;
        let rows = |whitening: &Whitening| whitening.rows.rows();
        match kind {
            StatisticKind::Residual => Some(last.gain.columns()),
            StatisticKind::StatePlain => last.plain.as_ref().map(rows),
            StatisticKind::StateTwoPropagator => last.pair.as_ref().map(rows),
            StatisticKind::StateWindow => last.windows.iter().map(|(_, whitening)| rows(whitening)).min(),
            StatisticKind::Glr | StatisticKind::Cusum => None,
        }
        .map(|degrees| degrees.max(1))
    }
}

/// The number of the model of instant k: over the assumed schedule, else every model for an equal share of the run.
fn model_of(plant: &Plant, k: usize, steps: usize) -> usize {
    match &plant.assumed_schedule {
        Some(schedule) => schedule[(k - 1) % schedule.len()],
        None => (k - 1) * plant.models.len() / steps.max(1),
    }
}

/// The design without what is not calibrated.
fn only(design: &EngineDesign, kinds: &[StatisticKind]) -> EngineDesign {
    let wanted = |kind| kinds.contains(&kind);
    let mut design = design.clone();
    design.plain &= wanted(StatisticKind::StatePlain);
    if !wanted(StatisticKind::StateTwoPropagator) {
        design.pair_reset_steps = None;
    }
    if !wanted(StatisticKind::StateWindow) {
        design.window_steps.clear();
    }
    if !wanted(StatisticKind::Glr) {
        design.glr = None;
    }
    design
}

/// How many instants back the statistics reach.
fn memory(design: &EngineDesign) -> usize {
    let window = design.window_steps.last().copied().unwrap_or(0);
    let pair = design.pair_reset_steps.map_or(0, |steps| 2 * steps as usize);
    let glr = design
        .glr
        .as_ref()
        .map_or(0, |glr| (glr.window_steps + glr.stride) as usize);
    window.max(pair).max(glr) + 1
}

/// After how many instants the gains of a steady filter repeat themselves.
fn period(design: &EngineDesign) -> usize {
    let pair = design.pair_reset_steps.map_or(1, |steps| steps as usize);
    let stride = design.glr.as_ref().map_or(1, |glr| glr.stride as usize);
    (1..=stride)
        .map(|i| i * pair)
        .find(|steps| steps % stride == 0)
        .unwrap_or(1)
}

struct Recorder<'a> {
    design: &'a EngineDesign,
    thresholds: Vec<f64>,
}

impl<'a> Recorder<'a> {
    fn new(design: &'a EngineDesign, options: &ChiSquareOptions) -> Self {
        let degrees = design.states.max(design.measurements);
        Self {
            design,
            thresholds: table(options.threshold.false_alarm_probability, degrees),
        }
    }

    fn record(&self, transition: &Matrix, engine: &Engine, detectors: &Detectors) -> InstantGains {
        let update = &engine.outcome.update;
        let mut normalised = update.innovation_factor.clone();
        for (i, variance) in update.variance.iter().enumerate() {
            normalised
                .row_mut(i)
                .iter_mut()
                .for_each(|value| *value /= variance.sqrt());
        }
        let of = |propagator: &Propagator| self.whitening(&propagator.factor);
        let windows = &engine.outcome.windows.outcomes;
        InstantGains {
            transition: transition.clone(),
            gain: update.gain.clone(),
            normalised,
            inverse_residual: 1.0 / self.thresholds[update.rows.len()],
            plain: detectors.plain.as_ref().map(of),
            pair: detectors.pair.as_ref().map(|pair| of(pair.in_use())),
            window_gains: detectors
                .ring
                .as_ref()
                .map(|ring| ring.gains())
                .unwrap_or_default(),
            windows: windows
                .iter()
                .map(|window| (window.steps, self.whitening(&window.factor)))
                .collect(),
            glr: self.glr(engine, detectors),
        }
    }

    fn whitening(&self, factor: &Matrix) -> Whitening {
        let mut form = QuadraticForm::new(self.design.states, self.design.rank_tolerance);
        form.factor(factor);
        Whitening {
            rows: form.whitening(),
            inverse_threshold: 1.0 / self.thresholds[form.degrees()],
        }
    }

    fn glr(&self, engine: &Engine, detectors: &Detectors) -> Option<GlrGains> {
        let (design, work, state) = (
            self.design.glr.as_ref()?,
            engine.outcome.glr.as_ref()?,
            detectors.glr.as_ref()?,
        );
        let (slots, modes) = (design.slots(), design.modes.len());
        let newest = state.newest_slot(design);
        let mut gains = GlrGains {
            signature: Matrix::zeros(work.signature.rows(), slots * modes),
            inverse_energy: vec![0.0; slots * modes],
        };
        for rank in 0..slots {
            let slot = (newest + slots - rank) % slots;
            for mode in 0..modes {
                let (from, to) = (slot * modes + mode, rank * modes + mode);
                for i in 0..work.signature.rows() {
                    gains.signature[(i, to)] = work.signature[(i, from)];
                }
                gains.inverse_energy[to] = state.inverse_energy(from);
            }
        }
        Some(gains)
    }
}

impl InstantGains {
    /// Numbers stored.
    fn numbers(&self) -> usize {
        let size = |matrix: &Matrix| matrix.rows() * matrix.columns();
        let windows = self.window_gains.iter().map(size).sum::<usize>();
        let glr = self
            .glr
            .as_ref()
            .map_or(0, |glr| size(&glr.signature) + glr.inverse_energy.len());
        size(&self.transition) * 2 + size(&self.gain) + windows + glr
    }
}
