//! Options that exclude or need each other.

use super::{
    error::HinfFilterError,
    options::{DesignType, HinfFilterOptions, RealisationType, ThresholdType},
    problem::Problem,
    reading::positive,
};

impl Problem {
    /// Refuses what does not fit together.
    pub(super) fn check_combinations(&self, options: &HinfFilterOptions) -> Result<(), HinfFilterError> {
        let conflict = |key, reason| Err(HinfFilterError::Conflict { key, reason });
        let (evaluation, synthesis) = (&options.evaluation, &options.synthesis);
        let held = options.filter.realisation != RealisationType::DiscreteObserver;
        let constant = evaluation.threshold == ThresholdType::Constant;
        if constant {
            match evaluation.constant_threshold {
                Some(value) if value.is_finite() && value > 0.0 => {}
                Some(value) => {
                    return Err(HinfFilterError::OutOfRange {
                        key: "evaluation.constant_threshold".to_owned(),
                        value,
                        allowed: "it must be positive",
                    });
                }
                None => {
                    return Err(HinfFilterError::Missing {
                        key: "evaluation.constant_threshold",
                        reason: "give it, or use `evaluation.threshold` = \"guaranteed\"",
                    });
                }
            }
        } else if evaluation.constant_threshold.is_some() {
            let reason = "with `evaluation.threshold` = \"guaranteed\"; remove one of them";
            return conflict("evaluation.constant_threshold", reason);
        }
        if evaluation.peak_test == Some(true) && (constant || self.disturbance.amplitude.is_none()) {
            let reason = "without guaranteed thresholds from `disturbance.amplitude`; remove it";
            return conflict("evaluation.peak_test", reason);
        }
        if self.window.is_none() && self.noise.is_some() {
            let reason = "with `evaluation.window` = \"cumulative\", whose noise energy has no bound; give a finite window";
            return conflict("disturbance.noise_std", reason);
        }
        if self.window.is_none()
            && self.disturbance.window_energy.is_some()
            && self.disturbance.slew.amax() > 0.0
        {
            let reason = "with a window energy and `evaluation.window` = \"cumulative\"; remove it";
            return conflict("disturbance.slew", reason);
        }
        if held && !self.listed.is_empty() {
            let reason = "with this `filter.realisation`; use \"discrete_observer\"";
            return conflict("model.listed_models", reason);
        }
        if options.isolation.is_some() {
            if held || constant {
                let reason = "without the discrete observer and guaranteed thresholds; remove the table";
                return conflict("isolation", reason);
            }
            if self.disturbance.amplitude.is_none() {
                let reason = "without `disturbance.amplitude`; give it instead of the window energy";
                return conflict("isolation", reason);
            }
        }
        if held && matches!(synthesis.design, DesignType::RiccatiDiscrete) {
            let reason = "with \"riccati_dt\", it needs a continuous gain; use \"riccati_ct\", \"matched\" or a given H";
            return conflict("filter.realisation", reason);
        }
        if held && synthesis.design == DesignType::Given && synthesis.h.is_none() {
            return Err(HinfFilterError::Missing {
                key: "synthesis.H",
                reason: "this `filter.realisation` needs a continuous gain; give it instead of L",
            });
        }
        let tolerance = options.filter.jitter_tolerance;
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(HinfFilterError::OutOfRange {
                key: "filter.jitter_tolerance".to_owned(),
                value: tolerance,
                allowed: "it is a part of the period, above 0 and below 1",
            });
        }
        check_gain_keys(options)
    }
}

/// Keys of a gain that do not belong to the type of the design.
fn check_gain_keys(options: &HinfFilterOptions) -> Result<(), HinfFilterError> {
    let synthesis = &options.synthesis;
    let given = synthesis.design == DesignType::Given;
    let reason = "with this `synthesis.type`; use \"given\"";
    for (key, present) in [
        ("synthesis.L", synthesis.l.is_some()),
        ("synthesis.H", synthesis.h.is_some()),
        ("synthesis.claimed_bound", synthesis.claimed_bound.is_some()),
        ("synthesis.pole_decay", synthesis.pole_decay.is_some()),
        ("synthesis.pole_radius", synthesis.pole_radius.is_some()),
        (
            "synthesis.V",
            synthesis.v.is_some() && synthesis.design != DesignType::Matched,
        ),
    ] {
        if present && !given {
            return Err(HinfFilterError::Conflict { key, reason });
        }
    }
    if given && synthesis.l.is_some() == synthesis.h.is_some() {
        return Err(match synthesis.l {
            None => HinfFilterError::Missing {
                key: "synthesis.L",
                reason: "give the discrete gain L or the continuous gain H",
            },
            Some(_) => HinfFilterError::Conflict {
                key: "synthesis.L",
                reason: "beside `synthesis.H`; give one of them",
            },
        });
    }
    for (key, value) in [
        ("synthesis.claimed_bound", synthesis.claimed_bound),
        ("synthesis.pole_decay", synthesis.pole_decay),
        ("synthesis.pole_radius", synthesis.pole_radius),
        ("synthesis.max_gain", Some(synthesis.max_gain)),
    ] {
        positive(key, value)?;
    }
    if synthesis.pole_radius.is_some() && synthesis.h.is_none() {
        let reason = "with a discrete gain; use `synthesis.pole_decay`";
        return Err(HinfFilterError::Conflict {
            key: "synthesis.pole_radius",
            reason,
        });
    }
    Ok(())
}
