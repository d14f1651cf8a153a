//! `[replay]`.

use super::quantity::period_ns;
use super::refuse_duplicates;
use crate::configuration::locate::Mistakes;
use crate::configuration::schema::Replay;
use crate::configuration::suggest::did_you_mean;
use crate::configuration::{InputConfiguration, ReplayConfiguration, ReplayInput};

pub(in crate::configuration) fn replay(
    section: Replay,
    inputs: &[InputConfiguration],
    mistakes: &mut Mistakes<'_>,
) -> ReplayConfiguration {
    let name_path = |index: usize| format!("replay.input.{index}.input");
    refuse_duplicates(
        section.input.iter().map(|input| input.input.as_str()),
        name_path,
        "input",
        mistakes,
    );
    let row_period_ns = section
        .row_period_s
        .and_then(|seconds| period_ns("replay.row_period_s", seconds, mistakes));
    let mut feeds = Vec::with_capacity(section.input.len());
    for (index, feed) in section.input.into_iter().enumerate() {
        let values_path = format!("replay.input.{index}.values");
        for (position, expression) in feed.values.iter().enumerate() {
            if let Err(error) = exmex::parse::<f64>(expression) {
                mistakes.at(
                    &format!("{values_path}.{position}"),
                    format!("`{expression}` is not an expression: {}", error.msg()),
                    "use numbers, + - * / ^, functions such as sin(x), and columns of the recording; a column \
                     whose name is not a plain word goes in braces, for instance {wheel speed}",
                );
            }
        }
        let Some(input) = inputs.iter().position(|input| input.name == feed.input) else {
            let known: Vec<_> = inputs.iter().map(|input| input.name.as_str()).collect();
            let help = did_you_mean(&feed.input, &known, "inputs");
            mistakes.at(
                &name_path(index),
                format!("there is no input `{}`", feed.input),
                help,
            );
            continue;
        };
        let signals = &inputs[input].signals;
        if feed.values.len() != signals.len() {
            mistakes.at(
                &values_path,
                format!(
                    "{} values for the {} signals of the input `{}`",
                    feed.values.len(),
                    signals.len(),
                    feed.input
                ),
                format!(
                    "give one expression per signal, in this order: {}",
                    signals.join(", ")
                ),
            );
        }
        if feed.every_rows == 0 {
            mistakes.at(
                &format!("replay.input.{index}.every_rows"),
                "`every_rows` = 0 takes no row",
                "use 1 for every row, 2 for every second row, and so on",
            );
        } else if feed.first_row >= feed.every_rows {
            mistakes.at(
                &format!("replay.input.{index}.first_row"),
                format!(
                    "`first_row` = {} lies beyond the first {} rows",
                    feed.first_row, feed.every_rows
                ),
                "use a row from 0 to below `every_rows`",
            );
        }
        feeds.push(ReplayInput {
            input,
            values: feed.values,
            every_rows: feed.every_rows,
            first_row: feed.first_row,
        });
    }
    ReplayConfiguration {
        time_column: section.time_column,
        run_column: section.run_column,
        kind_column: section.kind_column,
        fault_column: section.fault_column,
        row_period_ns,
        inputs: feeds,
    }
}
