//! What the design of a bank found, in words: from which size on faults are seen, and what deserves a second look.

use super::{
    achieved::Inspection,
    mode_filter::ModeFilter,
    options::Form,
    paper::{PaperFilter, UnknownInputObserver},
    sensitivity::Sizes,
    settled::settle,
};
use crate::rounding::round_up;

/// Significant digits of a fault size.
const DIGITS: usize = 3;
/// Rounding errors of a size that do not deserve another digit.
const NOISE: f64 = 1e-9;
/// How far S may raise a one-step floor without a warning (method sheet 3.1.6).
const WORTH_A_WARNING: f64 = 1.2;

impl Inspection<'_> {
    /// Name and text of what is worth knowing.
    pub fn notes(&self) -> Vec<(&'static str, String)> {
        let described: Vec<String> = self
            .bank
            .modes()
            .iter()
            .map(|&mode| self.describe(mode))
            .collect();
        let mut notes = vec![
            ("fault modes", described.join(", ")),
            ("parity tests", self.parity_tests()),
        ];
        let sizes = [
            ("detectable", self.sizes_in_words(|sizes| sizes.detectable)),
            ("isolable", self.sizes_in_words(|sizes| sizes.isolable)),
        ];
        notes.extend(sizes.into_iter().filter(|(_, text)| !text.is_empty()));
        notes
    }

    fn parity_tests(&self) -> String {
        let (parity, count) = (&self.options.parity, self.gains.certificates.len());
        match &parity.certificates {
            Some(_) => format!("{count}, as configured"),
            None if count > 0 => format!("{count}, designed"),
            None if parity.lengths.is_empty() => "off".to_owned(),
            None if self.options.filter.form != Form::Coupled => {
                "off, they belong to the coupled form".to_owned()
            }
            None => "none".to_owned(),
        }
    }

    /// "within 1 sample: heater from 0.38 kW, fan from 2; within 3 samples: ..."
    fn sizes_in_words(&self, smallest: impl Fn(&Sizes) -> f64) -> String {
        let delays = self.sizes.first().map_or(0, Vec::len);
        let of_delay = |delay: usize| {
            let actuators = self.model.actuators().iter().zip(&self.sizes);
            let faults: Vec<String> = actuators
                .filter_map(|(actuator, sizes)| {
                    let size = smallest(sizes.get(delay)?);
                    let space = if actuator.unit.is_empty() { "" } else { " " };
                    let certain = size.is_finite() && size > 0.0;
                    certain.then(|| {
                        let size = in_words(size);
                        format!("{} from {size}{space}{}", actuator.name, actuator.unit)
                    })
                })
                .collect();
            let samples = self.sizes.first()?.get(delay)?.samples;
            let unit = if samples == 1 { "sample" } else { "samples" };
            (!faults.is_empty()).then(|| format!("within {samples} {unit}: {}", faults.join(", ")))
        };
        let mut text = (0..delays).filter_map(of_delay).collect::<Vec<_>>().join("; ");
        if !text.is_empty() && self.model.a_plus().amax() > 0.0 {
            text += " (with the state at `filter.nominal_state_magnitude`)";
        }
        text
    }

    /// What is accepted but deserves a second look.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings: Vec<String> = self
            .bank
            .report()
            .warnings
            .iter()
            .map(ToString::to_string)
            .collect();
        match &self.options.filter.fault_of_interest {
            Some(interest) => warnings.extend(self.inert_thresholds(interest)),
            None => warnings.push(
                "`filter.fault_of_interest` is not set: no record will tell when thresholds become too wide to see a \
                 fault"
                    .to_owned(),
            ),
        }
        warnings.extend(self.harmful_s());
        warnings.extend(self.no_parity_tests());
        warnings
    }

    /// Which of the tests that `parity.lengths` asks for do not run.
    fn no_parity_tests(&self) -> Option<String> {
        let (parity, gains) = (&self.options.parity, self.gains);
        if self.options.filter.form != Form::Coupled
            || parity.certificates.is_some()
            || parity.lengths.is_empty()
        {
            return None;
        }
        let untested = gains.untested.iter().map(|window| {
            format!(
                "{} against {} over L = {} ({})",
                self.describe(window.mode),
                self.model.actuators()[window.fault].name,
                window.length,
                window.reason.name()
            )
        });
        match (gains.certificates.len(), gains.untested.len()) {
            (0, 0) => Some(
                "no parity test runs: the gains have no certificates for `parity.lengths`; design them with a program \
                 that has a solver"
                    .to_owned(),
            ),
            (_, 0) => None,
            (_, count) => Some(format!(
                "{count} parity tests do not run, because the gains say that there are none: {}",
                untested.collect::<Vec<_>>().join(", ")
            )),
        }
    }

    /// A warning for every actuator whose fault of interest (units of u) is not certainly detected with the state at
    /// its nominal magnitude: the thresholds are too wide for it.
    fn inert_thresholds(&self, fault_of_interest: &[f64]) -> Vec<String> {
        let actuators = self
            .model
            .actuators()
            .iter()
            .zip(&self.sizes)
            .zip(fault_of_interest);
        let warning = |((actuator, sizes), &interest): ((&crate::model::Label, &Vec<Sizes>), &f64)| {
            let smallest = sizes.last()?.detectable;
            let seen = match smallest.is_finite() {
                true => format!("only from {} on", in_words(smallest)),
                false => "at no size".to_owned(),
            };
            (smallest > interest).then(|| {
                format!(
                    "inert threshold: a fault of \"{}\" is certainly seen {seen}, not from the \
                     `filter.fault_of_interest` = {interest}; reduce `A_uncertainty` or the bounds, or add longer \
                     `parity.lengths`",
                    actuator.name,
                )
            })
        };
        actuators.filter_map(warning).collect()
    }

    /// A warning for every mode of the paper's form whose one-step floors S raises by more than a fifth.
    fn harmful_s(&self) -> Vec<String> {
        let (filter, plant) = (&self.options.filter, &self.bank.plant);
        if filter.form != Form::Paper || filter.s.is_none() {
            return Vec::new();
        }
        let modes = self.bank.modes.iter().zip(&self.settled);
        let warning = |(mode, settled): (&super::bank::Mode, &Option<super::settled::Settled>)| {
            let (with, mode) = (settled.as_ref()?, mode.mode);
            let observer = UnknownInputObserver::new(plant, mode, None);
            let order = filter.effective_generator_order();
            let plain = ModeFilter::Paper(PaperFilter::new(plant, observer, filter.test, order));
            let without = settle(plant, mode, &plain, filter.form, &self.bank.nominal)?;
            let ratio = mode
                .other_actuators(plant.nu())
                .map(|j| with.floors[j] / without.floors[j])
                .filter(|ratio| !ratio.is_nan())
                .fold(0.0, f64::max);
            (ratio > WORTH_A_WARNING).then(|| {
                format!(
                    "`filter.S` makes the tests of the mode {mode} ({}) see faults only from {} times the size on that \
                     they see with S = 0; leave `filter.S` out",
                    self.describe(mode),
                    in_words(ratio)
                )
            })
        };
        modes.filter_map(warning).collect()
    }
}

/// Upwards to few digits, but not because of a rounding error.
fn in_words(size: f64) -> f64 {
    round_up(size * (1.0 - NOISE), DIGITS)
}
