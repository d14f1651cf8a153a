//! What is accepted but deserves a second look.

use super::{Configuration, SignalReference};
use std::collections::HashSet;

impl Configuration {
    /// What in this configuration is allowed, but probably not meant.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = self.unused_signals();
        if !self.daemon.instance().has_room_for_sockets() {
            warnings.push(
                "instance name and runtime directory are too long for the sockets of iceoryx2's event listeners: \
                 consumers of the alarm event service cannot attach; shorten one of them"
                    .into(),
            );
        }
        for diagnoser in &self.diagnosers {
            if diagnoser.margin_ns > diagnoser.period_ns {
                warnings.push(format!(
                    "the margin of the diagnoser `{}` exceeds its period: every alarm comes more than one period \
                     after its instant",
                    diagnoser.name
                ));
            }
        }
        if let Some(replay) = &self.replay {
            let fed: HashSet<usize> = replay.inputs.iter().map(|feed| feed.input).collect();
            for (index, input) in self.inputs.iter().enumerate() {
                if !fed.contains(&index) {
                    warnings.push(format!("no [[replay.input]] feeds the input `{}`", input.name));
                }
            }
        }
        warnings
    }

    fn unused_signals(&self) -> Vec<String> {
        let references = self.diagnosers.iter().flat_map(|diagnoser| {
            let enabling = diagnoser
                .lifecycle
                .enable
                .iter()
                .map(|condition| &condition.signal);
            let own = diagnoser.measurements.iter().chain(&diagnoser.commands);
            own.chain(enabling)
        });
        let used: HashSet<&SignalReference> = references.collect();
        let mut warnings = Vec::new();
        for (index, input) in self.inputs.iter().enumerate() {
            let is_unused = |element: &usize| {
                !used.contains(&SignalReference {
                    input: index,
                    element: *element,
                })
            };
            let unused: Vec<usize> = (0..input.signals.len()).filter(is_unused).collect();
            if unused.len() == input.signals.len() {
                warnings.push(format!("no diagnoser uses the input `{}`", input.name));
            } else {
                warnings.extend(unused.iter().map(|&element| {
                    format!(
                        "no diagnoser uses the signal `{}.{}`",
                        input.name, input.signals[element]
                    )
                }));
            }
        }
        warnings
    }
}
