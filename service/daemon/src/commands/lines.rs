//! A report in lines: headings, and entries in two columns.

use std::fmt::Write as _;

/// Width of the column of names.
const NAME_WIDTH: usize = 18;

/// Width of the report.
const LINE_WIDTH: usize = 110;

/// The report under construction.
#[derive(Default)]
pub(super) struct Lines {
    pub text: String,
    pub warnings: usize,
}

impl Lines {
    pub fn heading(&mut self, heading: String) {
        self.text += &heading;
        self.text.push('\n');
    }

    pub fn entry(&mut self, name: &str, value: impl AsRef<str>) {
        self.wrapped(name, value.as_ref());
    }

    pub fn warning(&mut self, warning: &str) {
        self.warnings += 1;
        self.wrapped("warning:", warning);
    }

    /// A table, set in.
    pub fn block(&mut self, block: &str) {
        for line in block.lines() {
            let _ = writeln!(self.text, "    {line}");
        }
    }

    /// Name and value in two columns, the value broken at spaces.
    fn wrapped(&mut self, name: &str, value: &str) {
        let mut line = format!("  {name:NAME_WIDTH$}");
        for word in value.split(' ') {
            if line.chars().count() + 1 + word.chars().count() > LINE_WIDTH {
                let _ = writeln!(self.text, "{line}");
                line = format!("  {:NAME_WIDTH$}", "");
            }
            line.push(' ');
            line += word;
        }
        let _ = writeln!(self.text, "{line}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_lists_are_broken_below_their_beginning() {
        let mut lines = Lines::default();
        lines.entry("channels", "a_rather_long_channel_name, ".repeat(8).trim_end());
        assert!(lines.text.lines().count() > 2);
        assert!(lines.text.lines().all(|line| line.chars().count() <= LINE_WIDTH));
        assert!(
            lines
                .text
                .lines()
                .skip(1)
                .all(|line| line.starts_with(&" ".repeat(NAME_WIDTH + 3)))
        );
    }
}
