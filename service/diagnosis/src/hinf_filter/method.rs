//! The method as the configuration sees it.

use super::{
    HinfFilter, construction::METHOD, error::HinfFilterError, find::find_gains, gains::HinfFilterGains,
    options::HinfFilterOptions, problem::Problem, responses::responses,
};
use crate::gains::FoundGains;
use crate::method::{Designed, MethodOptions, Refusal};
use crate::response::Response;

impl From<HinfFilterError> for Refusal {
    fn from(error: HinfFilterError) -> Self {
        Self::new(error.key(), &error)
    }
}

impl MethodOptions for HinfFilterOptions {
    const METHOD: &'static str = METHOD;

    type Gains = HinfFilterGains;

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

    fn needs_solver(&self) -> Option<Refusal> {
        let design = self.synthesis.design;
        design.needs_solver().then(|| {
            HinfFilterError::NeedsSolver {
                design: design.name(),
            }
            .into()
        })
    }

    fn find_gains(&self, sample_time_s: f64) -> Result<FoundGains<HinfFilterGains>, Refusal> {
        let problem = Problem::new(self, sample_time_s)?;
        Ok(FoundGains::closed_form(find_gains(&problem, self)?))
    }

    fn with_gains(&self, sample_time_s: f64, gains: &HinfFilterGains) -> Result<Designed, Refusal> {
        let filter = HinfFilter::with_gains(self, sample_time_s, gains)?;
        let report = filter.report();
        let mut warnings = report.warnings.clone();
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
            achieved: report.achieved.clone(),
            notes: report.notes(),
            diagnoser: Box::new(filter),
            warnings,
        })
    }

    fn responses(&self, sample_time_s: f64, gains: &HinfFilterGains) -> Result<Vec<Response>, Refusal> {
        let problem = Problem::new(self, sample_time_s)?;
        let filter = HinfFilter::with_gains(self, sample_time_s, gains)?;
        Ok(responses(&problem, self.filter.realisation, filter.report()))
    }
}
