//! Puts the filters together: designs, constants of the thresholds, channels.

use super::{
    HinfFilter,
    bank::{design_blind, design_estimate, with_faults},
    bounds::{Bounds, BoundsDesign, BoundsState, WindowRule},
    constants::{
        Driven, ErrorFilter, ErrorModel, GapEnvelope, NoiseBound, ThresholdConstants, within_period,
    },
    diagnoser::{Rules, State},
    error::HinfFilterError,
    filter::{FilterState, ResidualFilter, Threshold},
    gain::{MainDesign, design_main},
    isolation::{BlindSets, Episode},
    observer::{Correction, Observer},
    options::{HinfFilterOptions, RealisationType, ThresholdType},
    plant::{Plant, SampledPlant, stacked},
    problem::Problem,
    report::Report,
    synthesis::pseudo_inverse,
};
use crate::{
    decomposition::SingularDecomposition,
    diagnoser::{ChannelDescription, Description},
    matrix::Matrix,
    state::StateFormat,
};
use nalgebra::{DMatrix, DVector};
use residual_shared::record::MAX_CHANNELS;

/// The method's name, as written in the configuration.
pub(super) const METHOD: &str = "hinf_filter";

/// Version of the saved state.
const STATE_VERSION: u16 = 1;

/// One filter to be put together.
struct FilterDesign<'a> {
    label: &'a str,
    closed: &'a DMatrix<f64>,
    gain: &'a DMatrix<f64>,
    v: &'a DMatrix<f64>,
    correction: Correction,
    /// Faults that count as disturbances.
    faults: &'a [usize],
    /// Whether the residual estimates the faults: their direct part is then no error.
    estimates: bool,
}

impl HinfFilter {
    /// Checks everything, designs the filters and computes their thresholds.
    ///
    /// # Errors
    /// [`HinfFilterError`]: the first condition that does not hold.
    pub fn new(options: &HinfFilterOptions, sample_time_s: f64) -> Result<Self, HinfFilterError> {
        let problem = Problem::new(options, sample_time_s)?;
        let main = design_main(&problem, options)?;
        let mut filters = Vec::new();
        let mut states = Vec::new();
        let build = Builder {
            problem: &problem,
            options,
        };
        let (filter, state, constants) = build.filter(FilterDesign {
            label: "the filter",
            closed: &main.closed,
            gain: &main.gain,
            v: &main.v,
            correction: main.correction.clone(),
            faults: &[],
            estimates: false,
        })?;
        filters.push(filter);
        states.push(state);
        let mut leaks = Vec::new();
        let isolation = options.isolation.as_ref();
        for (index, blind) in problem.faults.blind.iter().enumerate() {
            let weight = isolation.map_or(1.0, |isolation| isolation.blind_weight);
            let design = design_blind(&problem, index, weight)?;
            let (filter, state, _) = build.discrete(
                &format!("blind filter {index}"),
                &design.gain,
                &design.v,
                blind,
                false,
            )?;
            filters.push(filter);
            states.push(state);
            leaks.push(design.leak);
        }
        let estimates = isolation.is_some_and(|isolation| isolation.fault_estimate);
        if estimates {
            let (gain, inverse) = design_estimate(&problem)?;
            let all: Vec<usize> = (0..problem.plant.bf.ncols()).collect();
            let (filter, state, _) = build.discrete("the fault estimate", &gain, &inverse, &all, true)?;
            filters.push(filter);
            states.push(state);
        }
        let bank = problem.faults.blind.len();
        let description = describe(&problem, options, &main, &filters, bank, estimates);
        if description.channels.len() > MAX_CHANNELS {
            return Err(HinfFilterError::TooManyChannels {
                count: description.channels.len(),
                limit: MAX_CHANNELS,
            });
        }
        let wait_s = isolation.map_or(0.0, |isolation| isolation.isolation_wait);
        let rules = Rules::new(&problem, options, bank);
        let report = Report::new(&problem, options, &main, &filters[0], constants, leaks);
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
            format: StateFormat::new(METHOD, STATE_VERSION, &(options, sample_time_s)),
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
    /// A discrete observer with the gain L.
    fn discrete(
        &self,
        label: &str,
        gain: &DMatrix<f64>,
        v: &DMatrix<f64>,
        faults: &[usize],
        estimates: bool,
    ) -> Result<Built, HinfFilterError> {
        self.filter(FilterDesign {
            label,
            closed: &(&self.problem.sampled.ad - gain * &self.problem.plant.c),
            gain,
            v,
            correction: Correction::residual(gain),
            faults,
            estimates,
        })
    }

    fn filter(&self, design: FilterDesign<'_>) -> Result<Built, HinfFilterError> {
        let Problem { plant, sampled, .. } = self.problem;
        let tested = design.v.nrows();
        let (v, inverse) = with_raw_rows(design.v);
        let guaranteed = self.options.evaluation.threshold == ThresholdType::Guaranteed;
        let amplitude = self.problem.disturbance.amplitude.is_some();
        let peak_test = guaranteed && amplitude && self.options.evaluation.peak_test.unwrap_or(true);
        let (threshold, bounds, constants) = if guaranteed {
            let (bounds, state, constants) = self.bounds(&design, &v, &inverse, tested)?;
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
        let observer = Observer::new(plant, sampled, design.correction);
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
            filter: design.label.to_owned(),
        };
        let filter = ErrorFilter {
            closed: design.closed,
            gain: design.gain,
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

/// Channels: energy and residuals of the main filter, of each blind filter, and the fault estimates.
fn describe(
    problem: &Problem,
    options: &HinfFilterOptions,
    main: &MainDesign,
    filters: &[ResidualFilter],
    bank: usize,
    estimates: bool,
) -> Description {
    let (_, p, q, _, _) = problem.plant.dimensions();
    let plain = main.v == DMatrix::identity(q, q);
    let names = &problem.faults.names;
    let mut channels = Vec::new();
    let mut add = |name: String, unit: &str| {
        channels.push(ChannelDescription {
            name,
            unit: unit.to_owned(),
        })
    };
    for (i, filter) in filters.iter().take(1 + bank).enumerate() {
        let prefix = match i.checked_sub(1) {
            None => String::new(),
            Some(i) => {
                let blind: Vec<_> = problem.faults.blind[i]
                    .iter()
                    .map(|j| names[*j].as_str())
                    .collect();
                format!("blind_to_{}_", blind.join("_"))
            }
        };
        add(format!("{prefix}energy"), "");
        for row in 0..filter.tested {
            let units = options.model.output_units.as_ref().filter(|_| plain && i == 0);
            let unit = units.and_then(|units| units.get(row));
            add(format!("{prefix}r{}", row + 1), unit.map_or("", String::as_str));
        }
    }
    if estimates {
        names
            .iter()
            .for_each(|name| add(format!("fault_estimate_{name}"), ""));
    }
    Description {
        method: METHOD,
        channels,
        faults: names.clone(),
        measurement_count: q,
        command_count: p,
        packets: None,
    }
}

/// Whether the thresholds hold without exception; otherwise why not.
pub(super) fn missing_guarantee(options: &HinfFilterOptions, main: &MainDesign) -> Option<String> {
    if let Some(reason) = &main.certificate.uncertified {
        return Some(format!("the gain is uncertified: {reason}"));
    }
    if options.evaluation.threshold == ThresholdType::Constant {
        return Some("the threshold is a constant".to_owned());
    }
    if options.filter.realisation != RealisationType::DiscreteObserver {
        return Some("this realisation leaks commands into the residual".to_owned());
    }
    if !options.disturbance.noise_std.is_empty() {
        return Some("noise has no bound: the thresholds hold with a probability only".to_owned());
    }
    None
}
