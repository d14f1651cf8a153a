//! TOML for people: a matrix row by row, a list of small tables line by line, numbers with the fewest digits that
//! give them back.

use toml::{Table, Value};

/// The table as the text of a file.
pub(super) fn text(table: &Table) -> String {
    let mut text = String::new();
    section(&mut text, "", table);
    text
}

/// What a list looks like.
enum Form {
    /// `[1.0, 2.0]`
    Line,
    /// An entry a line, in brackets.
    Rows,
    /// A section `[[…]]` an entry.
    Sections,
}

fn form(entries: &[Value]) -> Form {
    let is_flat = |value: &Value| match value {
        Value::Table(_) => false,
        Value::Array(entries) => !entries.iter().any(|entry| entry.is_array() || entry.is_table()),
        _ => true,
    };
    let tables: Vec<&Table> = entries.iter().filter_map(Value::as_table).collect();
    if entries.is_empty() || entries.iter().all(|entry| entry.is_integer() || entry.is_float()) {
        Form::Line
    } else if tables.len() < entries.len() || tables.iter().all(|table| table.values().all(is_flat)) {
        Form::Rows
    } else {
        Form::Sections
    }
}

/// The values of a table, then its sections.
fn section(text: &mut String, path: &str, table: &Table) {
    let is_section = |value: &Value| match value {
        Value::Table(_) => true,
        Value::Array(entries) => matches!(form(entries), Form::Sections),
        _ => false,
    };
    for (name, value) in table.iter().filter(|(_, value)| !is_section(value)) {
        *text += &key(name);
        *text += " = ";
        self::value(text, value, 0);
        text.push('\n');
    }
    for (name, value) in table.iter().filter(|(_, value)| is_section(value)) {
        let path = match path {
            "" => key(name),
            _ => format!("{path}.{}", key(name)),
        };
        match value {
            Value::Table(inner) => {
                *text += &format!("\n[{path}]\n");
                section(text, &path, inner);
            }
            _ => {
                for inner in value.as_array().into_iter().flatten().filter_map(Value::as_table) {
                    *text += &format!("\n[[{path}]]\n");
                    section(text, &path, inner);
                }
            }
        }
    }
}

fn value(text: &mut String, value: &Value, depth: usize) {
    match value {
        Value::Float(number) if number.is_finite() => *text += &format!("{number:?}"),
        Value::Array(entries) if matches!(form(entries), Form::Line) => {
            text.push('[');
            for (index, entry) in entries.iter().enumerate() {
                *text += if index == 0 { "" } else { ", " };
                self::value(text, entry, depth);
            }
            text.push(']');
        }
        Value::Array(entries) => {
            *text += "[\n";
            for entry in entries {
                *text += &"    ".repeat(depth + 1);
                self::value(text, entry, depth + 1);
                *text += ",\n";
            }
            *text += &"    ".repeat(depth);
            text.push(']');
        }
        Value::Table(entries) => {
            *text += "{ ";
            for (index, (name, entry)) in entries.iter().enumerate() {
                *text += if index == 0 { "" } else { ", " };
                *text += &key(name);
                *text += " = ";
                self::value(text, entry, depth);
            }
            *text += " }";
        }
        other => *text += &other.to_string(),
    }
}

/// A key, in quotes where it needs them.
fn key(name: &str) -> String {
    let is_bare = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == '-';
    if !name.is_empty() && name.chars().all(is_bare) {
        name.to_owned()
    } else {
        Value::from(name).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"version = 1
list = []
thresholds = [0.1, 1e-300, -0.0]
L = [
    [0.30000000000000004, 1.0],
    [1.7976931348623157e308, 5e-324],
]
mu = [
    [
        [1.0],
        [2.0],
    ],
]
"no \"bare\" key" = "a\nb"
norms = [
    { name = "a", value = 1.0 },
    { name = "b", value = 2.0, signs = [1, -1] },
]

[gains.main]
K = 1.0

[[fault]]
name = "x"
delays = [
    { within_s = 1.0, size = 2.0 },
]
"#;

    #[test]
    fn a_table_is_written_as_people_would_and_read_back_to_the_last_bit() {
        let table: Table = TEXT.parse().unwrap();
        let written = text(&table);
        let again: Table = written.parse().unwrap();
        assert_eq!(again, table, "{written}");
        for line in [
            "    [1.7976931348623157e308, 5e-324],",
            "thresholds = [0.1, 1e-300, -0.0]",
            "    { name = \"a\", value = 1.0 },",
            "[[fault]]",
            "    { within_s = 1.0, size = 2.0 },",
        ] {
            assert!(written.lines().any(|other| other == line), "{line}\n{written}");
        }
    }

    #[test]
    fn numbers_come_back_with_all_their_bits() {
        let mut state = 0x9e37_79b9_7f4a_7c15_u64;
        for _ in 0..20_000 {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            let number = f64::from_bits(state);
            if number.is_finite() {
                let table = Table::from_iter([("x".to_owned(), Value::Float(number))]);
                let again: Table = text(&table).parse().unwrap();
                assert_eq!(again["x"].as_float().unwrap().to_bits(), number.to_bits());
            }
        }
    }
}
