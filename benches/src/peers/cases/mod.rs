//! The diagnosers that are compared, their plants, and the problems as the peers read them.

mod async_imm;
mod chi_square;
mod hinf_filter;
mod plant;
mod reduced_order_observer;
mod unknown_input_filter;

use std::fmt::Write as _;

use anyhow::{Context, Result};
use residual_diagnosis::diagnoser::Diagnoser;
use residual_diagnosis::method::MethodOptions;
use serde_json::{Value, json};

use super::contender::Inputs;

/// A program that does the same step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Program {
    /// `benches/peers/numpy/SCRIPT.py`, which needs the Python package.
    Python {
        /// Name of the script.
        script: &'static str,
        /// What it imports.
        package: &'static str,
    },
    /// `benches/peers/eigen/SOURCE.cpp`.
    Eigen {
        /// Name of the source.
        source: &'static str,
        /// For the instruction set of this machine, not for the baseline.
        native: bool,
    },
}

impl Program {
    /// What it is called while it is not there to say so itself.
    pub fn name(self) -> &'static str {
        match self {
            Self::Python { package, .. } => package,
            Self::Eigen { native: false, .. } => "Eigen",
            Self::Eigen { native: true, .. } => "Eigen, -march=native",
        }
    }
}

/// One step that is compared.
pub struct Case {
    /// Name of the files of the problem.
    pub name: &'static str,
    /// Name for the report.
    pub title: String,
    /// This side: the first one is the reference, the others may differ from it by as much.
    pub own: Vec<(String, Box<dyn Diagnoser>, f64)>,
    /// The other side, and the aim of its time over ours.
    pub peers: Vec<(Program, Option<f64>)>,
    /// What the diagnosers see.
    pub inputs: Inputs,
    /// The same for the peers, with the tables of the diagnoser and its gains.
    pub problem: Value,
    /// Channels whose residual and upper bound are compared, all residuals first.
    pub compared: Vec<usize>,
    /// Largest difference of a peer.
    pub tolerance: f64,
}

impl Case {
    /// The problem for programs without a reader of JSON: every matrix and list of `problem.plain` as a line with its
    /// name, its rows, its columns and its numbers.
    pub fn plain_problem(&self) -> String {
        let mut text = String::new();
        let plain = self.problem.get("plain").and_then(Value::as_object);
        let lists = plain.into_iter().flatten();
        for (name, value) in lists.chain([
            (&"measurements".to_owned(), &json!(self.inputs.measurements)),
            (&"commands".to_owned(), &json!(self.inputs.commands)),
        ]) {
            let rows: Vec<Vec<f64>> = serde_json::from_value(value.clone()).unwrap_or_default();
            _ = write!(text, "{name} {} {}", rows.len(), rows.first().map_or(0, Vec::len));
            rows.iter()
                .flatten()
                .for_each(|number| _ = write!(text, " {number:e}"));
            text.push('\n');
        }
        text
    }
}

/// All cases.
///
/// # Errors
/// A diagnoser cannot be designed.
pub fn all() -> Result<Vec<Case>> {
    let mut all = unknown_input_filter::cases()?;
    all.extend(reduced_order_observer::cases()?);
    all.extend(async_imm::cases()?);
    all.extend(chi_square::cases()?);
    all.extend(hinf_filter::cases()?);
    Ok(all)
}

/// A designed diagnoser with what a peer must know of it.
struct Designed {
    diagnoser: Box<dyn Diagnoser>,
    tables: Value,
    gains: Value,
}

fn design<T: MethodOptions>(tables: &str, sample_time_s: f64) -> Result<Designed> {
    let refused = || format!("the {} diagnoser of the comparison", T::METHOD);
    let tables: T = toml::from_str(tables).with_context(refused)?;
    tables.validate(sample_time_s).with_context(refused)?;
    let gains = tables.find_gains(sample_time_s).with_context(refused)?.gains;
    let designed = tables.with_gains(sample_time_s, &gains).with_context(refused)?;
    Ok(Designed {
        diagnoser: designed.diagnoser,
        tables: serde_json::to_value(&tables)?,
        gains: serde_json::to_value(&gains)?,
    })
}

impl Designed {
    /// What a peer reads.
    fn problem(&self, sample_time_s: f64, inputs: &Inputs) -> Value {
        json!({
            "tables": self.tables,
            "gains": self.gains,
            "sample_time_s": sample_time_s,
            "measurements": inputs.measurements,
            "commands": inputs.commands,
        })
    }

    /// The places of the channels whose names begin with one of `prefixes`, in the order of the record.
    fn channels(&self, prefixes: &[&str]) -> Vec<usize> {
        let channels = self.diagnoser.description().channels.iter().enumerate();
        let wanted =
            channels.filter(|(_, channel)| prefixes.iter().any(|prefix| channel.name.starts_with(prefix)));
        wanted.map(|(place, _)| place).collect()
    }
}
