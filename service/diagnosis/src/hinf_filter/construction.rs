//! Puts the filters together: designs, constants of the thresholds, channels.

use super::{
    HinfFilter,
    achieved::{Assembly, RunningFilter},
    bank::with_faults,
    bounds::{Bounds, BoundsDesign, BoundsState, WindowRule},
    channels::describe,
    constants::{Driven, ErrorFilter, ErrorModel, ThresholdConstants, within_period},
    diagnoser::{Rules, State},
    error::HinfFilterError,
    filter::{FilterState, ResidualFilter, Threshold},
    find::find_gains,
    gains::HinfFilterGains,
    gap::GapEnvelope,
    isolation::{BlindSets, Episode},
    main_filter::MainFilter,
    noise::NoiseBound,
    observer::{Correction, Observer},
    options::{HinfFilterOptions, ThresholdType},
    plant::{Plant, SampledPlant, stacked},
    problem::Problem,
    report::{Report, guarantee},
    synthesis::pseudo_inverse,
    verified::{CheckedEstimate, checked_bank, checked_estimate},
};
use crate::{decomposition::SingularDecomposition, matrix::Matrix, state::StateFormat};
use nalgebra::{DMatrix, DVector};
use residual_shared::record::MAX_CHANNELS;

/// The method's name, as written in the configuration.
pub(super) const METHOD: &str = "hinf_filter";

/// Version of the saved state.
const STATE_VERSION: u16 = 1;

/// One filter to be put together.
struct FilterDesign<'a> {
    label: String,
    closed: DMatrix<f64>,
    gain: DMatrix<f64>,
    v: DMatrix<f64>,
    correction: Correction,
    /// Faults that count as disturbances.
    faults: &'a [usize],
    /// Whether the residual estimates the faults: their direct part is then no error.
    estimates: bool,
}

impl HinfFilter {
    /// Finds the gains without a solver and constructs the filters.
    ///
    /// # Errors
    /// [`HinfFilterError`]: the first condition that does not hold.
    pub fn new(options: &HinfFilterOptions, sample_time_s: f64) -> Result<Self, HinfFilterError> {
        let problem = Problem::new(options, sample_time_s)?;
        let gains = find_gains(&problem, options)?;
        Self::assemble(problem, options, &gains)
    }

    /// Constructs the filters that run on these gains, certifies them anew and computes their thresholds.
    ///
    /// # Errors
    /// [`HinfFilterError`]: the first condition that does not hold.
    pub fn with_gains(
        options: &HinfFilterOptions,
        sample_time_s: f64,
        gains: &HinfFilterGains,
    ) -> Result<Self, HinfFilterError> {
        Self::assemble(Problem::new(options, sample_time_s)?, options, gains)
    }

    fn assemble(
        problem: Problem,
        options: &HinfFilterOptions,
        gains: &HinfFilterGains,
    ) -> Result<Self, HinfFilterError> {
        let sample_time_s = problem.sampled.sample_time_s;
        let gain_key = if gains.main.h.is_some() {
            "gains.main.H"
        } else {
            "gains.main.L"
        };
        let main =
            MainFilter::new(&problem, options, &gains.main).map_err(|error| error.of_gains(gain_key))?;
        let blind = checked_bank(&problem, options, &gains.blind)?;
        let estimate = checked_estimate(&problem, options, gains.estimator.as_ref())?;
        let build = Builder {
            problem: &problem,
            options,
        };
        let open = &problem.sampled.ad;
        let mut designs = vec![FilterDesign {
            label: "the filter".to_owned(),
            closed: main.closed.clone(),
            gain: main.gain.clone(),
            v: main.v.clone(),
            correction: main.correction.clone(),
            faults: &[],
            estimates: false,
        }];
        for (index, checked) in blind.iter().enumerate() {
            designs.push(FilterDesign {
                label: format!("blind filter {index}"),
                closed: open - &checked.gain * &problem.plant.c,
                correction: Correction::residual(&checked.gain),
                gain: checked.gain.clone(),
                v: checked.v.clone(),
                faults: &problem.faults.blind[index],
                estimates: false,
            });
        }
        let bank = problem.faults.blind.len();
        let all: Vec<usize> = (0..problem.plant.bf.ncols()).collect();
        let estimates = estimate.is_some();
        if let Some(CheckedEstimate { gain, inverse }) = estimate {
            designs.push(FilterDesign {
                label: "the fault estimate".to_owned(),
                closed: open - &gain * &problem.plant.c,
                correction: Correction::residual(&gain),
                gain,
                v: inverse,
                faults: &all,
                estimates: true,
            });
        }
        let (mut filters, mut states, mut constants) = (Vec::new(), Vec::new(), Vec::new());
        for design in &designs {
            let (filter, state, found) = build.filter(design)?;
            filters.push(filter);
            states.push(state);
            constants.push(found);
        }
        let description = describe(&problem, options, &main, &filters, bank, estimates);
        if description.channels.len() > MAX_CHANNELS {
            return Err(HinfFilterError::TooManyChannels {
                count: description.channels.len(),
                limit: MAX_CHANNELS,
            });
        }
        let isolation = options.isolation.as_ref();
        let wait_s = isolation.map_or(0.0, |isolation| isolation.isolation_wait);
        let rules = Rules::new(&problem, options, bank);
        let running = filters
            .iter()
            .zip(&designs)
            .map(|(filter, design)| RunningFilter {
                filter,
                closed: &design.closed,
                gain: &design.gain,
                v: &design.v,
            });
        let assembly = Assembly {
            problem: &problem,
            options,
            main: &main,
            running: running.collect(),
            blind: &blind,
            guarantee: &guarantee(options, &main),
        };
        let report = Report::new(&assembly, &filters[0], constants.swap_remove(0));
        let (n, p) = (problem.plant.a.nrows(), problem.plant.b.ncols());
        let mut filter = Self {
            filters,
            rules,
            sets: BlindSets::new(
                &problem.faults.blind,
                problem.plant.bf.ncols(),
                (wait_s / sample_time_s).ceil() as u64,
            ),
            state: State::new(states, p, Episode::default()),
            start: vec![0.0; n],
            format: StateFormat::new(METHOD, STATE_VERSION, &(options, sample_time_s, gains)),
            description,
            report,
        };
        filter.clear();
        Ok(filter)
    }
}

struct Builder<'a> {
    problem: &'a Problem,
    options: &'a HinfFilterOptions,
}

type Built = (ResidualFilter, FilterState, Option<ThresholdConstants>);

impl Builder<'_> {
    fn filter(&self, design: &FilterDesign<'_>) -> Result<Built, HinfFilterError> {
        let Problem { plant, sampled, .. } = self.problem;
        let tested = design.v.nrows();
        let (v, inverse) = with_raw_rows(&design.v);
        let guaranteed = self.options.evaluation.threshold == ThresholdType::Guaranteed;
        let amplitude = self.problem.disturbance.amplitude.is_some();
        let peak_test = guaranteed && amplitude && self.options.evaluation.peak_test.unwrap_or(true);
        let (threshold, bounds, constants) = if guaranteed {
            let (bounds, state, constants) = self.bounds(design, &v, &inverse, tested)?;
            (
                Threshold::Guaranteed(Box::new(bounds)),
                Some(state),
                Some(constants),
            )
        } else {
            let constant = self
                .options
                .evaluation
                .constant_threshold
                .unwrap_or(f64::INFINITY);
            (Threshold::Constant(constant), None, None)
        };
        let rule = WindowRule {
            sample_time_s: sampled.sample_time_s,
            include_current: self.options.evaluation.include_current,
        };
        let observer = Observer::new(plant, sampled, design.correction.clone());
        let filter = ResidualFilter::new(observer, Matrix::from(&v), tested, threshold, rule, peak_test);
        let state = filter.initial_state(bounds, self.problem.window);
        Ok((filter, state, constants))
    }

    fn bounds(
        &self,
        design: &FilterDesign<'_>,
        v: &DMatrix<f64>,
        inverse: &DMatrix<f64>,
        tested: usize,
    ) -> Result<(Bounds, BoundsState, ThresholdConstants), HinfFilterError> {
        let problem = self.problem;
        let Problem {
            plant,
            sampled,
            disturbance,
            faults,
            ..
        } = problem;
        let sample_time_s = sampled.sample_time_s;
        let too_slow = || HinfFilterError::TooSlow {
            filter: design.label.clone(),
        };
        let filter = ErrorFilter {
            closed: &design.closed,
            gain: &design.gain,
            c: &plant.c,
            v,
        };
        let pick = |values: &DVector<f64>| design.faults.iter().map(|j| values[*j]).collect::<Vec<_>>();
        let amplitude = joined(&problem.amplitude(), &pick(&faults.bound));
        let slew = joined(&disturbance.slew, &pick(&faults.slew));
        let driven = match disturbance.window_energy {
            Some(energy) if disturbance.amplitude.is_none() => Driven::Energy(energy),
            _ => Driven::Amplitude(&amplitude),
        };
        let direct = with_faults(&plant.dd, &plant.df, design.faults);
        let nominal = std::iter::once((plant, sampled));
        let others = problem.listed.iter().map(|(plant, sampled)| (plant, sampled));
        let mut models = Vec::new();
        for (index, (true_plant, true_sampled)) in nominal.chain(others).enumerate() {
            let mut model = error_model(
                filter,
                design,
                (plant, sampled),
                (true_plant, true_sampled),
                &direct,
                &slew,
                index > 0,
            );
            if design.estimates {
                let m = plant.dd.ncols();
                model.f.columns_mut(m, design.faults.len()).fill(0.0);
            }
            let constants = ThresholdConstants::new(&model, driven, problem.window, tested, sample_time_s)
                .ok_or_else(too_slow)?;
            models.push((model, constants));
        }
        let gap = GapEnvelope::new(filter, inverse).ok_or_else(too_slow)?;
        let noise = match (&problem.noise, problem.window) {
            (Some(noise), Some(window)) => {
                Some(NoiseBound::new(filter, noise, window, tested, sample_time_s).ok_or_else(too_slow)?)
            }
            _ => None,
        };
        let (bounds, state) = Bounds::new(&BoundsDesign {
            models: &models,
            initial: problem.initial_error(&direct, &amplitude),
            gap: &gap,
            noise: noise.as_ref(),
            by_amplitude: disturbance.amplitude.is_some(),
            tested,
            window: problem.window,
            absolute: [
                v.abs(),
                plant.c.abs(),
                plant.d.abs(),
                sampled.ad.abs(),
                sampled.bud.abs(),
                design.gain.abs(),
            ],
        });
        let constants = models.swap_remove(0).1;
        Ok((bounds, state, constants))
    }
}

/// The error when `truth` is the plant.
fn error_model(
    filter: ErrorFilter<'_>,
    design: &FilterDesign<'_>,
    nominal: (&Plant, &SampledPlant),
    truth: (&Plant, &SampledPlant),
    direct: &DMatrix<f64>,
    slew: &DVector<f64>,
    listed: bool,
) -> ErrorModel {
    let sample_time_s = nominal.1.sample_time_s;
    let input = with_faults(&truth.1.bdd, &truth.1.bfd, design.faults);
    let continuous = with_faults(&truth.0.bd, &truth.0.bf, design.faults);
    let within = within_period(&truth.0.a, &continuous, slew, sample_time_s);
    if listed {
        ErrorModel::listed(filter, nominal.1, truth.1, &input, direct, within)
    } else {
        ErrorModel::nominal(filter, &input, direct, within)
    }
}

fn joined(first: &DVector<f64>, second: &[f64]) -> DVector<f64> {
    DVector::from_iterator(first.len() + second.len(), first.iter().chain(second).copied())
}

/// V with a left inverse; where it has none, the raw residuals are bounded beside it: \[V; I\] with \[0, I\].
fn with_raw_rows(v: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let (s, q) = v.shape();
    let values = SingularDecomposition::new(v);
    if s >= q && values.smallest() > 1e-9 * values.largest() {
        return (v.clone(), pseudo_inverse(v));
    }
    let mut inverse = DMatrix::zeros(q, s + q);
    inverse.view_mut((0, s), (q, q)).fill_with_identity();
    (stacked(&[v, &DMatrix::identity(q, q)]), inverse)
}
