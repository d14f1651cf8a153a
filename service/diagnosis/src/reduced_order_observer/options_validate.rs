//! Whether options fit together and fit the model.

use super::{
    decoupling::Decoupling,
    error::ConstructionError,
    interval_box::IntervalBox,
    options::{Gains, Initialisation, Mode, ObserverM, ReducedOrderObserverOptions, Test},
    plant::{Plant, non_negative},
};
use crate::tables::{shaped_matrix, vector};

impl ReducedOrderObserverOptions {
    /// Everything that needs no design; the assumptions of method sheet 3.1 included.
    ///
    /// # Errors
    /// The first [`ConstructionError`] found; its key points at the entry.
    pub fn check(&self) -> Result<(), ConstructionError> {
        let plant = self.checked_plant()?;
        Decoupling::new(&plant, &plant.d).map(|_| ())
    }

    /// The plant, after shapes and ranges have been checked.
    ///
    /// # Errors
    /// As [`Self::check`], without the assumptions.
    pub(super) fn checked_plant(&self) -> Result<Plant, ConstructionError> {
        let plant = Plant::new(&self.model)?;
        self.check_names(&plant)?;
        self.check_design(&plant)?;
        self.check_bounds(&plant)?;
        self.check_isolation(&plant)?;
        self.restart_box(&plant)?;
        if !(self.missing.max_width_ratio > 1.0) {
            return out_of_range(
                "missing.max_width_ratio",
                self.missing.max_width_ratio,
                "it must be larger than 1",
            );
        }
        Ok(plant)
    }

    /// The box that holds x at all times, if one is configured.
    pub(super) fn restart_box(&self, plant: &Plant) -> Result<Option<IntervalBox>, ConstructionError> {
        let missing = &self.missing;
        IntervalBox::optional(
            ("missing.restart_state_lower", "missing.restart_state_upper"),
            (&missing.restart_state_lower, &missing.restart_state_upper),
            plant.states(),
            "one per state",
        )
    }

    fn check_names(&self, plant: &Plant) -> Result<(), ConstructionError> {
        let (p, m) = (plant.outputs(), plant.actuators());
        for (key, names, length, meaning) in [
            (
                "model.output_names",
                &self.model.output_names,
                p,
                "one per output",
            ),
            (
                "model.output_units",
                &self.model.output_units,
                p,
                "one per output",
            ),
            (
                "model.actuator_names",
                &self.model.actuator_names,
                m,
                "one per actuator",
            ),
            (
                "model.actuator_units",
                &self.model.actuator_units,
                m,
                "one per actuator",
            ),
        ] {
            // Only the length of such a list can be wrong.
            let lengths = names.as_ref().map_or(length, Vec::len);
            vector(key, &vec![0.0; lengths], length, meaning)?;
        }
        Ok(())
    }

    fn check_design(&self, plant: &Plant) -> Result<(), ConstructionError> {
        let design = &self.design;
        if !(design.spectral_radius_max > 0.0 && design.spectral_radius_max < 1.0) {
            return out_of_range(
                "design.spectral_radius_max",
                design.spectral_radius_max,
                "it must lie between 0 and 1, both excluded",
            );
        }
        if let Some(rate) = design
            .lmi_decay_rate
            .filter(|rate| !(*rate > 0.0 && *rate <= 1.0))
        {
            return out_of_range("design.lmi_decay_rate", rate, "it must lie in (0, 1]");
        }
        if let Some(scale) = &design.fault_scale {
            let scale = vector("design.fault_scale", scale, plant.actuators(), "one per actuator")?;
            if let Some(wrong) = scale.iter().find(|value| **value <= 0.0) {
                return out_of_range("design.fault_scale", wrong, "a scale must be positive");
            }
        }
        if let Some(poles) = &design.poles {
            vector("design.poles", poles, plant.hidden(), "one per unmeasured state")?;
            check_poles("design.poles", poles)?;
        } else if design.gains == Gains::ClosedForm {
            return Err(ConstructionError::Missing {
                key: "design.poles",
                reason: "`design.gains` = \"closed_form\" places the eigenvalues of F; give one per unmeasured state",
            });
        }
        if let Some(k) = &design.k {
            let shape = (plant.hidden(), plant.outputs());
            shaped_matrix("design.K", k, shape, "unmeasured states x outputs")?;
        } else if design.gains == Gains::Given {
            return Err(ConstructionError::Missing {
                key: "design.K",
                reason: "`design.gains` = \"given\" takes K as it is; give it",
            });
        }
        if let ObserverM::Matrix(rows) = &design.observer_m {
            let p = plant.outputs();
            shaped_matrix("design.observer_M", rows, (p, p), "outputs x outputs")?;
        }
        Ok(())
    }

    fn check_bounds(&self, plant: &Plant) -> Result<(), ConstructionError> {
        let bounds = &self.bounds;
        let rows = if bounds.mode == Mode::Joint {
            plant.states()
        } else {
            plant.outputs()
        };
        let order = bounds.effective_generator_order();
        if order < rows {
            return Err(ConstructionError::GeneratorOrderTooSmall { order, rows });
        }
        if order > 1000 {
            return out_of_range(
                "bounds.generator_order",
                order,
                "1000 is the most that is sensible",
            );
        }
        if bounds.mode != Mode::Joint && bounds.effective_initialisation() != Initialisation::PriorBox {
            return out_of_range(
                "bounds.initialisation",
                "\"measured_output\"",
                "the modes \"paper\" and \"tiom\" start from the box of x(0), use \"prior_box\"",
            );
        }
        if !bounds.tests.contains(&Test::Hull) {
            return out_of_range(
                "bounds.tests",
                format!("{:?}", bounds.tests),
                "a single direction may be worse than the outputs themselves, add \"hull\"",
            );
        }
        if bounds.max_directions < plant.outputs() {
            return out_of_range(
                "bounds.max_directions",
                bounds.max_directions,
                "every output is a direction, allow at least as many",
            );
        }
        if !(bounds.rounding_tolerance >= 0.0 && bounds.rounding_tolerance < 1e-3) {
            return out_of_range(
                "bounds.rounding_tolerance",
                bounds.rounding_tolerance,
                "it must not be negative and is meant for rounding errors: stay below 1e-3",
            );
        }
        if bounds.alarm_samples == 0 {
            return out_of_range("bounds.alarm_samples", 0, "an alarm needs at least 1 sample");
        }
        Ok(())
    }

    fn check_isolation(&self, plant: &Plant) -> Result<(), ConstructionError> {
        let isolation = &self.isolation;
        if isolation.poles.len() != 1 {
            let (poles, nz) = (&isolation.poles, plant.hidden());
            vector("isolation.poles", poles, nz, "one, or one per unmeasured state")?;
        }
        check_poles("isolation.poles", &isolation.poles)?;
        for (key, bound) in [
            (
                "isolation.fault_estimate_radius_max",
                &isolation.fault_estimate_radius_max,
            ),
            ("isolation.fault_bound", &isolation.fault_bound),
        ] {
            if let Some(bound) = bound {
                non_negative(key, bound, plant.actuators())?;
            }
        }
        Ok(())
    }
}

fn check_poles(key: &'static str, poles: &[f64]) -> Result<(), ConstructionError> {
    match poles.iter().find(|pole| !(pole.abs() < 1.0)) {
        Some(pole) => out_of_range(
            key,
            pole,
            "eigenvalues of F must lie between -1 and 1, both excluded",
        ),
        None => Ok(()),
    }
}

fn out_of_range<T>(
    key: &'static str,
    value: impl ToString,
    allowed: &'static str,
) -> Result<T, ConstructionError> {
    Err(ConstructionError::OutOfRange {
        key,
        value: value.to_string(),
        allowed,
    })
}
