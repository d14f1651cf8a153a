//! What turns the estimator into a diagnoser: decision, start-up, roll-back, reception.

use super::{
    decision::DecisionRule,
    design::{Form, ImmDesign},
    design_error::DesignError,
};
use crate::decomposition::eigenvalues;
use residual_shared::record::{MAX_CHANNELS, MAX_FAULTS};

/// A pole times the period beyond which Φ⁻¹ of the batch form has lost its accuracy.
const BATCH_STIFFNESS: f64 = 10.0;
/// Most packets that are kept at the same time.
const MOST_PACKETS: usize = 1 << 17;

/// Settings of a diagnoser beside its design.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Fusion period, ns: length of the first interval and of a skipped one.
    pub period_ns: i64,
    /// μ_T and L.
    pub decision: DecisionRule,
    /// κ: half width of the amplitude bounds in standard deviations.
    pub amplitude_bound_standard_deviations: f64,
    /// Fusion instants reported as start-up.
    pub startup_steps: u32,
    /// W: fusion instants that late packets revise.
    pub rollback_steps: usize,
    /// Packets of one sensor (or of the commands) that one interval takes.
    pub max_packets_per_step: usize,
    /// Packets stamped later than t_k plus this are rejected, ns.
    pub max_ahead_ns: i64,
    /// The command before the first one received, n_u.
    pub initial_command: Vec<f64>,
    /// Name and unit of each fault channel.
    pub channels: Vec<(String, String)>,
}

impl Settings {
    /// Whole periods that `max_ahead_ns` reaches over, at least 1.
    pub(super) fn periods_ahead(&self) -> usize {
        let periods = self.max_ahead_ns.max(1) as u64;
        usize::try_from(periods.div_ceil(self.period_ns.max(1) as u64)).unwrap_or(usize::MAX)
    }

    /// Packets of one source that are kept at the same time.
    pub(super) fn packets_per_source(&self) -> usize {
        let intervals = self
            .rollback_steps
            .saturating_add(1)
            .saturating_add(self.periods_ahead());
        intervals.saturating_mul(self.max_packets_per_step)
    }

    /// Checks the ranges, and that the form of the design fits.
    ///
    /// # Errors
    /// [`DesignError`]: the first setting that does not fit.
    pub fn check(&self, design: &ImmDesign) -> Result<(), DesignError> {
        let refuse = |key: &str, value: &dyn ToString, allowed: &str| {
            Err(DesignError::setting(key, value.to_string(), allowed))
        };
        let threshold = self.decision.threshold;
        if !(threshold > 0.0 && threshold < 1.0) {
            return refuse(
                "decision.threshold",
                &threshold,
                "a probability between 0 and 1 is needed",
            );
        }
        if self.decision.window_steps == 0 {
            return refuse("decision.window_steps", &0, "at least 1 is needed");
        }
        let kappa = self.amplitude_bound_standard_deviations;
        if !(kappa > 0.0 && kappa.is_finite()) {
            let key = "decision.amplitude_bound_standard_deviations";
            return refuse(key, &kappa, "a number above 0 is needed");
        }
        if self.period_ns < 1000 {
            let seconds = self.period_ns as f64 * 1e-9;
            return refuse(
                "sample_time_s",
                &seconds,
                "a microsecond is the shortest fusion period",
            );
        }
        if self.rollback_steps > 1000 {
            return refuse("rollback_steps", &self.rollback_steps, "at most 1000 are allowed");
        }
        if self.max_packets_per_step == 0 {
            return refuse("max_packets_per_step", &0, "at least 1 is needed");
        }
        if self.max_ahead_ns < 0 {
            let milliseconds = self.max_ahead_ns as f64 * 1e-6;
            return refuse("max_ahead_ms", &milliseconds, "it must not be negative");
        }
        let sources = design.sensors.len() + 1;
        if self.packets_per_source().saturating_mul(sources) > MOST_PACKETS {
            let allowed = format!(
                "with `rollback_steps`, `max_ahead_ms` and {} sensors more than {MOST_PACKETS} packets would be \
                 kept; lower one of them",
                design.sensors.len()
            );
            return refuse("max_packets_per_step", &self.max_packets_per_step, &allowed);
        }
        self.check_lists(design)?;
        if design.form == Form::BatchUnobserved {
            self.check_batch(design)?;
        }
        Ok(())
    }

    fn check_lists(&self, design: &ImmDesign) -> Result<(), DesignError> {
        let (_, inputs, channels) = design.plant.sizes();
        let mismatch = |name: &str, actual: usize, expected: usize| DesignError::DimensionMismatch {
            name: name.to_owned(),
            actual: format!("a list of length {actual}"),
            expected: format!("a list of length {expected}"),
        };
        if self.initial_command.len() != inputs {
            return Err(mismatch("input.constant", self.initial_command.len(), inputs));
        }
        if !self.initial_command.iter().all(|value| value.is_finite()) {
            return Err(DesignError::NotFinite {
                name: "input.constant".to_owned(),
            });
        }
        if self.channels.len() != channels {
            return Err(mismatch("plant.channels", self.channels.len(), channels));
        }
        unique("plant.channels", self.channels.iter().map(|(name, _)| name))?;
        unique("mode", design.modes.iter().map(|mode| &mode.name))?;
        let count = design.modes.len() + channels;
        if count > MAX_CHANNELS || channels > MAX_FAULTS {
            return Err(DesignError::TooManyChannels {
                count,
                limit: MAX_CHANNELS,
            });
        }
        Ok(())
    }

    fn check_batch(&self, design: &ImmDesign) -> Result<(), DesignError> {
        let refuse = |reason: String| Err(DesignError::BatchFormNotApplicable { reason });
        if self.rollback_steps > 0 {
            return refuse("it cannot go back (`rollback_steps` must be 0)".to_owned());
        }
        let slots = self.max_packets_per_step.saturating_mul(design.sensors.len());
        if slots.saturating_mul(design.widest_sensor()) > 4096 {
            return refuse(format!(
                "{slots} sample slots of one interval make too large matrices (lower `max_packets_per_step`)"
            ));
        }
        for plant in design.plant.pieces() {
            let values = eigenvalues(&plant.a).ok_or(DesignError::EigenvaluesNotFound)?;
            let fastest = values.iter().map(|value| value.re.abs()).fold(0.0, f64::max);
            if fastest * self.period_ns as f64 * 1e-9 >= BATCH_STIFFNESS {
                return refuse(format!(
                    "the pole with a real part of {fastest} 1/s is too fast for the inverse over a whole period"
                ));
            }
        }
        Ok(())
    }
}

/// Refuses empty and repeated names.
fn unique<'a>(key: &str, names: impl Iterator<Item = &'a String> + Clone) -> Result<(), DesignError> {
    for (place, name) in names.clone().enumerate() {
        if name.trim().is_empty() || names.clone().take(place).any(|other| other == name) {
            let key = format!("{key}.{place}");
            return Err(DesignError::setting(
                key,
                format!("{name:?}"),
                "every name must be given, and only once",
            ));
        }
    }
    Ok(())
}
