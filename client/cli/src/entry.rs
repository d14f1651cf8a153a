//! An entry of a report: name and value in two columns.

use std::io::{self, Write};

/// Width of the column of names.
const NAME_WIDTH: usize = 20;

/// Width of the report.
const LINE_WIDTH: usize = 110;

/// Writes an entry, its value broken at spaces.
pub fn write(output: &mut impl Write, name: &str, value: &str) -> io::Result<()> {
    let mut line = format!("{name:<NAME_WIDTH$}");
    for word in value.split(' ') {
        if line.chars().count() + 1 + word.chars().count() > LINE_WIDTH {
            writeln!(output, "{line}")?;
            line = " ".repeat(NAME_WIDTH);
        }
        line.push(' ');
        line += word;
    }
    writeln!(output, "{line}")
}

#[cfg(test)]
mod tests {
    #[test]
    fn a_long_value_is_broken_below_its_beginning() {
        let mut report = Vec::new();
        super::write(
            &mut report,
            "channels",
            "a_rather_long_name [m/s], ".repeat(9).trim_end(),
        )
        .unwrap();
        let report = String::from_utf8(report).unwrap();
        assert!(
            report.starts_with("channels             a_rather_long_name [m/s], "),
            "{report}"
        );
        assert!(
            report.lines().count() > 2 && report.lines().all(|line| line.chars().count() <= 110),
            "{report}"
        );
        assert!(
            report
                .lines()
                .skip(1)
                .all(|line| line.starts_with(&" ".repeat(21))),
            "{report}"
        );
    }
}
