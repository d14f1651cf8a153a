//! One fusion instant: mixing, samples, probabilities (method sheet 4.2).

use super::{
    batch::BatchUpdate,
    design::{Form, ImmDesign},
    design_error::DesignError,
    inputs::{InputHistory, microseconds},
    mixing::Mixer,
    probability::update_probability,
    propagator::Propagator,
    recursion::Recursion,
    sensor::SensorModel,
    state::{ModeState, Posterior},
    transition::TransitionTable,
};
use crate::matrix::{Matrix, all_finite};

/// One sample of one sensor.
#[derive(Clone, Copy, Debug)]
pub struct Sample<'a> {
    /// When it was taken, ns.
    pub time_ns: i64,
    /// Number of the sensor.
    pub sensor: usize,
    /// The values, d.
    pub values: &'a [f64],
    /// y⁻ of the batch form; `None`: what the sensor sent last.
    pub held_before: Option<&'a [f64]>,
}

/// What happened over one interval.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct IntervalReport {
    /// Samples that were used.
    pub used: u32,
    /// Samples left out in all modes: without a factor of S, of the wrong length or sensor, or out of order.
    pub update_rejected: u32,
    /// Whether no mode had a finite likelihood, so that the probabilities are the predicted ones.
    pub likelihood_lost: bool,
}

/// The bank of mode filters without its state: turns the posterior at t_{k-1} into the one at t_k.
///
/// Nothing allocates after construction.
#[derive(Clone)]
pub struct ImmEstimator {
    pub(super) prior: Posterior,
    directions: Vec<Matrix>,
    sensors: Vec<SensorModel>,
    propagators: Vec<Propagator>,
    /// Which propagator serves a mode.
    propagator_of: Vec<usize>,
    transition: TransitionTable,
    mixer: Mixer,
    recursion: Recursion,
    mixed: Vec<ModeState>,
    log_predicted: Vec<f64>,
    log_likelihood: Vec<f64>,
    log_weight: Vec<f64>,
}

impl ImmEstimator {
    /// The bank of a design; `max_slots` bounds the samples of one interval in the batch form.
    ///
    /// # Errors
    /// [`DesignError`]: the first condition of method sheet 3 that does not hold.
    pub fn new(design: &ImmDesign, max_slots: usize) -> Result<Self, DesignError> {
        super::checks::check(design)?;
        let (n, modes) = (design.filter_states(), design.modes.len());
        let prior = Posterior::prior(design, 0);
        let with_root = design.form == Form::SequentialSquareRoot;
        let mut propagators = Vec::new();
        let mut propagator_of = Vec::new();
        let mut common = None;
        for mode in &design.modes {
            let place = if mode.random_walk_psd.iter().all(|density| *density == 0.0) {
                *common.get_or_insert_with(|| {
                    propagators.push(Propagator::of_plant(&design.plant, with_root));
                    propagators.len() - 1
                })
            } else {
                let (direction, density) = (&mode.direction, &mode.random_walk_psd);
                propagators.push(Propagator::of_mode(&design.plant, direction, density, with_root));
                propagators.len() - 1
            };
            propagator_of.push(place);
        }
        let recursion = Recursion::new(design, &prior.modes, max_slots);
        Ok(Self {
            directions: design
                .modes
                .iter()
                .map(|mode| Matrix::from(&mode.direction))
                .collect(),
            sensors: design
                .sensors
                .iter()
                .map(|sensor| SensorModel::new(sensor, n))
                .collect(),
            propagators,
            propagator_of,
            transition: TransitionTable::new(&design.transition, modes),
            mixer: Mixer::new(design),
            recursion,
            mixed: prior.modes.clone(),
            log_predicted: vec![0.0; modes],
            log_likelihood: vec![0.0; modes],
            log_weight: vec![0.0; modes],
            prior,
        })
    }

    /// The posterior at t_0: the prior of the design.
    pub fn start(&self, instant_ns: i64) -> Posterior {
        let mut posterior = self.prior.clone();
        posterior.instant_ns = instant_ns;
        posterior
    }

    /// ℓ of the latest interval, one per mode.
    pub fn log_likelihood(&self) -> &[f64] {
        &self.log_likelihood
    }

    /// The batch update of the latest interval, for inspection; `None` in the other forms.
    pub fn batch(&self) -> Option<&BatchUpdate> {
        match &self.recursion {
            Recursion::Batch { update, .. } => Some(update),
            _ => None,
        }
    }

    /// From t_{k-1} to `instant_ns` = t_k with the samples of (t_{k-1}, t_k\], in order of time (in any order in
    /// the batch form, if `held_before` is given).
    pub fn advance<'a>(
        &mut self,
        posterior: &mut Posterior,
        instant_ns: i64,
        samples: impl Iterator<Item = Sample<'a>>,
        commands: &InputHistory,
    ) -> IntervalReport {
        let (begin, end) = (microseconds(posterior.instant_ns), microseconds(instant_ns));
        let log_lambda = self.transition.log_over(end - begin);
        self.mixer
            .weigh(&posterior.log_probability, log_lambda, &mut self.log_predicted);
        self.recursion
            .mix(&mut self.mixer, &posterior.modes, &mut self.mixed);
        self.log_likelihood.fill(0.0);
        let mut report = IntervalReport::default();
        let window = Window {
            begin_ns: posterior.instant_ns,
            end_ns: instant_ns,
        };
        if matches!(self.recursion, Recursion::Batch { .. }) {
            self.use_all_at_once(window, samples, &mut posterior.held, commands, &mut report);
        } else {
            self.use_one_by_one(window, samples, commands, &mut report);
        }
        self.recursion.finish(&mut self.mixed);
        report.likelihood_lost = self.weigh(&mut posterior.log_probability);
        std::mem::swap(&mut posterior.modes, &mut self.mixed);
        posterior.instant_ns = instant_ns;
        report
    }

    fn use_one_by_one<'a>(
        &mut self,
        window: Window,
        samples: impl Iterator<Item = Sample<'a>>,
        commands: &InputHistory,
        report: &mut IntervalReport,
    ) {
        let mut time = window.begin_ns;
        for sample in samples {
            let in_order = sample.time_ns >= time && window.contains(sample.time_ns);
            if !in_order || !self.is_well_formed(&sample) {
                report.update_rejected += 1;
                continue;
            }
            self.predict(time, sample.time_ns, commands);
            time = sample.time_ns;
            if self.update(&sample) {
                report.used += 1;
            } else {
                report.update_rejected += 1;
            }
        }
        self.predict(time, window.end_ns, commands);
    }

    fn use_all_at_once<'a>(
        &mut self,
        window: Window,
        samples: impl Iterator<Item = Sample<'a>>,
        held: &mut [Vec<f64>],
        commands: &InputHistory,
        report: &mut IntervalReport,
    ) {
        let end = microseconds(window.end_ns);
        if let Recursion::Batch { update, .. } = &mut self.recursion {
            update.begin();
        }
        for sample in samples {
            if !window.contains(sample.time_ns) || !self.is_well_formed(&sample) {
                report.update_rejected += 1;
                continue;
            }
            let Recursion::Batch { update, .. } = &mut self.recursion else {
                continue;
            };
            let (Some(propagator), Some(sensor), Some(held)) = (
                self.propagators.first_mut(),
                self.sensors.get(sample.sensor),
                held.get_mut(sample.sensor),
            ) else {
                continue;
            };
            let time = microseconds(sample.time_ns);
            propagator.go(time, end, commands);
            let before = sample.held_before.unwrap_or(held);
            if update.add(time, sensor, (sample.values, before), propagator.interval()) {
                report.used += 1;
            } else {
                report.update_rejected += 1;
            }
            held.copy_from_slice(sample.values);
        }
        self.predict(window.begin_ns, window.end_ns, commands);
        let all =
            self.recursion
                .update_all_at_once(&self.directions, &mut self.mixed, &mut self.log_likelihood);
        if !all {
            report.update_rejected += std::mem::take(&mut report.used);
        }
    }

    fn is_well_formed(&self, sample: &Sample<'_>) -> bool {
        let rows = self.sensors.get(sample.sensor).map(SensorModel::rows);
        let fits = |values: &[f64]| rows == Some(values.len()) && all_finite(values);
        fits(sample.values) && sample.held_before.is_none_or(fits)
    }

    /// Predicts every mode.
    fn predict(&mut self, from_ns: i64, to_ns: i64, commands: &InputHistory) {
        let (from, to) = (microseconds(from_ns), microseconds(to_ns));
        if from >= to {
            return;
        }
        for (place, propagator) in self.propagators.iter_mut().enumerate() {
            propagator.go(from, to, commands);
            let (interval, root) = (propagator.interval(), propagator.noise_root());
            self.recursion.prepare(interval);
            let served = self.mixed.iter_mut().enumerate();
            for (m, state) in served.filter(|(m, _)| self.propagator_of[*m] == place) {
                self.recursion
                    .predict(m, interval, root, &self.directions[m], state);
            }
        }
    }

    /// Uses one sample in every mode, or in none: likelihoods must compare the same data.
    fn update(&mut self, sample: &Sample<'_>) -> bool {
        let sensor = &self.sensors[sample.sensor];
        for (m, state) in self.mixed.iter().enumerate() {
            if !self.recursion.innovate(m, state, sensor, sample.values) {
                return false;
            }
        }
        for (m, state) in self.mixed.iter_mut().enumerate() {
            self.log_likelihood[m] += self.recursion.update(m, state, sensor);
        }
        true
    }

    /// log μ from log c and ℓ; true if no likelihood was finite and log c is kept.
    fn weigh(&mut self, log_probability: &mut [f64]) -> bool {
        update_probability(
            &self.log_predicted,
            &self.log_likelihood,
            &mut self.log_weight,
            log_probability,
        )
    }
}

#[derive(Clone, Copy)]
struct Window {
    begin_ns: i64,
    end_ns: i64,
}

impl Window {
    fn contains(self, time_ns: i64) -> bool {
        self.begin_ns < time_ns && time_ns <= self.end_ns
    }
}
