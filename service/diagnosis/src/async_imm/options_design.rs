//! From the tables of a configuration to a design and settings.

use super::{
    decision::DecisionRule,
    design::{Form, ImmDesign, Mode, ModeTransition, Prior, Sensor},
    design_error::DesignError,
    options::{AsyncImmTables, ModeOptions, PlantOptions, SensorOptions, TransitionKind, TransitionOptions},
    plant::{LinearPlant, Plant},
    settings::Settings,
};
use crate::tables::{shaped_matrix, vector};
use nalgebra::DMatrix;

impl AsyncImmTables {
    /// Design and settings for a fusion period.
    ///
    /// # Errors
    /// [`DesignError`]: the first entry that is wrong by itself.
    pub fn to_design(&self, sample_time_s: f64) -> Result<(ImmDesign, Settings), DesignError> {
        let plant = self.plant.to_plant()?;
        let (nx, nu, nf) = (plant.a.nrows(), plant.b.ncols(), plant.f.ncols());
        let amplitude = &self.amplitude;
        let p = amplitude.prior_standard_deviation.len();
        let deviation = vector(
            "amplitude.prior_standard_deviation",
            &amplitude.prior_standard_deviation,
            p,
            "one per slot",
        )?;
        if let Some(place) = deviation.iter().position(|value| *value < 0.0) {
            let key = format!("amplitude.prior_standard_deviation.{place}");
            return Err(DesignError::setting(
                key,
                deviation[place],
                "it must not be negative",
            ));
        }
        let optional = |key: &str, list: &Option<Vec<f64>>| match list {
            Some(list) => vector(key, list, p, "one per slot"),
            None => Ok(nalgebra::DVector::zeros(p)),
        };
        let mean = optional("amplitude.prior_mean", &amplitude.prior_mean)?;
        let walk = optional("amplitude.random_walk_psd", &amplitude.random_walk_psd)?;
        let sensors = self.sensor.iter().enumerate();
        let modes = self.mode.iter().enumerate();
        let initial = &self.initial;
        let design = ImmDesign {
            sensors: sensors
                .map(|(number, sensor)| sensor.to_sensor(number, nx, self.form))
                .collect::<Result<_, _>>()?,
            modes: modes
                .map(|(number, mode)| mode.to_mode(number, (nf, p), walk.as_slice()))
                .collect::<Result<_, _>>()?,
            prior: Prior {
                state: vector("initial.state", &initial.state, nx, "one per state")?
                    .as_slice()
                    .to_vec(),
                state_covariance: shaped_matrix(
                    "initial.state_covariance",
                    &initial.state_covariance,
                    (nx, nx),
                    "states x states",
                )?,
                amplitude: mean.as_slice().to_vec(),
                amplitude_covariance: DMatrix::from_diagonal(&deviation.map(|value| value * value)),
                mode_probability: initial.mode_probability.clone(),
            },
            transition: self.transition.to_transition(self.mode.len())?,
            form: self.form,
            mixing: amplitude.mixing,
            plant: Plant::Constant(plant),
        };
        let settings = self.to_settings(sample_time_s, nu, nf)?;
        Ok((design, settings))
    }

    fn to_settings(
        &self,
        sample_time_s: f64,
        commands: usize,
        channels: usize,
    ) -> Result<Settings, DesignError> {
        if !self.max_ahead_ms.is_finite() {
            let allowed = "a finite number of milliseconds is needed";
            return Err(DesignError::setting("max_ahead_ms", self.max_ahead_ms, allowed));
        }
        let name = |place: usize| {
            let given = self
                .plant
                .channels
                .as_ref()
                .and_then(|names| names.get(place).cloned());
            given.unwrap_or_else(|| format!("channel {}", place + 1))
        };
        let unit = |place: usize| {
            let given = self
                .plant
                .channel_units
                .as_ref()
                .and_then(|units| units.get(place).cloned());
            given.unwrap_or_default()
        };
        for (key, list) in [
            ("plant.channels", &self.plant.channels),
            ("plant.channel_units", &self.plant.channel_units),
        ] {
            if let Some(list) = list
                && list.len() != channels
            {
                return Err(DesignError::DimensionMismatch {
                    name: key.to_owned(),
                    actual: format!("a list of length {}", list.len()),
                    expected: format!("a list of length {channels} (one per column of F)"),
                });
            }
        }
        let decision = &self.decision;
        Ok(Settings {
            period_ns: (sample_time_s * 1e9).round() as i64,
            decision: DecisionRule {
                threshold: decision.threshold,
                window_steps: decision.window_steps,
            },
            amplitude_bound_standard_deviations: decision.amplitude_bound_standard_deviations,
            startup_steps: decision.startup_steps,
            rollback_steps: self.rollback_steps,
            max_packets_per_step: self.max_packets_per_step,
            max_ahead_ns: (self.max_ahead_ms * 1e6).round() as i64,
            initial_command: self.input.constant.clone().unwrap_or_else(|| vec![0.0; commands]),
            channels: (0..channels).map(|place| (name(place), unit(place))).collect(),
        })
    }
}

impl PlantOptions {
    fn to_plant(&self) -> Result<LinearPlant, DesignError> {
        let nx = self.a.len();
        let a = shaped_matrix("plant.A", &self.a, (nx, nx), "states x states")?;
        let columns = |rows: &[Vec<f64>]| rows.first().map_or(0, Vec::len);
        let b = shaped_matrix("plant.B", &self.b, (nx, columns(&self.b)), "states x commands")?;
        let g = shaped_matrix(
            "plant.G",
            &self.g,
            (nx, columns(&self.g)),
            "states x process noises",
        )?;
        let f = shaped_matrix(
            "plant.F",
            &self.f,
            (nx, columns(&self.f)),
            "states x fault channels",
        )?;
        let key = "plant.process_noise_psd";
        let noises = g.ncols();
        let q = shaped_matrix(
            key,
            &self.process_noise_psd,
            (noises, noises),
            "process noises x process noises",
        )?;
        if crate::covariance::semidefinite_factor(&q).is_err() {
            return Err(DesignError::CovarianceNotPositiveSemidefinite { name: key.to_owned() });
        }
        let noise = &g * q * g.transpose();
        Ok(LinearPlant {
            noise: (&noise + noise.transpose()) / 2.0,
            a,
            b,
            f,
        })
    }
}

impl SensorOptions {
    fn to_sensor(&self, number: usize, states: usize, form: Form) -> Result<Sensor, DesignError> {
        let key = |entry: &str| format!("sensor.{number}.{entry}");
        let d = self.measurement_matrix.len();
        if d == 0 {
            return Err(DesignError::DimensionMismatch {
                name: key("measurement_matrix"),
                actual: "an empty list".to_owned(),
                expected: "at least one row".to_owned(),
            });
        }
        if form != Form::BatchUnobserved {
            let superfluous = [
                (
                    "arrival_probability",
                    self.arrival_probability.is_some_and(|beta| beta != 1.0),
                ),
                ("initial_held_value", self.initial_held_value.is_some()),
            ];
            if let Some((entry, _)) = superfluous.iter().find(|(_, given)| *given) {
                return Err(DesignError::setting(
                    key(entry),
                    "given",
                    "only `form` = \"batch_unobserved\" uses it, the other forms know the losses; remove it",
                ));
            }
        }
        Ok(Sensor {
            name: self.name.clone(),
            measurement_matrix: shaped_matrix(
                &key("measurement_matrix"),
                &self.measurement_matrix,
                (d, states),
                "rows x states",
            )?,
            noise_covariance: shaped_matrix(
                &key("noise_covariance"),
                &self.noise_covariance,
                (d, d),
                "rows x rows",
            )?,
            arrival_probability: self.arrival_probability.unwrap_or(1.0),
            initial_held_value: self.initial_held_value.clone(),
        })
    }
}

impl ModeOptions {
    /// With the random walk in the slots that are active.
    fn to_mode(&self, number: usize, shape: (usize, usize), walk: &[f64]) -> Result<Mode, DesignError> {
        let key = format!("mode.{number}.direction");
        let direction = shaped_matrix(&key, &self.direction, shape, "fault channels x slots")?;
        let active = |slot: usize| direction.column(slot).iter().any(|entry| *entry != 0.0);
        let density = walk.iter().enumerate();
        Ok(Mode {
            name: self.name.clone(),
            random_walk_psd: density
                .map(|(slot, q)| if active(slot) { *q } else { 0.0 })
                .collect(),
            direction,
        })
    }
}

impl TransitionOptions {
    fn to_transition(&self, modes: usize) -> Result<ModeTransition, DesignError> {
        let kind = match self.kind {
            TransitionKind::Stay => "stay",
            TransitionKind::Rate => "rate",
            TransitionKind::PerStep => "per_step",
        };
        let given = [
            ("stay_probability", "stay", self.stay_probability.is_some()),
            ("stay_period_s", "stay", self.stay_period_s.is_some()),
            ("rate_per_second", "rate", self.rate_per_second.is_some()),
            ("matrix", "per_step", self.matrix.is_some()),
        ];
        for (entry, owner, present) in given {
            let key = format!("transition.{entry}");
            if present && owner != kind {
                let allowed =
                    format!("it belongs to `kind` = \"{owner}\"; remove it or change `transition.kind`");
                return Err(DesignError::setting(key, "given", allowed));
            }
            if !present && owner == kind {
                let allowed = format!("`kind` = \"{kind}\" needs it");
                return Err(DesignError::setting(key, "missing", allowed));
            }
        }
        let rows = |key: &str, rows: &Option<Vec<Vec<f64>>>| {
            let shape = (modes, modes);
            shaped_matrix(key, rows.as_deref().unwrap_or_default(), shape, "modes x modes")
        };
        Ok(match self.kind {
            TransitionKind::Stay => ModeTransition::Stay {
                probability: self.stay_probability.unwrap_or(f64::NAN),
                period_s: self.stay_period_s.unwrap_or(f64::NAN),
            },
            TransitionKind::Rate => {
                ModeTransition::Rate(rows("transition.rate_per_second", &self.rate_per_second)?)
            }
            TransitionKind::PerStep => ModeTransition::PerStep(rows("transition.matrix", &self.matrix)?),
        })
    }
}
