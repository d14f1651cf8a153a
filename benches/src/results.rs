//! What a subcommand measured.
//!
//! Every subcommand writes one file NAME.json into the directory of results; the report reads them all.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use serde::{Deserialize, Serialize};

use crate::machine::{Machine, load};
use crate::percentiles::{COLUMNS, Percentiles, significant};

/// What one subcommand measured.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Results {
    /// Name of the subcommand and of the file.
    pub name: String,
    /// Heading in the report.
    pub title: String,
    /// What was done, for the reader of the report: Markdown.
    pub about: String,
    /// Whether it was the short run.
    pub quick: bool,
    /// When it was measured, RFC 3339.
    pub date: String,
    /// On what.
    pub machine: Machine,
    /// Load of the last minute, before and after.
    pub load: (f64, f64),
    /// Findings against the aims.
    pub findings: Vec<Finding>,
    /// Raw numbers.
    pub tables: Vec<Table>,
    /// Charts.
    pub charts: Vec<Chart>,
    /// What was left out, and why.
    pub skipped: Vec<Skipped>,
    /// What else the reader should know.
    pub notes: Vec<String>,
}

/// One measured value against its aim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Finding {
    /// What was measured.
    pub what: String,
    /// What it should be.
    pub aim: String,
    /// What it is.
    pub measured: String,
    /// Whether that is enough.
    pub outcome: Outcome,
}

/// Whether an aim was met.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// The aim was met.
    Met,
    /// It was not.
    Missed,
    /// It could not be measured here.
    NotMeasured,
}

/// A table of the report.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Table {
    /// Above it.
    pub title: String,
    /// Heads of the columns.
    pub columns: Vec<String>,
    /// Cells, one for each column.
    pub rows: Vec<Vec<String>>,
}

/// A chart of the report.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Chart {
    /// Name of the file, without directory and ending.
    pub file: String,
    /// Above it.
    pub title: String,
    /// Quantity and unit of the horizontal axis.
    pub x: String,
    /// Quantity and unit of the vertical axis.
    pub y: String,
    /// Name and points of every curve.
    pub curves: Vec<(String, Vec<(f64, f64)>)>,
}

/// What was left out.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Skipped {
    /// What.
    pub what: String,
    /// Why, and what to do so that it is measured.
    pub why: String,
}

impl Results {
    /// Results without any number yet; measurements begin now.
    pub fn begin(name: &str, title: &str, about: &str, quick: bool) -> Self {
        let now = time::OffsetDateTime::now_utc();
        Self {
            name: name.to_owned(),
            title: title.to_owned(),
            about: about.to_owned(),
            quick,
            date: now
                .format(&time::format_description::well_known::Rfc3339)
                .unwrap_or_default(),
            machine: Machine::this(),
            load: (load(), f64::NAN),
            findings: Vec::new(),
            tables: Vec::new(),
            charts: Vec::new(),
            skipped: Vec::new(),
            notes: Vec::new(),
        }
    }

    /// States that something was left out.
    pub fn skip(&mut self, what: impl Into<String>, why: impl Into<String>) {
        let (what, why) = (what.into(), why.into());
        eprintln!("skipped: {what}: {why}");
        self.skipped.push(Skipped { what, why });
    }

    /// Writes NAME.json into `directory`; measurements are over.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(mut self, directory: &Path) -> Result<Self> {
        self.load.1 = load();
        fs::create_dir_all(directory).with_context(|| format!("{} cannot be made", directory.display()))?;
        let path = directory.join(format!("{}.json", self.name));
        let text = serde_json::to_string_pretty(&self)?;
        fs::write(&path, text).with_context(|| format!("{} cannot be written", path.display()))?;
        Ok(self)
    }

    /// Reads NAME.json from `directory`.
    ///
    /// # Errors
    /// There is none, or it is no file of results.
    pub fn load(directory: &Path, name: &str) -> Result<Self> {
        let path = directory.join(format!("{name}.json"));
        let text = fs::read_to_string(&path).with_context(|| format!("{} cannot be read", path.display()))?;
        serde_json::from_str(&text).with_context(|| format!("{} is no file of results", path.display()))
    }
}

impl Finding {
    /// A value that should be at most `limit`.
    pub fn at_most(what: impl Into<String>, value: f64, limit: f64, unit: &str) -> Self {
        Self::judged(what, ("≤", limit), value, unit, value <= limit)
    }

    /// A value that should be at least `limit`.
    pub fn at_least(what: impl Into<String>, value: f64, limit: f64, unit: &str) -> Self {
        Self::judged(what, ("≥", limit), value, unit, value >= limit)
    }

    /// An aim in words.
    pub fn of(
        what: impl Into<String>,
        aim: impl Into<String>,
        measured: impl Into<String>,
        is_met: bool,
    ) -> Self {
        Self {
            what: what.into(),
            aim: aim.into(),
            measured: measured.into(),
            outcome: if is_met { Outcome::Met } else { Outcome::Missed },
        }
    }

    /// An aim that could not be measured here.
    pub fn not_measured(what: impl Into<String>, aim: impl Into<String>, why: impl Into<String>) -> Self {
        Self {
            what: what.into(),
            aim: aim.into(),
            measured: why.into(),
            outcome: Outcome::NotMeasured,
        }
    }

    fn judged(
        what: impl Into<String>,
        (relation, limit): (&str, f64),
        value: f64,
        unit: &str,
        is_met: bool,
    ) -> Self {
        let with_unit = |value| format!("{} {unit}", significant(value)).trim_end().to_owned();
        Self::of(
            what,
            format!("{relation} {}", with_unit(limit)),
            with_unit(value),
            is_met,
        )
    }
}

impl Table {
    /// A table without rows.
    pub fn new(title: impl Into<String>, columns: &[&str]) -> Self {
        Self {
            title: title.into(),
            columns: columns.iter().map(|&column| column.to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// A table of percentiles without rows: the columns `first`, then those of [`Percentiles`].
    pub fn of_percentiles(title: impl Into<String>, first: &[&str]) -> Self {
        Self::new(title, &[first, &COLUMNS].concat())
    }

    /// Adds a row.
    pub fn row(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    /// Adds a row of percentiles, headed by `first`.
    pub fn percentiles(
        &mut self,
        first: impl IntoIterator<Item = impl Into<String>>,
        percentiles: &Percentiles,
    ) {
        let first = first.into_iter().map(Into::into);
        self.rows.push(first.chain(percentiles.cells()).collect());
    }
}
