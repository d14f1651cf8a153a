//! The condition of a diagnoser in a mark, a word and a colour.

use super::theme::Tone;
use crate::snapshot::{Condition, DiagnoserView};

/// The mark and the colour that go with [`word`].
pub fn mark(diagnoser: &DiagnoserView) -> (&'static str, Tone) {
    match (diagnoser.condition, diagnoser.freshness) {
        (Condition::Faulty, "dead") => ("✕", Tone::Bad),
        (_, "dead") => ("✕", Tone::Dead),
        (Condition::Faulty, _) => ("▲", Tone::Bad),
        (Condition::Sound, _) => ("●", Tone::Good),
        (Condition::Unknown, _) => ("○", Tone::Warn),
    }
}

/// The verdict; before it how much it is worth, if it is not the fresh one.
pub fn word(diagnoser: &DiagnoserView) -> String {
    let DiagnoserView {
        freshness, verdict, ..
    } = diagnoser;
    if diagnoser.record == 0 || freshness == verdict {
        (*freshness).into()
    } else if *freshness == "fresh" {
        (*verdict).into()
    } else {
        format!("{freshness}, {verdict}")
    }
}

/// Time since the newest record's sampling instant: steady enough not to flicker.
pub fn age(diagnoser: &DiagnoserView, now_ns: u64) -> String {
    if diagnoser.record == 0 {
        return "-".into();
    }
    let tenths = now_ns.saturating_sub(diagnoser.instant_ns) / 100_000_000;
    match tenths {
        0..100 => format!("{}.{} s", tenths / 10, tenths % 10),
        100..1_200 => format!("{} s", tenths / 10),
        1_200..72_000 => format!("{} min", tenths / 600),
        72_000..1_728_000 => format!("{} h", tenths / 36_000),
        _ => format!("{} d", tenths / 864_000),
    }
}
