//! The committed table of instruction counts, and how new counts compare with it.
//!
//! A text file: what the counts depend on, then one line `COUNT CASE` for each guarded case.

use std::fmt::Write as _;

use super::callgrind::Counted;

/// Counts may differ from the table by this part of them, either way.
pub const TOLERANCE: f64 = 0.03;

/// Instructions of a step for each case, and what they depend on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct InstructionTable {
    /// Compiler, profile and features of the processor: with others the counts mean nothing.
    pub conditions: Vec<String>,
    /// Instructions of [`STEPS`] steps, by case.
    pub counts: Vec<(u64, String)>,
}

/// Steps that are counted: one period of the recordings.
pub const STEPS: usize = super::super::plant::PERIOD;

/// What counts depend on.
pub fn conditions(compiler: &str, counted: &Counted) -> Vec<String> {
    let profile = match counted.child.has_debug_assertions {
        true => "profile dev",
        false => "profile release",
    };
    vec![
        compiler.to_owned(),
        profile.to_owned(),
        format!("processor {}", counted.child.features),
    ]
}

impl InstructionTable {
    /// Reads the text of a table.
    pub fn parse(text: &str) -> Self {
        let mut table = Self::default();
        for line in text.lines() {
            if let Some(condition) = line.strip_prefix("condition: ") {
                table.conditions.push(condition.to_owned());
            } else if let Some((count, case)) = line.split_once(' ')
                && let Ok(count) = count.parse()
            {
                table.counts.push((count, case.to_owned()));
            }
        }
        table
    }

    /// The text of this table.
    pub fn text(&self) -> String {
        let mut text = format!(
            "# Instructions of {STEPS} steps of each case, counted by callgrind. Written by\n\
             #   RENEW_INSTRUCTION_COUNTS=1 cargo test -p residual-benches --test instructions\n\
             # and compared in that test, within {} %.\n",
            TOLERANCE * 100.0
        );
        for condition in &self.conditions {
            _ = writeln!(text, "condition: {condition}");
        }
        for (count, case) in &self.counts {
            _ = writeln!(text, "{count} {case}");
        }
        text
    }

    /// The count of a case.
    pub fn count_of(&self, case: &str) -> Option<u64> {
        let mut counts = self.counts.iter();
        counts
            .find(|(_, counted)| counted == case)
            .map(|(count, _)| *count)
    }
}

/// What is wrong with a new count, if anything.
pub fn complaint(case: &str, old: Option<u64>, new: u64) -> Option<String> {
    let renew =
        "renew the table with RENEW_INSTRUCTION_COUNTS=1 cargo test -p residual-benches --test instructions";
    let Some(old) = old else {
        return Some(format!("{case}: {new} instructions, not in the table; {renew}"));
    };
    let ratio = new as f64 / old as f64;
    let per_step = |count: u64| count / STEPS as u64;
    let (old, new, change) = (per_step(old), per_step(new), (ratio - 1.0) * 100.0);
    if ratio > 1.0 + TOLERANCE {
        Some(format!(
            "{case}: {new} instructions a step, {old} in the table ({change:+.1} %); find out what made the step dearer, \
             or, if it is worth it, {renew}"
        ))
    } else if ratio < 1.0 - TOLERANCE {
        Some(format!(
            "{case}: only {new} instructions a step, {old} in the table ({change:+.1} %); {renew}, so that the gain is kept"
        ))
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_as_it_was_written() {
        let table = InstructionTable {
            conditions: vec!["rustc 1.2.3".to_owned(), "profile dev".to_owned()],
            counts: vec![(6400, "a method n=4 s=40".to_owned()), (1, "b".to_owned())],
        };
        assert_eq!(InstructionTable::parse(&table.text()), table);
        assert_eq!(table.count_of("b"), Some(1));
        assert_eq!(table.count_of("c"), None);
    }

    #[test]
    fn counts_outside_of_the_tolerance_are_complained_of_either_way() {
        assert_eq!(complaint("a", Some(64_000), 64_000), None);
        assert_eq!(complaint("a", Some(64_000), 65_900), None);
        let dearer = complaint("a", Some(64_000), 66_560).unwrap();
        assert!(
            dearer.contains("1040 instructions a step, 1000 in the table (+4.0 %)"),
            "{dearer}"
        );
        let cheaper = complaint("a", Some(64_000), 32_000).unwrap();
        assert!(
            cheaper.contains("(-50.0 %)") && cheaper.contains("renew"),
            "{cheaper}"
        );
        assert!(complaint("a", None, 1).unwrap().contains("not in the table"));
    }
}
