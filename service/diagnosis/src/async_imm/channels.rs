//! The channels of a record and what a record says (method sheet 4.3).
//!
//! | channel | lower | residual | upper | ratio |
//! |---|---|---|---|---|
//! | `fault probability` | 0 | 1 - μ⁰ | μ_T | residual / μ_T |
//! | `probability <mode>`, one per fault mode | 0 | μ^m | μ_T | residual / μ_T |
//! | `amplitude <channel>`, one per fault channel | f̂ - κσ | f̂ | f̂ + κσ | 0: never alarms |

use super::{
    decision::{DecisionRule, fault_probability},
    design::ImmDesign,
    fusion::{AmplitudeEstimate, Fusion},
    settings::Settings,
    state::Posterior,
};
use crate::diagnoser::{Channel, ChannelDescription, StepRecord, Verdict, flags};

/// What happened at the instant of a record.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Instant {
    /// A sample of the latest interval was used.
    pub evaluated: bool,
    /// The instant belongs to the start-up.
    pub starting: bool,
    /// The filters were initialised anew.
    pub reinitialised: bool,
}

pub(super) fn descriptions(design: &ImmDesign, settings: &Settings) -> Vec<ChannelDescription> {
    let probability = |name: String| ChannelDescription {
        name,
        unit: String::new(),
    };
    let modes = design.modes.iter().skip(1);
    let amplitudes = settings.channels.iter().map(|(name, unit)| ChannelDescription {
        name: format!("amplitude {name}"),
        unit: unit.clone(),
    });
    std::iter::once(probability("fault probability".to_owned()))
        .chain(modes.map(|mode| probability(format!("probability {}", mode.name))))
        .chain(amplitudes)
        .collect()
}

/// Writes verdict, fault sets, fault estimate, channels and flags.
pub(super) fn write(
    posterior: &Posterior,
    instant: Instant,
    settings: &Settings,
    fusion: &mut Fusion,
    record: &mut StepRecord,
) {
    let rule = &settings.decision;
    let declared = rule.declared_mode(&posterior.decision);
    let detected = rule.fault_detected(&posterior.decision);
    fusion.read_amplitudes(posterior, declared);
    let verdict = if instant.starting {
        Verdict::Starting
    } else if !instant.evaluated {
        Verdict::NotEvaluated
    } else if declared > 0 {
        Verdict::Isolated
    } else if detected {
        Verdict::Fault
    } else {
        Verdict::Nominal
    };
    record.verdict = verdict as u32;
    (record.certainly_faulty, record.possibly_faulty) = match verdict {
        Verdict::Isolated => (fusion.channels_of(declared), fusion.channels_of(declared)),
        Verdict::Fault => (0, possible_channels(fusion, rule)),
        _ => (0, 0),
    };
    if matches!(verdict, Verdict::Isolated | Verdict::Fault) {
        record.flags |= flags::ALARM_NOW;
    }
    if instant.reinitialised {
        record.flags |= flags::RESET;
    }
    let kappa = settings.amplitude_bound_standard_deviations;
    let estimate = isolated_estimate(fusion, record.certainly_faulty);
    record.fault_estimate = estimate.map_or(f64::NAN, |estimate| estimate.value);
    record.fault_estimate_half_width =
        estimate.map_or(f64::NAN, |estimate| kappa * estimate.standard_deviation);
    let mu = fusion.probability();
    let probabilities = std::iter::once(fault_probability(mu)).chain(mu.iter().skip(1).copied());
    let probabilities = probabilities.map(|residual| {
        if instant.evaluated {
            Channel {
                lower: 0.0,
                residual,
                upper: rule.threshold,
                ratio: residual / rule.threshold,
            }
        } else {
            Channel::NOT_EVALUATED
        }
    });
    let amplitudes = fusion.amplitudes().iter();
    let amplitudes =
        amplitudes.map(|estimate| Channel::estimate(estimate.value, kappa * estimate.standard_deviation));
    for (channel, value) in record
        .channels_mut()
        .iter_mut()
        .zip(probabilities.chain(amplitudes))
    {
        *channel = value;
    }
}

/// The estimate of the only faulty channel; `None` of none or several.
fn isolated_estimate(fusion: &Fusion, faulty: u64) -> Option<AmplitudeEstimate> {
    let single = faulty.count_ones() == 1;
    single
        .then(|| fusion.amplitudes().get(faulty.trailing_zeros() as usize).copied())
        .flatten()
}

/// Channels of the fault modes that hold all but 1 - μ_T of the probability of the fault modes (each one left out
/// has at most its even share of that), and of the most probable one.
fn possible_channels(fusion: &Fusion, rule: &DecisionRule) -> u64 {
    let mu = fusion.probability();
    let share = (1.0 - rule.threshold) / mu.len().max(1) as f64;
    let largest = mu.iter().skip(1).copied().fold(0.0, f64::max);
    let modes = mu.iter().enumerate().skip(1);
    modes
        .filter(|(_, value)| **value > share || **value == largest)
        .fold(0, |bits, (mode, _)| bits | fusion.channels_of(mode))
}
