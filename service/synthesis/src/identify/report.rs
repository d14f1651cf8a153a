//! The result of an identification, and how it is printed.

use super::IdentifyOptions;
use super::evaluate::exceeds_one;
use crate::bounds::NoiseBounds;
use residual_diagnosis::model::Label;
use std::fmt;

/// Bounds found for one noise scale an output.
#[derive(Clone, Debug, PartialEq)]
pub struct StepBounds {
    /// The bounds, with margin, rounded up.
    pub bounds: NoiseBounds,
    /// For each disturbance the training run, from 0, that needs the largest bound; `None` if none needs any.
    pub deciding_runs: Vec<Option<usize>>,
    /// Number of training runs that contradict the bounds found from the other training runs, with margin;
    /// `None` for a single training run.
    pub left_out_failures: Option<usize>,
    /// For each validation run the factor t by which both bounds would have to be multiplied to explain it: at
    /// most 1 = consistent.
    pub validation_factors: Vec<f64>,
    /// Number of validation runs that contradict the bounds.
    pub inconsistent_validation_runs: usize,
    /// For each actuator the smallest constant fault, units of u, that these bounds let any method guarantee to
    /// detect within the window of the options; `None` = not visible in it.
    pub floors: Vec<Option<f64>>,
    /// Geometric mean of the floors that exist: what noise scales are compared by.
    pub mean_floor: f64,
}

/// What came of one step of the ladder.
#[derive(Clone, Debug, PartialEq)]
pub enum StepOutcome {
    /// A training run that no disturbance explains.
    Infeasible {
        /// Its name.
        run: String,
        /// By what factor, above 1, the noise bounds of this step would have to grow at least.
        factor: f64,
    },
    /// Bounds that explain all training runs.
    Bounds(StepBounds),
}

/// One combination of noise scales.
#[derive(Clone, Debug, PartialEq)]
pub struct LadderStep {
    /// ν of every output.
    pub noise_scales: Vec<f64>,
    /// What came of it.
    pub outcome: StepOutcome,
}

/// The identified bounds and the table that they were chosen from. Its `Display` is the report for people.
#[derive(Clone, Debug, PartialEq)]
pub struct Identification {
    /// The chosen bounds, which belong into the configuration, and their checks.
    pub best: StepBounds,
    /// Position of the chosen combination of noise scales in `steps`.
    pub chosen: usize,
    /// All combinations that were tried, in the order of trial.
    pub steps: Vec<LadderStep>,
    pub(super) options: IdentifyOptions,
    pub(super) outputs: Vec<Label>,
    pub(super) actuators: Vec<Label>,
    pub(super) training: Vec<String>,
    pub(super) validation: Vec<String>,
    pub(super) uncertain: bool,
}

/// Columns aligned to the right, two spaces apart.
fn write_table(formatter: &mut fmt::Formatter<'_>, rows: &[Vec<String>]) -> fmt::Result {
    let columns = rows.first().map_or(0, Vec::len);
    let width = |column: usize| {
        rows.iter()
            .map(|row| row[column].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    for row in rows {
        let cells: Vec<String> = row
            .iter()
            .zip(&widths)
            .map(|(cell, &width)| format!("{cell:>width$}"))
            .collect();
        writeln!(formatter, "{}", cells.join("  ").trim_end())?;
    }
    Ok(())
}

fn list(values: impl IntoIterator<Item = f64>) -> String {
    let texts: Vec<String> = values.into_iter().map(|value| value.to_string()).collect();
    format!("[{}]", texts.join(", "))
}

fn with_unit(label: &Label) -> String {
    match label.unit.as_str() {
        "" => label.name.clone(),
        unit => format!("{} [{unit}]", label.name),
    }
}

impl Identification {
    fn heading(&self) -> Vec<String> {
        let mut row = vec![
            String::new(),
            "noise scale".to_owned(),
            "disturbance bound".to_owned(),
        ];
        row.push(format!("left-out failures of {}", self.training.len()));
        row.extend(
            self.actuators
                .iter()
                .map(|actuator| format!("floor {}", with_unit(actuator))),
        );
        row.push(format!("inconsistent of {}", self.validation.len()));
        row.push("worst factor".to_owned());
        row
    }

    fn row(&self, index: usize, step: &LadderStep) -> Vec<String> {
        let mark = if index == self.chosen { "=>" } else { "" };
        let mut row = vec![mark.to_owned(), list(step.noise_scales.iter().copied())];
        match &step.outcome {
            StepOutcome::Infeasible { run, factor } => {
                row.push(format!("none: run {run} needs noise x {factor:.3}"));
                row.resize(self.actuators.len() + 6, "-".to_owned());
            }
            StepOutcome::Bounds(found) => {
                let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
                row.push(list(found.bounds.disturbance.iter().copied()));
                row.push(or_dash(found.left_out_failures.map(|count| count.to_string())));
                row.extend(
                    found
                        .floors
                        .iter()
                        .map(|floor| or_dash(floor.map(|floor| format!("{floor:.4}")))),
                );
                row.push(found.inconsistent_validation_runs.to_string());
                let worst = found.validation_factors.iter().copied().reduce(f64::max);
                row.push(or_dash(worst.map(|factor| format!("{factor:.3}"))));
            }
        }
        row
    }
}

/// What an [`Identification`] rests on, without the keys of a configuration.
pub struct Figures<'a>(&'a Identification);

impl Identification {
    /// The table of the noise scales and the checks of the chosen one.
    pub fn figures(&self) -> Figures<'_> {
        Figures(self)
    }
}

impl fmt::Display for Figures<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let found = self.0;
        let outputs: Vec<String> = found.outputs.iter().map(with_unit).collect();
        writeln!(
            formatter,
            "Bounds from {} training runs, noise scale of {}; floor = smallest constant fault detectable for \
             certain within {} samples.",
            found.training.len(),
            outputs.join(", "),
            found.options.window
        )?;
        let steps = found
            .steps
            .iter()
            .enumerate()
            .map(|(index, step)| found.row(index, step));
        write_table(
            formatter,
            &[found.heading()].into_iter().chain(steps).collect::<Vec<_>>(),
        )?;
        for (j, run) in found.best.deciding_runs.iter().enumerate() {
            match run.and_then(|run| found.training.get(run)) {
                Some(run) => writeln!(
                    formatter,
                    "Disturbance {j}: run {run} needs the most; the bound has {} % margin.",
                    found.options.margin * 100.0
                )?,
                None => writeln!(
                    formatter,
                    "Disturbance {j}: no run needs any; its bound is 0 (identifying it anew needs one above 0 as its unit)."
                )?,
            }
        }
        for (run, factor) in found.validation.iter().zip(&found.best.validation_factors) {
            if exceeds_one(*factor) {
                writeln!(
                    formatter,
                    "Validation run {run} exceeds the bounds by a factor of {factor:.4}."
                )?;
            }
        }
        if found.uncertain {
            writeln!(
                formatter,
                "A_uncertainty counted as zero: the disturbances already account for it."
            )?;
        }
        Ok(())
    }
}

impl fmt::Display for Identification {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let NoiseBounds {
            disturbance,
            measurement,
        } = &self.best.bounds;
        write!(
            formatter,
            "{}\ndisturbance_bound = {}\nmeasurement_noise_bound = {}\n",
            self.figures(),
            list(disturbance.iter().copied()),
            list(measurement.iter().copied())
        )
    }
}
