//! One instant of filter and statistics (method sheet 4, steps 1 to 9).

use super::{
    cusum::Cusum,
    filter::{Correction, Filter, FilterWork},
    glr::{Glr, GlrDesign, GlrWork, LikelihoodRatio},
    propagator::{Propagator, PropagatorPair, PropagatorWork},
    quadratic_form::QuadraticForm,
    step_model::StepModel,
    window::{Ring, WindowBank, WindowOutcome},
};
use crate::matrix::{Matrix, dot};
use serde::{Deserialize, Serialize};

/// A chi-square statistic at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Statistic {
    /// λ.
    pub value: f64,
    /// Degrees of freedom; 0: nothing can be tested.
    pub degrees: usize,
}

/// Which statistics are computed, and how.
#[derive(Clone, Debug)]
pub(super) struct EngineDesign {
    /// n, m, r.
    pub states: usize,
    pub measurements: usize,
    pub noises: usize,
    pub plain: bool,
    /// L, if the pair is enabled.
    pub pair_reset_steps: Option<u64>,
    /// Windows N in ascending order; none: not enabled.
    pub window_steps: Vec<usize>,
    /// ref, if enabled.
    pub cusum_reference: Option<f64>,
    pub glr: Option<GlrDesign>,
    pub rank_tolerance: f64,
}

/// The memory of the statistics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Detectors {
    pub plain: Option<Propagator>,
    pub pair: Option<PropagatorPair>,
    pub ring: Option<Ring>,
    pub cusum: Option<Cusum>,
    pub glr: Option<Glr>,
}

impl Detectors {
    pub fn new(design: &EngineDesign) -> Self {
        let (n, m) = (design.states, design.measurements);
        Self {
            plain: design.plain.then(|| Propagator::new(n)),
            pair: design.pair_reset_steps.map(|_| PropagatorPair::new(n)),
            ring: design
                .window_steps
                .last()
                .map(|longest| Ring::new(n, m, *longest)),
            cusum: design.cusum_reference.map(|_| Cusum::new(m)),
            glr: design.glr.as_ref().map(|glr| Glr::new(n, glr)),
        }
    }

    /// Forgets everything: as right after construction.
    pub fn clear(&mut self) {
        if let Some(plain) = &mut self.plain {
            plain.clear();
        }
        if let Some(pair) = &mut self.pair {
            pair.clear();
        }
        if let Some(ring) = &mut self.ring {
            ring.clear();
        }
        if let Some(cusum) = &mut self.cusum {
            cusum.clear();
        }
        if let Some(glr) = &mut self.glr {
            glr.clear();
        }
    }

    pub fn is_finite(&self) -> bool {
        self.plain.as_ref().is_none_or(Propagator::is_finite)
            && self.pair.as_ref().is_none_or(PropagatorPair::is_finite)
            && self.cusum.as_ref().is_none_or(Cusum::is_finite)
            && self.glr.as_ref().is_none_or(Glr::is_finite)
    }

    pub fn fits(&self, other: &Self) -> bool {
        both(&self.plain, &other.plain, Propagator::fits)
            && both(&self.pair, &other.pair, PropagatorPair::fits)
            && both(&self.ring, &other.ring, Ring::fits)
            && both(&self.cusum, &other.cusum, Cusum::fits)
            && both(&self.glr, &other.glr, Glr::fits)
    }
}

fn both<T>(left: &Option<T>, right: &Option<T>, fits: impl Fn(&T, &T) -> bool) -> bool {
    match (left, right) {
        (Some(left), Some(right)) => fits(left, right),
        (None, None) => true,
        _ => false,
    }
}

/// What one instant gave; statistics that are not enabled stay at their default.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The residual test.
    pub residual: Statistic,
    /// The plain state test.
    pub plain: Statistic,
    /// The propagator pair.
    pub pair: Statistic,
    pub(super) windows: WindowBank,
    pub(super) update: Correction,
    pub(super) glr: Option<GlrWork>,
    /// max(p_i, q_i) of every sensor with the sign of the larger side.
    pub cusum: Vec<f64>,
}

impl Outcome {
    fn new(design: &EngineDesign) -> Self {
        let (n, m) = (design.states, design.measurements);
        Self {
            residual: Statistic::default(),
            plain: Statistic::default(),
            pair: Statistic::default(),
            windows: WindowBank::new(n, m, &design.window_steps, design.rank_tolerance),
            update: Correction::new(n, m, design.noises),
            glr: design.glr.as_ref().map(|glr| GlrWork::new(n, glr)),
            cusum: vec![0.0; m],
        }
    }

    /// The state windows (N, λ), in ascending order of N.
    pub fn windows(&self) -> impl Iterator<Item = (usize, Statistic)> {
        self.windows
            .outcomes
            .iter()
            .map(|outcome| (outcome.steps, outcome.statistic))
    }

    /// Difference β (n) and factor of its covariance (n x n) of the window N.
    pub fn window_difference(&self, steps: usize) -> Option<(&[f64], &Matrix)> {
        let mut outcomes = self.windows.outcomes.iter();
        let found: &WindowOutcome = outcomes.find(|outcome| outcome.steps == steps)?;
        Some((&found.difference, &found.factor))
    }

    /// The likeliest fault of all.
    pub fn likelihood_ratio(&self) -> Option<LikelihoodRatio> {
        self.glr.as_ref().and_then(|glr| glr.best)
    }

    /// The likeliest fault of one component.
    pub fn likelihood_ratio_of(&self, component: usize) -> Option<LikelihoodRatio> {
        self.glr
            .as_ref()
            .and_then(|glr| glr.best_of_component.get(component).copied().flatten())
    }

    /// The available rows, their innovations ν and the variances S_ii.
    pub fn innovations(&self) -> impl Iterator<Item = (usize, f64, f64)> {
        let update = &self.update;
        let rows = update.rows.iter().zip(&update.innovation).zip(&update.variance);
        rows.map(|((row, innovation), variance)| (*row, *innovation, *variance))
    }

    /// Number of rows that arrived, m_k.
    pub fn available_rows(&self) -> usize {
        self.update.rows.len()
    }
}

/// Filter, statistics and the room they need.
#[derive(Clone, Debug)]
pub(super) struct Engine {
    pub design: EngineDesign,
    pub outcome: Outcome,
    pub filter_work: FilterWork,
    propagator_work: PropagatorWork,
    form: QuadraticForm,
}

impl Engine {
    pub fn new(design: EngineDesign) -> Self {
        let (n, m) = (design.states, design.measurements);
        Self {
            outcome: Outcome::new(&design),
            filter_work: FilterWork::new(n, m, design.noises),
            propagator_work: PropagatorWork::new(n, m),
            form: QuadraticForm::new(n, design.rank_tolerance),
            design,
        }
    }

    /// Steps filter and statistics by one instant; elements of `z` that are not finite are missing.
    pub fn step(
        &mut self,
        filter: &mut Filter,
        detectors: &mut Detectors,
        model: &StepModel,
        previous_input: &[f64],
        input: &[f64],
        z: &[f64],
    ) {
        let Self {
            design,
            outcome,
            filter_work,
            propagator_work,
            form,
        } = self;
        let update = &mut outcome.update;
        filter.step(model, previous_input, input, z, filter_work, update);
        outcome.residual = Statistic {
            value: update.residual_statistic(),
            degrees: update.rows.len(),
        };
        if let Some(plain) = &mut detectors.plain {
            plain.step(&model.transition, update, propagator_work);
            outcome.plain = evaluate(plain, form);
        }
        if let (Some(pair), Some(reset_steps)) = (&mut detectors.pair, design.pair_reset_steps) {
            // The restart belongs to the end of the previous instant: the one in use stays readable until then.
            pair.restart_when_due(reset_steps);
            pair.step(&model.transition, update, propagator_work);
            outcome.pair = evaluate(pair.in_use(), form);
        }
        if let Some(ring) = &mut detectors.ring {
            ring.push(&model.transition, update);
            outcome.windows.evaluate(ring, update.steady_steps);
        }
        if let (Some(cusum), Some(reference)) = (&mut detectors.cusum, design.cusum_reference) {
            cusum.step(reference, update);
            for (row, value) in outcome.cusum.iter_mut().enumerate() {
                *value = cusum.signed(row);
            }
        }
        if let (Some(glr), Some(glr_design), Some(work)) = (&mut detectors.glr, &design.glr, &mut outcome.glr)
        {
            glr.step(glr_design, &model.transition, &model.measurement, update, work);
        }
    }

    /// Forgets what the last instant gave.
    pub fn forget(&mut self) {
        let outcome = &mut self.outcome;
        outcome.residual = Statistic::default();
        outcome.plain = Statistic::default();
        outcome.pair = Statistic::default();
        outcome.cusum.fill(0.0);
        for window in &mut outcome.windows.outcomes {
            window.statistic = Statistic::default();
        }
        if let Some(glr) = &mut outcome.glr {
            glr.best = None;
            glr.best_of_component.fill(None);
        }
        outcome.update.rows.clear();
        outcome.update.innovation.clear();
        // What was found under the same gains may not be what a restored state holds.
        outcome.update.steady_steps = 0;
    }
}

fn evaluate(propagator: &Propagator, form: &mut QuadraticForm) -> Statistic {
    form.factor(&propagator.factor);
    Statistic {
        value: form.evaluate(&propagator.difference),
        degrees: form.degrees(),
    }
}

/// sqrt(T_ii) of a factor of T.
pub(super) fn deviation(factor: &Matrix, row: usize) -> f64 {
    dot(factor.row(row), factor.row(row)).sqrt()
}
