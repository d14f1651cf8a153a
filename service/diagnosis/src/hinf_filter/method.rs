//! The method as the configuration sees it.

use super::{
    HinfFilter, construction::METHOD, error::HinfFilterError, options::HinfFilterOptions, problem::Problem,
};
use crate::achieved::Achieved;
use crate::gains::{FoundGains, NoGains};
use crate::method::{Designed, MethodOptions, Refusal};

impl From<HinfFilterError> for Refusal {
    fn from(error: HinfFilterError) -> Self {
        Self::new(error.key(), &error)
    }
}

impl MethodOptions for HinfFilterOptions {
    const METHOD: &'static str = METHOD;

    type Gains = NoGains;

    fn signal_counts(&self) -> (usize, usize) {
        (self.model.c.len(), self.model.b.first().map_or(0, Vec::len))
    }

    fn name_signals(&mut self, measurements: &[(String, String)], _commands: &[(String, String)]) {
        let units = measurements.iter().map(|(_, unit)| unit.clone());
        self.model.output_units.get_or_insert_with(|| units.collect());
    }

    fn validate(&self, sample_time_s: f64) -> Result<(), Refusal> {
        Problem::new(self, sample_time_s)?;
        Ok(())
    }

    fn find_gains(&self, _sample_time_s: f64) -> Result<FoundGains<NoGains>, Refusal> {
        Ok(FoundGains::closed_form(NoGains {}))
    }

    fn with_gains(&self, sample_time_s: f64, _gains: &NoGains) -> Result<Designed, Refusal> {
        let filter = HinfFilter::new(self, sample_time_s)?;
        let report = filter.report();
        let mut warnings = Vec::new();
        if let Some(reason) = &report.missing_guarantee {
            warnings.push(format!("alarms without a fault are possible: {reason}"));
        } else if self.disturbance.slew.is_none() {
            warnings.push(
                "`disturbance.slew` is not set: the guarantee covers disturbances that change at sampling instants \
                 only"
                    .to_owned(),
            );
        }
        Ok(Designed {
            achieved: Achieved::default(),
            notes: report.notes(),
            diagnoser: Box::new(filter),
            warnings,
        })
    }
}
