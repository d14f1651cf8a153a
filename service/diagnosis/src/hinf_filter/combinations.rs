//! Options that exclude or need each other.

use super::{
    error::HinfFilterError,
    find::has_no_direct_disturbance,
    options::{DesignType, HinfFilterOptions, RealisationType, SynthesisOptions, ThresholdType},
    plant::Plant,
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
        if held
            && matches!(
                synthesis.design,
                DesignType::RiccatiDiscrete | DesignType::TwoStageDiscrete
            )
        {
            let reason = "with this `synthesis.type`, it needs a continuous gain; use \"riccati_ct\", \"matched\", a \
                          continuous design by matrix inequalities or a given H";
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
        check_synthesis(&self.plant, synthesis)
    }
}

/// Keys of the synthesis that do not belong to the type of the design, and numbers out of range.
fn check_synthesis(plant: &Plant, synthesis: &SynthesisOptions) -> Result<(), HinfFilterError> {
    let design = synthesis.design;
    let given = design == DesignType::Given;
    let two_stage = matches!(
        design,
        DesignType::TwoStageDiscrete | DesignType::TwoStageContinuous
    );
    let paper = design == DesignType::Paper;
    // Where the poles must lie: asked of a design, or claimed of a given gain.
    let continuous = matches!(design, DesignType::TwoStageContinuous | DesignType::Mixed)
        || given && synthesis.h.is_some();
    let discrete = design == DesignType::TwoStageDiscrete || given && synthesis.l.is_some();
    let only_given = "with this `synthesis.type`; use \"given\"";
    let region = "with this `synthesis.type`; use \"lmi_two_stage_dt\", \"lmi_two_stage_ct\", \"lmi_mixed\" or \"given\"";
    let radius = "with this gain; use `synthesis.pole_radius` with a continuous gain, `synthesis.radius_z` or \
                  `synthesis.pole_decay` with a discrete one";
    for (key, present, allowed, reason) in [
        ("synthesis.L", synthesis.l.is_some(), given, only_given),
        ("synthesis.H", synthesis.h.is_some(), given, only_given),
        (
            "synthesis.claimed_bound",
            synthesis.claimed_bound.is_some(),
            given,
            only_given,
        ),
        (
            "synthesis.V",
            synthesis.v.is_some(),
            given || design == DesignType::Matched,
            only_given,
        ),
        (
            "synthesis.slack",
            synthesis.slack.is_some(),
            two_stage,
            "with this `synthesis.type`; use \"lmi_two_stage_dt\" or \"lmi_two_stage_ct\"",
        ),
        (
            "synthesis.normalisation",
            synthesis.normalisation.is_some(),
            paper,
            "with this `synthesis.type`; use \"lmi_paper\"",
        ),
        (
            "synthesis.recovery",
            synthesis.recovery.is_some(),
            paper,
            "with this `synthesis.type`; use \"lmi_paper\"",
        ),
        (
            "synthesis.pole_decay",
            synthesis.pole_decay.is_some(),
            continuous || discrete || given,
            region,
        ),
        (
            "synthesis.pole_radius",
            synthesis.pole_radius.is_some(),
            continuous,
            if discrete { radius } else { region },
        ),
        (
            "synthesis.radius_z",
            synthesis.radius_z.is_some(),
            discrete,
            if continuous { radius } else { region },
        ),
    ] {
        if present && !allowed {
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
        ("synthesis.slack", synthesis.slack),
        ("synthesis.max_gain", Some(synthesis.max_gain)),
    ] {
        positive(key, value)?;
    }
    let out_of_range = |key: &str, value, allowed| HinfFilterError::OutOfRange {
        key: key.to_owned(),
        value,
        allowed,
    };
    if let Some(slack) = synthesis.slack.filter(|slack| *slack > 1.0) {
        let allowed = "it is a part of the optimum, at most 1";
        return Err(out_of_range("synthesis.slack", slack, allowed));
    }
    if let Some(radius) = synthesis
        .radius_z
        .filter(|radius| !(*radius > 0.0 && *radius < 1.0))
    {
        let allowed = "the modulus of a stable discrete pole lies above 0 and below 1";
        return Err(out_of_range("synthesis.radius_z", radius, allowed));
    }
    if let (Some(decay), Some(radius)) = (synthesis.pole_decay, synthesis.pole_radius)
        && decay >= radius
    {
        let allowed = "with `synthesis.pole_radius` at or below it no pole is allowed; make it smaller";
        return Err(out_of_range("synthesis.pole_decay", decay, allowed));
    }
    let unbounded = design.needs_solver() && design.is_continuous() && has_no_direct_disturbance(plant);
    match unbounded && synthesis.pole_radius.is_none() {
        true => Err(HinfFilterError::UnboundedInequalities),
        false => Ok(()),
    }
}
