//! `[replay]`.

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
    refuse_duplicates(section.input.iter().map(|input| input.input.as_str()), name_path, "input", mistakes);
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
            mistakes.at(&name_path(index), format!("there is no input `{}`", feed.input), help);
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
                format!("give one expression per signal, in this order: {}", signals.join(", ")),
            );
        }
        feeds.push(ReplayInput { input, values: feed.values });
    }
    ReplayConfiguration { time_column: section.time_column, run_column: section.run_column, inputs: feeds }
}
