//! The way from a diagnoser's tables to a diagnoser, and what its design found.

use super::{
    AsyncImm,
    achieved::achieved,
    checks::check,
    design::{Mixing, ModeTransition},
    design_error::DesignError,
    options::AsyncImmTables,
    transition::equal_rate,
};
use crate::gains::{FoundGains, NoGains};
use crate::method::{Designed, MethodOptions, Refusal};

impl MethodOptions for AsyncImmTables {
    const METHOD: &'static str = "async_imm";

    type Gains = NoGains;

    fn signal_counts(&self) -> (usize, usize) {
        let measurements = self
            .sensor
            .iter()
            .map(|sensor| sensor.measurement_matrix.len())
            .sum();
        (measurements, self.plant.b.first().map_or(0, Vec::len))
    }

    /// A fault channel takes name and unit of the command that enters in the same way, if all do.
    fn name_signals(&mut self, _measurements: &[(String, String)], commands: &[(String, String)]) {
        let plant = &mut self.plant;
        if plant.f != plant.b || commands.len() != plant.f.first().map_or(0, Vec::len) {
            return;
        }
        let names: Vec<String> = commands.iter().map(|(name, _)| name.clone()).collect();
        let unique = names
            .iter()
            .enumerate()
            .all(|(place, name)| !names[..place].contains(name));
        if unique {
            plant.channels.get_or_insert(names);
        }
        plant
            .channel_units
            .get_or_insert_with(|| commands.iter().map(|(_, unit)| unit.clone()).collect());
    }

    fn validate(&self, sample_time_s: f64) -> Result<(), Refusal> {
        let (design, settings) = self.to_design(sample_time_s)?;
        check(&design)?;
        Ok(settings.check(&design)?)
    }

    fn find_gains(&self, _sample_time_s: f64) -> Result<FoundGains<NoGains>, Refusal> {
        Ok(FoundGains::closed_form(NoGains {}))
    }

    fn with_gains(&self, sample_time_s: f64, _gains: &NoGains) -> Result<Designed, Refusal> {
        let (design, settings) = self.to_design(sample_time_s)?;
        let diagnoser = AsyncImm::new(&design, settings.clone())?;
        let report = diagnoser.report();
        let name = |mode: usize| design.modes[mode].name.as_str();
        let gaps = report.amplitude_gaps.iter().enumerate();
        let gaps: Vec<String> = gaps
            .map(|(m, gap)| format!("{} {gap:.3e}", name(m + 1)))
            .collect();
        let mut notes = vec![
            ("filter states per mode", design.filter_states().to_string()),
            ("smallest singular value of each amplitude", gaps.join(", ")),
        ];
        if let ModeTransition::Stay {
            probability,
            period_s,
        } = design.transition
        {
            let rate = equal_rate(probability, period_s, design.modes.len());
            notes.push(("rate to each other mode (1/s)", format!("{rate:.6e}")));
        }
        let pairs = report.separable_by_transients_only.iter();
        let mut warnings: Vec<String> = pairs
            .map(|&(i, j)| {
                format!(
                    "the modes \"{}\" and \"{}\" look alike in the steady state: only transients tell them apart",
                    name(i),
                    name(j)
                )
            })
            .collect();
        if design.mixing == Mixing::All {
            warnings.push(
                "`amplitude.mixing` = \"all\": a long time without fault makes the amplitudes certain to be 0, and a \
                 fault may be missed then"
                    .to_owned(),
            );
        }
        Ok(Designed {
            achieved: achieved(&design, &settings, report, sample_time_s),
            diagnoser: Box::new(diagnoser),
            notes,
            warnings,
        })
    }
}

impl From<DesignError> for Refusal {
    fn from(error: DesignError) -> Self {
        Self::new(error.key(), &error)
    }
}
