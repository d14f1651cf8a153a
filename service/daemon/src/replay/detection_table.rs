//! The detections of a replay as text: a table for people, CSV or JSON for programs.

use clap::ValueEnum;
use comfy_table::presets::ASCII_MARKDOWN;
use comfy_table::{CellAlignment, Table};

use super::detections::Detections;

/// How the table is printed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum TableFormat {
    /// A line a run and the totals of each kind, for people.
    Text,
    /// A line a run and diagnoser, without totals.
    Csv,
    /// Runs and totals in one object.
    Json,
}

impl Detections<'_> {
    /// The table as text.
    pub fn show(&self, format: TableFormat) -> String {
        match format {
            TableFormat::Text => format!("{}\n\n{}\n", self.text_of_runs(), self.text_of_totals()),
            TableFormat::Csv => self.csv(),
            TableFormat::Json => {
                let table = serde_json::json!({ "runs": self.rows(), "totals": self.totals() });
                format!("{table:#}\n")
            }
        }
    }

    fn text_of_runs(&self) -> Table {
        let isolates = |slot: usize| self.runs.iter().any(|run| run.outcomes[slot].isolated.is_some());
        let isolates: Vec<bool> = (0..self.diagnosers.len()).map(isolates).collect();
        let mut head = vec!["run".to_owned(), "kind".into(), "onset [s]".into()];
        for ((name, _), isolates) in self.diagnosers.iter().zip(&isolates) {
            head.push(format!("{name}: after [s]"));
            if *isolates {
                head.push(format!("{name}: isolated"));
            }
            head.push(format!("{name}: false"));
        }
        let mut table = Table::new();
        table.load_style(ASCII_MARKDOWN);
        table.set_header(head);
        let rows = self.rows();
        for row in rows.chunks(self.diagnosers.len().max(1)) {
            let Some(first) = row.first() else { continue };
            let mut cells = vec![first.run.clone(), first.kind.clone(), number(first.onset_s)];
            for (row, isolates) in row.iter().zip(&isolates) {
                cells.push(match (row.onset_s, row.detected_after_s) {
                    (Some(_), None) => "no".into(),
                    (_, after_s) => number(after_s),
                });
                if *isolates {
                    cells.push(row.isolated.clone().unwrap_or_else(|| "-".into()));
                }
                cells.push(row.false_alarms.to_string());
            }
            table.add_row(cells);
        }
        align_from(&mut table, 2);
        table
    }

    fn text_of_totals(&self) -> Table {
        let mut table = Table::new();
        table.load_style(ASCII_MARKDOWN);
        table.set_header([
            "kind",
            "diagnoser",
            "detected",
            "median delay [s]",
            "isolated",
            "runs with false alarms",
        ]);
        for total in self.totals() {
            let of_faulty = |count: usize| match total.faulty {
                0 => "-".into(),
                faulty => format!("{count} of {faulty}"),
            };
            table.add_row([
                total.kind.clone(),
                total.diagnoser.clone(),
                of_faulty(total.detected),
                number(total.median_delay_s),
                of_faulty(total.isolated),
                format!("{} of {}", total.runs_with_false_alarms, total.runs),
            ]);
        }
        align_from(&mut table, 2);
        table
    }

    fn csv(&self) -> String {
        let mut writer = csv::Writer::from_writer(Vec::new());
        for row in self.rows() {
            // Neither writing to memory nor a row without nested parts can fail.
            let _ = writer.serialize(row);
        }
        let bytes = writer.into_inner().unwrap_or_default();
        String::from_utf8_lossy(&bytes).into_owned()
    }
}

fn number(seconds: Option<f64>) -> String {
    seconds.map_or("-".into(), |seconds| format!("{seconds:.3}"))
}

/// Aligns the columns from `first` on to the right.
fn align_from(table: &mut Table, first: usize) {
    for column in table.column_iter_mut().skip(first) {
        column.set_cell_alignment(CellAlignment::Right);
    }
}
