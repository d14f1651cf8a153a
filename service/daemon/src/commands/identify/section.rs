//! The text of a model section: TOML that can be pasted into a configuration, with figures as comments.

use nalgebra::DMatrix;
use residual_synthesis::identify::model::{IdentifiedModel, Prediction};
use std::fmt::{self, Write as _};

/// A growing section.
#[derive(Clone, Debug, Default)]
pub struct Section {
    text: String,
}

/// A number as TOML, short and exact.
pub fn number(value: f64) -> String {
    let size = value.abs();
    if size != 0.0 && !(1e-4..1e9).contains(&size) {
        format!("{value:e}")
    } else {
        // Not -0.
        (value + 0.0).to_string()
    }
}

fn list(values: impl IntoIterator<Item = f64>) -> String {
    let texts: Vec<String> = values.into_iter().map(number).collect();
    format!("[{}]", texts.join(", "))
}

impl Section {
    /// Comment lines.
    pub fn comment(&mut self, text: impl fmt::Display) {
        for line in text.to_string().lines() {
            let _ = writeln!(self.text, "{}", format!("# {line}").trim_end());
        }
    }

    /// A line as it is.
    pub fn line(&mut self, text: &str) {
        let _ = writeln!(self.text, "{text}");
    }

    /// A matrix, one row a line.
    pub fn matrix(&mut self, key: &str, matrix: &DMatrix<f64>) {
        let rows: Vec<String> = matrix
            .row_iter()
            .map(|row| format!("  {},\n", list(row.iter().copied())))
            .collect();
        let _ = writeln!(self.text, "{key} = [\n{}]", rows.concat());
    }

    /// A list of numbers.
    pub fn list(&mut self, key: &str, values: impl IntoIterator<Item = f64>) {
        let _ = writeln!(self.text, "{key} = {}", list(values));
    }

    /// What was learnt from, and how well every output is predicted.
    pub fn predictions(&mut self, found: &IdentifiedModel, outputs: &[String]) {
        let held_out = match found.validation_runs {
            0 => String::new(),
            runs => format!("; {runs} runs held out"),
        };
        self.comment(format_args!(
            "{} runs, {} measured values; log-likelihood {:.2} after {} iterations{held_out}.",
            found.runs, found.training.elements, found.log_likelihood, found.iterations
        ));
        for parameter in &found.parameters {
            let limit = if parameter.at_limit {
                ", at the end of its range"
            } else {
                ""
            };
            self.comment(format_args!(
                "{} = {} +- {:.2e} (standard error){limit}",
                parameter.name,
                number(parameter.value),
                parameter.standard_error
            ));
        }
        for deviation in &found.deviations {
            let value = deviation.value;
            let what = match deviation.relative_error {
                _ if deviation.at_lower_limit => {
                    format!("{value:.1e}, the end of its range: the data need none")
                }
                Some(error) => format!("{value:.3e} +- {:.1} %", 100.0 * error),
                None => format!("{value:.3e}"),
            };
            self.comment(format_args!("standard deviation of {}: {what}", deviation.name));
        }
        self.comment("One-step predictions, root mean square (correlation with the innovation before):");
        let parts = [
            ("training", Some(&found.training)),
            ("cross-validation", Some(&found.cross_validation)),
            ("held out", found.validation.as_ref()),
        ];
        let figure = |of: &dyn Fn(&Prediction) -> String| {
            let texts = parts
                .iter()
                .filter_map(|(name, part)| part.map(|part| format!("{name} {}", of(part))));
            texts.collect::<Vec<_>>().join(", ")
        };
        for (i, output) in outputs.iter().enumerate() {
            let of_output = |part: &Prediction| format!("{:.4e} ({:.2})", part.rms[i], part.correlation[i]);
            self.comment(format_args!("  {output}: {}", figure(&of_output)));
        }
        let normalised = figure(&|part: &Prediction| format!("{:.3}", part.normalised_square));
        self.comment(format_args!(
            "Mean normalised innovation square, 1 if all is right: {normalised}"
        ));
        if found.is_overfitted() {
            self.overfitted(found.cross_validation_ratio());
        }
    }

    /// The warning of a model that does not carry over.
    pub fn overfitted(&mut self, ratio: f64) {
        self.comment(format_args!(
            "OVERFITTED: predictions of runs that took no part are {ratio:.2} times worse; free fewer entries, use fewer \
             terms, or record more."
        ));
    }
}

impl fmt::Display for Section {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.text.trim_end())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_come_back_from_toml_as_they_went() {
        for value in [0.0, -0.0, 1.0, 0.1 + 0.2, 4e-6, -3.25e-17, 6.02e23, 123_456.789] {
            let table: toml::Table = format!("x = [{}]", number(value)).parse().unwrap();
            let read = &table["x"][0];
            let read = read
                .as_float()
                .or_else(|| read.as_integer().map(|whole| whole as f64));
            assert_eq!(read, Some(value), "{}", number(value));
        }
    }
}
