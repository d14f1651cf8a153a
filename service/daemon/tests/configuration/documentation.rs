//! Every key of a configuration is documented, and every documented key stands in the example of its method.

use crate::common::{mistakes_of, repository};

/// A method's document and its complete example, both in `deploy/config`.
const METHODS: [(&str, &str); 5] = [
    ("unknown_input_filter.md", "vtol.toml"),
    ("reduced_order_observer.md", "servo.toml"),
    ("async_imm.md", "turning_target.toml"),
    ("chi_square.md", "vehicle.toml"),
    ("hinf_filter.md", "two_state.toml"),
];

fn read(name: &str) -> String {
    std::fs::read_to_string(repository("deploy/config").join(name)).unwrap()
}

/// The headers of an example: `[daemon]`, `[[input]]`, `[diagnoser.model]`, ..., each once.
fn headers(example: &str) -> Vec<&str> {
    let lines = example.lines().filter(|line| line.starts_with('['));
    let mut headers: Vec<_> = lines
        .map(|line| line.split(" #").next().unwrap().trim())
        .collect();
    headers.sort_unstable();
    headers.dedup();
    headers
}

/// The chapters about a section in all documents that have one.
fn chapters(header: &str, documents: [&str; 2]) -> String {
    let headings = [format!("\n## `{header}`"), format!("\n`{header}`:")];
    let of_document = |document: &&str| {
        let found = headings
            .iter()
            .find_map(|heading| document.split_once(heading.as_str()))?;
        Some(found.1.split("\n## ").next().unwrap().to_owned())
    };
    let found: Vec<_> = documents.iter().filter_map(of_document).collect();
    assert!(!found.is_empty(), "{header} has no chapter");
    found.join("\n")
}

#[test]
fn every_key_is_documented_in_the_table_of_its_section() {
    let common = read("README.md");
    for (document, example) in METHODS {
        let (document, example) = (read(document), read(example));
        for header in headers(&example) {
            // The refusal of an unknown key lists the known ones.
            let text = example.replacen(
                &format!("\n{header}"),
                &format!("\n{header}\nno_such_key = 1\n#"),
                1,
            );
            let mistakes = mistakes_of(&text);
            let refusal = mistakes
                .iter()
                .find(|mistake| mistake.message.contains("no_such_key"));
            let help = refusal.unwrap().help.as_deref().unwrap();
            let known = help.split_once("known keys: ").unwrap().1;
            let chapter = chapters(header, [&common, &document]);
            for key in known.split(", ") {
                let name = key.trim_matches('`');
                let is_table = ["[diagnoser.", "[[diagnoser."].iter().any(|begin| {
                    let heading = format!("## `{begin}{name}]");
                    header == "[[diagnoser]]" && document.contains(&heading)
                });
                let is_row = chapter.lines().any(|line| {
                    let cell = line.strip_prefix("| ").and_then(|line| line.split(" | ").next());
                    cell.is_some_and(|cell| cell.contains(key))
                });
                assert!(is_row || is_table, "{key} of {header} is not documented");
            }
        }
    }
}

#[test]
fn every_documented_key_stands_in_the_example_of_its_method() {
    let common = read("README.md");
    for (document, name) in METHODS {
        let (document, example) = (read(document), read(name));
        let own = document.lines();
        // One example shows the keys that all methods share; structure files have examples of their own.
        let configuration = common.split("\n## Identify").next().unwrap();
        let shared = configuration.lines().filter(|_| name == "vtol.toml");
        let cells = own
            .chain(shared)
            .filter_map(|line| line.strip_prefix("| `")?.split(" | ").next());
        // A cell in quotation marks is a value, not a key.
        let keys = cells
            .flat_map(|cell| cell.split(", "))
            .map(|key| key.trim_matches('`'));
        for key in keys.filter(|key| !key.starts_with('"')) {
            let mentioned = example.lines().any(|line| {
                let line = line.trim_start_matches("# ");
                let tables = [
                    format!("[[replay.{key}]]"),
                    format!("[[diagnoser.{key}]]"),
                    format!("[diagnoser.{key}]"),
                    format!("[[diagnoser.lifecycle.{key}]]"),
                ];
                line.starts_with(&format!("{key} =")) || tables.iter().any(|table| line.starts_with(table))
            });
            let is_method = METHODS
                .iter()
                .any(|(document, _)| *document == format!("{key}.md"));
            assert!(mentioned || is_method, "`{key}` is missing in {name}");
        }
    }
}
