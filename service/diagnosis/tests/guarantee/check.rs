//! Runs a bank on a random plant and holds every statement against the truth.

use super::case::Case;
use super::certificate::certificate;
use super::plant::{INSTANTS, Sample, sample};
use residual_diagnosis::diagnoser::{Diagnoser, StepInput, StepRecord, Verdict};
use residual_diagnosis::model::LinearModel;
use residual_diagnosis::unknown_input_filter::{
    UnknownInputFilterBank,
    checks::{CheckWarning, check_modes},
    error::ConstructionError,
    modes::FaultMode,
    options::{Form, GainRule, MissingPolicy, Publish, UnknownInputFilterOptions},
};

/// What was checked.
#[derive(Clone, Copy, Debug, Default)]
pub struct Counts {
    /// Plants.
    pub runs: u64,
    /// Steps of filters of true modes (supersets of the faults of the episode included).
    pub filter_steps: u64,
    /// Those of them whose rows were tested.
    pub tested_steps: u64,
    /// State hulls compared.
    pub hulls: u64,
    /// Fault estimates compared.
    pub estimates: u64,
    /// Parity tests evaluated, in true modes.
    pub windows: u64,
    /// Episodes that ended.
    pub episodes: u64,
    /// Runs in which some foreign mode was falsified.
    pub detections: u64,
    /// Largest ratio of a tested row of a true mode.
    pub largest_ratio: f64,
}

impl Counts {
    pub fn add(&mut self, other: &Self) {
        self.runs += other.runs;
        self.filter_steps += other.filter_steps;
        self.tested_steps += other.tested_steps;
        self.hulls += other.hulls;
        self.estimates += other.estimates;
        self.windows += other.windows;
        self.episodes += other.episodes;
        self.detections += other.detections;
        self.largest_ratio = self.largest_ratio.max(other.largest_ratio);
    }
}

/// Options of a case for a plant.
pub fn options(case: &Case, sample: &Sample, model: &LinearModel) -> UnknownInputFilterOptions {
    let mut options = UnknownInputFilterOptions::default();
    options.bank.simultaneous_faults = if case.pairs { vec![1, 2] } else { vec![1] };
    options.bank.reset = case.reset;
    options.bank.clear_samples = case.clear_samples;
    options.filter.initialisation = case.initialisation;
    options.filter.form = if case.paper { Form::Paper } else { Form::Coupled };
    options.filter.test = case.test;
    options.filter.gain = case.gain;
    options.filter.gain_sweeps = case.sweeps;
    options.filter.generator_order = Some(case.states + case.extra_order);
    options.filter.outward_rounding = case.outward_rounding;
    options.missing.policy = case.policy;
    if case.policy == MissingPolicy::BoundedFault {
        options.missing.fault_bound = Some(sample.fault_bound.clone());
    }
    if case.parity {
        let modes = options.bank.modes(case.actuators);
        let pairs = modes
            .iter()
            .flat_map(|&mode| mode.other_actuators(case.actuators).map(move |j| (mode, j)));
        options.parity.certificates = Some(
            pairs
                .flat_map(|(mode, j)| [1, 4].map(|n| certificate(model, mode, j, n)))
                .flatten()
                .collect(),
        );
    }
    options
}

/// A plant of this case whose modes can all be tested, with its bank; `None` if none was found.
pub fn build(case: &Case) -> Option<(Sample, LinearModel, UnknownInputFilterOptions)> {
    (0..20).find_map(|attempt| {
        let sample = sample(case, attempt);
        let model = LinearModel::new(&sample.model, 0.1).unwrap();
        let mut options = options(case, &sample, &model);
        let report = check_modes(&model, &options, &options.bank.modes(case.actuators)).ok()?;
        let grows = report
            .warnings
            .iter()
            .any(|warning| matches!(warning, CheckWarning::UnboundedSet { .. }));
        // A set that grows for ever loses its last digits; only outward rounding accounts for that.
        if grows && !case.outward_rounding {
            return None;
        }
        match UnknownInputFilterBank::new(model.clone(), &options) {
            Ok(_) => {}
            Err(ConstructionError::TooManyChannels { .. }) => options.filter.publish = Publish::Worst,
            Err(ConstructionError::NoStableFixedGain { .. }) => options.filter.gain = GainRule::RowWise,
            Err(error) => panic!("{error}"),
        }
        Some((sample, model, options))
    })
}

/// Runs one case; the error tells what was violated, where.
pub fn run(case: &Case) -> Result<Counts, String> {
    let Some((sample, model, options)) = build(case) else {
        return Ok(Counts::default());
    };
    let mut bank = match UnknownInputFilterBank::new(model, &options) {
        Ok(bank) => bank,
        Err(ConstructionError::TooManyChannels { .. }) => return Ok(Counts::default()),
        Err(error) => return Err(error.to_string()),
    };
    let channels: Vec<String> = bank
        .description()
        .channels
        .iter()
        .map(|channel| channel.name.clone())
        .collect();
    let mut record = StepRecord::new(channels.len());
    let mut truth = FaultMode::FAULT_FREE;
    let mut counts = Counts {
        runs: 1,
        ..Counts::default()
    };
    let mut detected = false;
    for k in 0..INSTANTS {
        if k > 0 {
            let faulty = (0..case.actuators).filter(|&j| sample.run.f[k - 1][j] != 0.0);
            truth = faulty.fold(truth, |truth, j| truth.with(j).unwrap());
        }
        let falsified_before = bank.falsified().contains(&true);
        record.flags = 0;
        let (measurements, commands) = (&sample.run.y[k], &sample.run.u[k]);
        bank.step(&StepInput::new(measurements, commands), &mut record);
        if !case.outward_rounding && lost_digits(&bank) {
            break;
        }
        if record.verdict() == Verdict::Starting {
            truth = FaultMode::FAULT_FREE;
            continue;
        }
        check_instant(case, &sample, &bank, &channels, &record, truth, k, &mut counts)?;
        let falsified = bank.falsified().contains(&true);
        detected |= falsified;
        if falsified_before && !falsified {
            counts.episodes += 1;
            truth = FaultMode::FAULT_FREE;
        }
    }
    counts.detections = u64::from(detected);
    Ok(counts)
}

/// Whether a set has grown so much (too low an order, a plant that is hard to see) that its centre has no
/// digits left for the state; only outward rounding accounts for that.
fn lost_digits(bank: &UnknownInputFilterBank) -> bool {
    let sets = (0..bank.modes().len()).filter_map(|i| bank.state_set(i));
    sets.flat_map(|(centre, radius)| centre.into_iter().chain(radius))
        .any(|value| value.is_finite() && value.abs() > 1e6)
}

#[allow(clippy::too_many_arguments)]
fn check_instant(
    case: &Case,
    sample: &Sample,
    bank: &UnknownInputFilterBank,
    channels: &[String],
    record: &StepRecord,
    truth: FaultMode,
    k: usize,
    counts: &mut Counts,
) -> Result<(), String> {
    let slack = if case.outward_rounding { 0.0 } else { 1e-9 };
    let mut listed = false;
    for (i, &mode) in bank
        .modes()
        .iter()
        .enumerate()
        .filter(|(_, mode)| truth.is_subset_of(**mode))
    {
        listed = true;
        counts.filter_steps += 1;
        if bank.falsified()[i] {
            let size = sample.run.x[k].amax();
            return Err(format!(
                "instant {k}: true mode {mode} falsified, episode {truth}, |x| = {size:e}"
            ));
        }
        if let Some((centre, radius)) = bank.state_set(i) {
            let x = &sample.run.x[k];
            counts.hulls += 1;
            for state in 0..x.len() {
                let (distance, scale) = ((x[state] - centre[state]).abs(), x.amax() + 300.0);
                if !(distance <= radius[state] * (1.0 + 1e-12) + slack * scale) {
                    return Err(format!(
                        "instant {k}: state {state} = {:e} is {distance:e} off the centre of mode {mode}, radius {:e}",
                        x[state], radius[state]
                    ));
                }
            }
        }
        let prefix = format!("mode_{}_", mode.label());
        let mut tested = false;
        for (name, channel) in channels.iter().zip(record.channels()) {
            let Some(rest) = name.strip_prefix(&prefix).filter(|_| channel.is_evaluated()) else {
                continue;
            };
            if let Some(actuator) = rest.strip_prefix("fault_estimate_") {
                let fault = sample.run.f[k - 1][actuator.parse::<usize>().unwrap()];
                counts.estimates += 1;
                if !(channel.lower <= fault + slack && fault <= channel.upper + slack) {
                    let bounds = (channel.lower, channel.upper);
                    return Err(format!("instant {k}: fault {fault} outside {bounds:?} of {name}"));
                }
            } else if ["output_", "matched_", "parity_", "worst"]
                .iter()
                .any(|kind| rest.starts_with(kind))
            {
                tested = true;
                counts.windows += u64::from(rest.starts_with("parity_"));
                counts.largest_ratio = counts.largest_ratio.max(channel.ratio);
                if !(channel.ratio <= 1.0) {
                    return Err(format!(
                        "instant {k}: {name} alarms with ratio {:.17}",
                        channel.ratio
                    ));
                }
            }
        }
        counts.tested_steps += u64::from(tested);
    }
    if listed && record.certainly_faulty & !truth.bits() != 0 {
        return Err(format!(
            "instant {k}: {:b} called certainly faulty, truth {truth}",
            record.certainly_faulty
        ));
    }
    if listed && bank.falsified().contains(&true) && truth.bits() & !record.possibly_faulty != 0 {
        return Err(format!(
            "instant {k}: {truth} is not among the possible faults {:b}",
            record.possibly_faulty
        ));
    }
    Ok(())
}
