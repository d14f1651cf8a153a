//! From the tables of a diagnoser to the diagnoser.

use super::{
    ChiSquareDiagnoser,
    channels::describe_mode,
    construction::check,
    diagnoser::METHOD,
    error::ChiSquareError,
    model_options::Schedule,
    options::{ChiSquareOptions, StatisticKind},
};
use crate::{
    diagnoser::Diagnoser,
    gains::{FoundGains, NoGains},
    method::{Designed, MethodOptions, Refusal},
    model::adopt_labels,
};

impl MethodOptions for ChiSquareOptions {
    const METHOD: &'static str = METHOD;

    type Gains = NoGains;

    fn signal_counts(&self) -> (usize, usize) {
        let own = self.model.matrices();
        let selected = self.model.schedule == Schedule::Selected;
        let matrices = if selected {
            self.models.first().cloned().unwrap_or_default()
        } else {
            own
        };
        (
            matrices.measurement_count(),
            matrices.input_count() + usize::from(selected),
        )
    }

    fn name_signals(&mut self, measurements: &[(String, String)], _commands: &[(String, String)]) {
        let model = &mut self.model;
        adopt_labels(
            measurements,
            &mut model.measurement_names,
            &mut model.measurement_units,
        );
    }

    fn validate(&self, _sample_time_s: f64) -> Result<(), Refusal> {
        refuse_external(self)?;
        check(self)?;
        Ok(())
    }

    fn find_gains(&self, _sample_time_s: f64) -> Result<FoundGains<NoGains>, Refusal> {
        Ok(FoundGains::closed_form(NoGains {}))
    }

    fn with_gains(&self, sample_time_s: f64, _gains: &NoGains) -> Result<Designed, Refusal> {
        refuse_external(self)?;
        let diagnoser = ChiSquareDiagnoser::new(self)?;
        Ok(Designed {
            achieved: diagnoser.achieved(self, sample_time_s),
            notes: notes(self, &diagnoser),
            warnings: diagnoser.design().report.warnings.clone(),
            diagnoser: Box::new(diagnoser),
        })
    }
}

fn refuse_external(options: &ChiSquareOptions) -> Result<(), ChiSquareError> {
    match options.model.schedule {
        Schedule::External => Err(ChiSquareError::ExternalSchedule),
        _ => Ok(()),
    }
}

fn notes(options: &ChiSquareOptions, diagnoser: &ChiSquareDiagnoser) -> Vec<(&'static str, String)> {
    let mut notes = Vec::new();
    let design = diagnoser.design();
    let thresholds = &design.thresholds;
    if let Some(stability) = &design.report.stability {
        notes.push((
            "stability guard",
            format!(
                "{}, excited and observable modes up to {:.6}",
                stability.verdict.name(),
                stability.effective_spectral_radius
            ),
        ));
    }
    if let Some(steady) = &design.report.steady_state {
        notes.push(("filter steady after", format!("{} steps", steady.steps)));
    }
    for kind in &options.statistics.decision {
        let (name, threshold) = match kind {
            StatisticKind::Glr => ("threshold of glr", thresholds.glr),
            StatisticKind::Cusum => ("threshold of cusum", thresholds.cusum),
            StatisticKind::StateWindow => ("bound of the state windows over t_d", thresholds.bank),
            StatisticKind::Residual => (
                "threshold of residual, one degree of freedom",
                thresholds.residual[1],
            ),
            StatisticKind::StatePlain => (
                "threshold of state_plain, one degree of freedom",
                thresholds.plain[1],
            ),
            StatisticKind::StateTwoPropagator => (
                "threshold of state_two_propagator, one degree of freedom",
                thresholds.pair[1],
            ),
        };
        notes.push((name, format!("{threshold:.3}")));
    }
    if let Some(calibration) = &design.calibration {
        let runs = calibration.maxima.first().map_or(0, Vec::len);
        notes.push((
            "calibrated with",
            format!("{runs} runs of {} steps", options.threshold.run_steps),
        ));
    }
    let modes = diagnoser.modes().iter();
    let described: Vec<_> = modes
        .map(|mode| describe_mode(mode, &diagnoser.description().faults))
        .collect();
    if !described.is_empty() {
        notes.push(("fault modes", described.join(", ")));
    }
    notes
}
