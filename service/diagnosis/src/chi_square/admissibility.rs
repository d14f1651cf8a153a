//! What the modes of the models allow: a filter that converges, the plain state test, the exclusion of sensors
//! (method sheet 3).

use super::{
    design::DesignReport,
    error::ChiSquareError,
    model_options::Schedule,
    options::{ChiSquareOptions, ExclusionCheck, OnIsolation, StabilityGuard, StatisticKind},
    plant::Plant,
    stability::{GuardVerdict, Stability, above, beside, stability},
    step_model::StepModel,
    validate::MOST_EXCLUDABLE,
};
use nalgebra::DMatrix;

/// Transition, noise and measurement of one model, or of one period of a schedule.
struct Modal {
    transition: DMatrix<f64>,
    noise: DMatrix<f64>,
    measurement: DMatrix<f64>,
}

impl Modal {
    fn of(model: &StepModel) -> Self {
        Self {
            transition: model.transition.to_dense(),
            noise: model.noise_factor.to_dense(),
            measurement: model.measurement.to_dense(),
        }
    }

    /// One period: \[H_1 Φ_1; H_2 Φ_2 Φ_1; ...\] observes the state before it, \[Φ_p ... Φ_2 G_1, ..., G_p\] excites it.
    fn of_period(plant: &Plant, schedule: &[usize]) -> Option<Self> {
        let mut models = schedule.iter().filter_map(|number| plant.models.get(*number));
        let first = Self::of(models.next()?);
        let first = Self {
            measurement: &first.measurement * &first.transition,
            ..first
        };
        Some(models.fold(first, |period, model| {
            let next = Self::of(model);
            let transition = &next.transition * &period.transition;
            Self {
                noise: beside(&(&next.transition * &period.noise), &next.noise),
                measurement: above(&period.measurement, &(&next.measurement * &transition)),
                transition,
            }
        }))
    }

    fn stability(&self, plant: &Plant, key: &str) -> Result<Stability, ChiSquareError> {
        let excitation = beside(&self.noise, &plant.initial_factor.to_dense());
        stability(&self.transition, &excitation, &self.measurement).ok_or_else(|| {
            ChiSquareError::NoEigenvalues {
                key: format!("{key}.transition"),
            }
        })
    }

    /// Without the measurements in `excluded` (bits).
    fn without(&self, excluded: usize) -> Self {
        let rows: Vec<usize> = (0..self.measurement.nrows())
            .filter(|row| excluded >> row & 1 == 0)
            .collect();
        Self {
            transition: self.transition.clone(),
            noise: self.noise.clone(),
            measurement: self.measurement.select_rows(&rows),
        }
    }
}

fn undetectable(found: &Stability, key: &str) -> Option<ChiSquareError> {
    let eigenvalue = found.undetectable?;
    let eigenvalue = if eigenvalue.im == 0.0 {
        format!("{:.6}", eigenvalue.re)
    } else {
        format!("{:.6} ± {:.6}i", eigenvalue.re, eigenvalue.im.abs())
    };
    Some(ChiSquareError::Undetectable {
        key: format!("{key}.transition"),
        eigenvalue,
    })
}

/// Convergence of the filter and admissibility of the plain state test.
pub(super) fn check_modes(
    options: &ChiSquareOptions,
    plant: &Plant,
    report: &mut DesignReport,
) -> Result<(), ChiSquareError> {
    if plant.schedule == Schedule::Constant {
        let found = Modal::of(&plant.models[0]).stability(plant, "model")?;
        if let Some(error) = undetectable(&found, "model") {
            return Err(error);
        }
        report.stability = Some(found);
    } else {
        for (number, model) in plant.models.iter().enumerate() {
            let key = plant.model_key(number);
            let found = Modal::of(model).stability(plant, &key)?;
            report
                .warnings
                .extend(undetectable(&found, &key).map(|error| format!("if it stays in force, {error}")));
        }
        if let Some(period) = plant
            .assumed_schedule
            .as_ref()
            .and_then(|list| Modal::of_period(plant, list))
        {
            report.stability = Some(period.stability(plant, "models")?);
        }
    }
    if !options.statistics.enabled.contains(&StatisticKind::StatePlain) {
        return Ok(());
    }
    let refusal = match &report.stability {
        Some(found) if found.verdict == GuardVerdict::Accepted => return Ok(()),
        Some(found) => ChiSquareError::PlainStateTestRefused {
            verdict: found.verdict.name(),
            spectral_radius: found.effective_spectral_radius,
        },
        None => ChiSquareError::PlainStateTestRefused {
            verdict: "refused, the sequence of models being unknown",
            spectral_radius: f64::NAN,
        },
    };
    match options.statistics.stability_guard {
        StabilityGuard::Refuse => Err(refusal),
        StabilityGuard::Warn => {
            report.warnings.push(refusal.to_string());
            Ok(())
        }
    }
}

/// Which sets of sensors may be excluded.
pub(super) fn exclusions(
    options: &ChiSquareOptions,
    plant: &Plant,
    components: &[String],
    report: &mut DesignReport,
) -> Result<Vec<bool>, ChiSquareError> {
    if options.alarm.on_isolation == OnIsolation::Continue {
        return Ok(Vec::new());
    }
    let measurements = plant.counts()[2];
    if measurements > MOST_EXCLUDABLE {
        return Err(ChiSquareError::setting(
            "alarm.on_isolation",
            format!("\"{}\"", options.alarm.on_isolation.name()),
            format!("with more than {MOST_EXCLUDABLE} measurements only \"continue\" is possible"),
        ));
    }
    let mut admissible = Vec::with_capacity(1 << measurements);
    for excluded in 0..1_usize << measurements {
        let mut detectable = true;
        for (number, model) in plant.models.iter().enumerate() {
            let found = Modal::of(model)
                .without(excluded)
                .stability(plant, &plant.model_key(number))?;
            detectable &= found.undetectable.is_none();
        }
        if excluded.count_ones() == 1 && !detectable {
            report
                .indispensable_sensors
                .push(excluded.trailing_zeros() as usize);
        }
        admissible.push(detectable || options.alarm.exclusion_check == ExclusionCheck::Warn);
    }
    let consequence = match options.alarm.exclusion_check {
        ExclusionCheck::Refuse => "it will be reported, not excluded",
        ExclusionCheck::Warn => "its exclusion leaves the estimate to drift",
    };
    for sensor in &report.indispensable_sensors {
        report.warnings.push(format!(
            "the other sensors do not see every mode that does not decay without {}; {consequence}",
            components.get(*sensor).map_or("", String::as_str),
        ));
    }
    Ok(admissible)
}
