//! What a bank achieves, recomputed from its gains (method sheet 3.6).

use super::{
    UnknownInputFilterBank,
    bank::Mode,
    fixed_gain::transition,
    gains::{UnknownInputFilterGains, from_rows},
    mode_filter::ModeFilter,
    modes::FaultMode,
    options::{Form, UnknownInputFilterOptions},
    sensitivity::{ModeFloors, Sizes, sizes},
    settled::{Settled, settle},
};
use crate::{
    achieved::{
        Achieved, Delay, FalseAlarms, FaultSensitivity, Inequality, Need, Norm, NotStated, Poles, Separation,
        SizeOf, TimeDomain,
    },
    matrix::Matrix,
    model::LinearModel,
    spectrum::spectral_radius,
};

/// A bank with each of its filters in the settled state.
pub(super) struct Inspection<'a> {
    pub model: &'a LinearModel,
    pub options: &'a UnknownInputFilterOptions,
    pub gains: &'a UnknownInputFilterGains,
    pub bank: &'a UnknownInputFilterBank,
    /// In the order of the modes; `None` for a mode without filter and for a set that is lost on the way.
    pub settled: Vec<Option<Settled>>,
    /// For each actuator what the bank is certain to see of it, by growing number of samples; empty without guarantee.
    pub sizes: Vec<Vec<Sizes>>,
}

impl<'a> Inspection<'a> {
    /// Lets every filter of a bank that runs on these gains settle.
    pub fn new(
        model: &'a LinearModel,
        options: &'a UnknownInputFilterOptions,
        gains: &'a UnknownInputFilterGains,
        bank: &'a UnknownInputFilterBank,
    ) -> Self {
        let settle_mode = |mode: &Mode| {
            let filter = mode.filter.as_ref()?;
            settle(&bank.plant, mode.mode, filter, options.filter.form, &bank.nominal)
        };
        let settled: Vec<Option<Settled>> = bank.modes.iter().map(settle_mode).collect();
        let actuators = model.actuator_count();
        let floors: Vec<ModeFloors> = bank
            .modes
            .iter()
            .zip(&settled)
            .map(|(mode, settled)| ModeFloors::new(mode, settled.as_ref(), &bank.nominal.state, actuators))
            .collect();
        let guaranteed = options.filter.form != Form::Kalman3Sigma;
        let sizes = (0..actuators)
            .map(|j| if guaranteed { sizes(&floors, j) } else { Vec::new() })
            .collect();
        Self {
            model,
            options,
            gains,
            bank,
            settled,
            sizes,
        }
    }

    /// All of it.
    pub fn achieved(&self, sample_time_s: f64) -> Achieved {
        Achieved {
            false_alarms: Some(self.false_alarms()),
            norms: self.norms(),
            poles: self.poles(),
            inequalities: self.inequalities(),
            faults: self.faults(sample_time_s),
            not_stated: self.not_stated(),
            isolability: self.isolability(),
            thresholds: self.thresholds(),
        }
    }

    /// The filters with what they settle to.
    pub fn filters(&self) -> impl Iterator<Item = (&Mode, &ModeFilter, Option<&Settled>)> {
        let modes = self.bank.modes.iter().zip(&self.settled);
        modes.filter_map(|(mode, settled)| Some((mode, mode.filter.as_ref()?, settled.as_ref())))
    }

    pub fn describe(&self, mode: FaultMode) -> String {
        let names: Vec<&str> = self
            .model
            .actuators()
            .iter()
            .map(|actuator| actuator.name.as_str())
            .collect();
        mode.describe(&names)
    }

    fn false_alarms(&self) -> FalseAlarms {
        let excluded = |condition: &str| FalseAlarms {
            probability_per_instant: Some(0.0),
            expected_per_hour: Some(0.0),
            provided_that: format!(
                "the plant stays within the model, `A_uncertainty`, the disturbance and noise bounds, and the state at \
                 the start lies in the first set{condition}"
            ),
        };
        match self.options.filter.form {
            Form::Coupled if self.options.filter.outward_rounding => excluded(""),
            Form::Coupled | Form::Paper => excluded("; rounding errors are not covered"),
            Form::Kalman3Sigma => FalseAlarms {
                probability_per_instant: None,
                expected_per_hour: None,
                provided_that: "this baseline guarantees nothing and its thresholds at 3σ alarm as often as \
                                the true noise, which is unknown, lets them"
                    .to_owned(),
            },
        }
    }

    /// Φ = (I - LC)A0 of L_fix where there is one, else of the settled gain.
    fn poles(&self) -> Vec<Poles> {
        let mut all = Vec::new();
        for (mode, _, settled) in self.filters() {
            let mode = mode.mode;
            let fixed = self.fixed_transition(mode);
            let (name, matrix) = match (fixed, settled) {
                (Some(fixed), _) => ("L_fix", fixed),
                (None, Some(settled)) => ("settled gain", settled.transition.clone()),
                (None, None) => continue,
            };
            let name = format!("errors of the mode {}, {name}", self.describe(mode));
            all.extend(Poles::of(name, TimeDomain::Discrete, &matrix));
        }
        all
    }

    fn fixed_transition(&self, mode: FaultMode) -> Option<nalgebra::DMatrix<f64>> {
        let plant = &self.bank.plant;
        let (_, entry) = self.gains.of(mode)?;
        let gain = from_rows(entry.fixed.as_ref()?, (plant.nx(), plant.ny()));
        Some(transition(plant, &Matrix::from(&gain)))
    }

    fn inequalities(&self) -> Vec<Inequality> {
        let stable = self.filters().filter_map(|(mode, ..)| {
            let radius = spectral_radius(&self.fixed_transition(mode.mode)?)?;
            Some(Inequality {
                name: format!(
                    "spectral radius of (I - L_fix C)A below 1 in the mode {}",
                    self.describe(mode.mode)
                ),
                margin: 1.0 - radius,
            })
        });
        let seen = self.filters().flat_map(|(mode, ..)| {
            mode.parity.iter().map(|test| Inequality {
                name: format!(
                    "response to a unit fault of {} above 0 in the mode {}, L = {}",
                    self.model.actuators()[test.fault()].name,
                    self.describe(mode.mode),
                    test.length()
                ),
                margin: test.gain(),
            })
        });
        stable.chain(seen).collect()
    }

    /// How wide the sets become: of the filters as they run, and with L_fix alone.
    fn norms(&self) -> Vec<Norm> {
        let mut norms = Vec::new();
        let kind = match self.options.filter.form {
            Form::Kalman3Sigma => "settled standard deviation",
            Form::Coupled | Form::Paper => "settled radius of the set",
        };
        for (mode, _, settled) in self.filters() {
            let mut add = |kind: &str, radius: &[f64]| {
                norms.extend(radius.iter().enumerate().map(|(i, &value)| Norm {
                    name: format!("{kind}, mode {}, state {}", self.describe(mode.mode), i + 1),
                    value,
                    lower_bound: None,
                }));
            };
            if let Some(settled) = settled.filter(|settled| !settled.grows) {
                add(kind, &settled.radius);
            }
            if let Some(radius) = &mode.fixed_radius {
                add("settled radius of the set with L_fix alone", radius);
            }
            let entry = self
                .gains
                .of(mode.mode)
                .and_then(|(_, entry)| entry.fixed.as_ref());
            norms.extend(entry.map(|gain| Norm {
                name: format!(
                    "sum of the magnitudes of L_fix, mode {}",
                    self.describe(mode.mode)
                ),
                value: gain.iter().flatten().map(|value| value.abs()).sum(),
                lower_bound: None,
            }));
        }
        norms
    }

    fn faults(&self, sample_time_s: f64) -> Vec<FaultSensitivity> {
        let finite = |value: f64| value.is_finite().then_some(value);
        let actuators = self.model.actuators().iter().zip(&self.sizes);
        let of_actuator = actuators.filter_map(|(actuator, sizes)| {
            let last = sizes.last()?;
            let delays = sizes.iter().map(|size| Delay {
                within_s: size.samples as f64 * sample_time_s,
                size: size.detectable,
            });
            Some(FaultSensitivity {
                fault: actuator.name.clone(),
                unit: actuator.unit.clone(),
                assurance: 1.0,
                provided_that: self.sizes_provided_that(),
                detectable: finite(last.detectable),
                isolable: finite(last.isolable),
                delays: Delay::worth_stating(delays),
            })
        });
        of_actuator.collect()
    }

    fn not_stated(&self) -> Vec<NotStated> {
        let baseline = self.options.filter.form == Form::Kalman3Sigma;
        let not_stated = |size| NotStated {
            size,
            faults: Vec::new(),
            because: "this baseline guarantees nothing".to_owned(),
        };
        let sizes = [SizeOf::Detectable, SizeOf::Isolable].into_iter();
        sizes.filter(|_| baseline).map(not_stated).collect()
    }

    /// A⁺|x| widens every set, so that the sizes hold for a bounded state only; nothing where A⁺ = 0.
    fn sizes_provided_that(&self) -> String {
        if self.model.a_plus().amax() == 0.0 {
            return String::new();
        }
        let unset = match self.options.filter.nominal_state_magnitude {
            Some(_) => "",
            None => ", which is not set and so zero",
        };
        format!(
            "every state in the filters' sets stays within `filter.nominal_state_magnitude`{unset}; larger states widen \
             the bounds"
        )
    }

    fn isolability(&self) -> Vec<Separation> {
        let pairs = self.bank.report.isolability.iter();
        pairs
            .map(|pair| Separation {
                fault: self.model.actuators()[pair.actuator].name.clone(),
                from: self.describe(pair.mode),
                instants: pair.samples.map(|samples| samples as u64),
                need: Need::Instants,
            })
            .collect()
    }
}
