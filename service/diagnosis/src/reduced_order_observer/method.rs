//! From the tables of a configuration to the diagnoser.

use super::{
    achieved::achieved,
    baseline::BaselineObserver,
    design::Design,
    gains::ReducedOrderObserverGains,
    joint::ReducedOrderObserver,
    observer_design::ObserverDesign,
    options::{Gains, Mode, NamedM, ObserverM, ReducedOrderObserverOptions},
    responses::responses,
    synthesis::find_gains,
};
use crate::{
    diagnoser::Diagnoser,
    gains::FoundGains,
    method::{Designed, MethodOptions, Refusal},
    response::Response,
};
use nalgebra::{DMatrix, DVector};

impl MethodOptions for ReducedOrderObserverOptions {
    const METHOD: &'static str = "reduced_order_observer";

    type Gains = ReducedOrderObserverGains;

    fn signal_counts(&self) -> (usize, usize) {
        (self.model.c.len(), self.model.b.first().map_or(0, Vec::len))
    }

    fn name_signals(&mut self, measurements: &[(String, String)], commands: &[(String, String)]) {
        let list = |signals: &[(String, String)], part: fn(&(String, String)) -> &String| {
            signals.iter().map(|signal| part(signal).clone()).collect()
        };
        let model = &mut self.model;
        model
            .output_names
            .get_or_insert_with(|| list(measurements, |signal| &signal.0));
        model
            .output_units
            .get_or_insert_with(|| list(measurements, |signal| &signal.1));
        model
            .actuator_names
            .get_or_insert_with(|| list(commands, |signal| &signal.0));
        model
            .actuator_units
            .get_or_insert_with(|| list(commands, |signal| &signal.1));
    }

    fn validate(&self, _sample_time_s: f64) -> Result<(), Refusal> {
        Ok(self.check()?)
    }

    fn needs_solver(&self) -> Option<Refusal> {
        let refusal = |key: &str, word: &str| {
            let reason = format!(
                "`{key}` = \"{word}\" asks for gains that only a solver finds; take gains from a file, or from a closed \
                 form"
            );
            Some(Refusal::new(key, &reason))
        };
        let design = &self.design;
        match (design.gains, &design.observer_m) {
            (Gains::H2 | Gains::Lmi, _) => refusal("design.gains", design.gains.name()),
            (_, ObserverM::Named(NamedM::Lmi)) => refusal("design.observer_M", NamedM::Lmi.name()),
            _ => None,
        }
    }

    fn find_gains(&self, _sample_time_s: f64) -> Result<FoundGains<Self::Gains>, Refusal> {
        Ok(find_gains(self)?)
    }

    fn responses(&self, sample_time_s: f64, gains: &Self::Gains) -> Result<Vec<Response>, Refusal> {
        Ok(responses(&Design::with_gains(self, gains)?, sample_time_s))
    }

    fn with_gains(&self, sample_time_s: f64, gains: &Self::Gains) -> Result<Designed, Refusal> {
        let mut design = Design::with_gains(self, gains)?;
        let mut settled = Vec::new();
        let diagnoser: Box<dyn Diagnoser> = match self.bounds.mode {
            Mode::Joint => Box::new(ReducedOrderObserver::new(&design)?),
            Mode::Paper | Mode::Tiom => {
                let diagnoser = BaselineObserver::new(&design)?;
                match diagnoser.settled_half_widths() {
                    Some(widths) => settled = widths,
                    None => design.warnings.push(
                        "the half widths of this `bounds.mode` grow without limit; choose another M or a larger \
                         `bounds.generator_order`"
                            .to_owned(),
                    ),
                }
                Box::new(diagnoser)
            }
        };
        Ok(Designed {
            achieved: achieved(&design, &settled, sample_time_s),
            diagnoser,
            notes: notes(&design),
            warnings: design.warnings,
        })
    }
}

/// What the design found, for people.
fn notes(design: &Design) -> Vec<(&'static str, String)> {
    let main = &design.main;
    let mut notes = vec![
        ("gains", source(design)),
        ("K", matrix(&main.observer.k)),
        ("M", matrix(&main.observer.m)),
        ("eigenvalues of F", eigenvalues(main)),
        ("table length", main.reach.length().to_string()),
        ("test directions", main.tests.nrows().to_string()),
        ("steady half widths of the outputs", list(&main.hull())),
    ];
    if design.options.bounds.mode == Mode::Joint {
        notes.push((
            "constant faults certain to alarm, outputs alone",
            list(&main.hull_floors()),
        ));
        notes.push((
            "constant faults certain to alarm, all directions",
            list(&main.set_floors()),
        ));
    }
    if let Some(certificate) = &design.certificate {
        let margins = format!(
            "smallest eigenvalue {:e}, largest change {:e}",
            certificate.smallest, certificate.decrease
        );
        notes.push(("Lyapunov certificate", margins));
    }
    for (kind, designs) in [
        ("isolation member", &design.isolation.members),
        ("fault estimator", &design.isolation.estimators),
    ] {
        for member in designs {
            let actuator = member.actuator.unwrap_or_default();
            let text = format!(
                "actuator {actuator}: eigenvalues of F {}, steady half widths {}",
                eigenvalues(member),
                list(&member.steady())
            );
            notes.push((kind, text));
        }
    }
    notes
}

/// Where K comes from; what cannot be recomputed is marked as a statement.
fn source(design: &Design) -> String {
    let source = &design.gains.main.source;
    match source.is_of_solver() {
        true => format!("{source}, as they state"),
        false => source.to_string(),
    }
}

fn eigenvalues(design: &ObserverDesign) -> String {
    let values = design.eigenvalues().unwrap_or_default();
    let texts = values.iter().map(|value| match value.im {
        0.0 => format!("{:.6}", value.re),
        im => format!("{:.6}{im:+.6}i", value.re),
    });
    format!("[{}]", texts.collect::<Vec<_>>().join(", "))
}

fn list(values: &DVector<f64>) -> String {
    let texts: Vec<String> = values.iter().map(|value| format!("{value:.6}")).collect();
    format!("[{}]", texts.join(", "))
}

fn matrix(matrix: &DMatrix<f64>) -> String {
    let rows = matrix.row_iter().map(|row| {
        let texts: Vec<String> = row.iter().map(f64::to_string).collect();
        format!("[{}]", texts.join(", "))
    });
    format!("[{}]", rows.collect::<Vec<_>>().join(", "))
}
