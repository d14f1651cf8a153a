//! Without features the library pulls in little.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::BTreeSet;
use std::process::Command;

/// Names of all crates that the library needs, itself included.
fn crates(features: &[&str]) -> BTreeSet<String> {
    let output = Command::new(env!("CARGO"))
        .args([
            "tree",
            "-p",
            "residual-client",
            "-e",
            "normal",
            "--prefix",
            "none",
            "--offline",
        ])
        .args(features)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let tree = String::from_utf8(output.stdout).unwrap();
    tree.lines()
        .filter_map(|line| line.split(' ').next())
        .map(String::from)
        .collect()
}

#[test]
fn without_features_it_needs_few_crates_and_neither_iceoryx2_nor_serde() {
    let crates = crates(&[]);
    assert!(crates.contains("residual-shared"), "{crates:?}");
    // Eight at run time, the others are the macros of thiserror.
    assert!(crates.len() <= 15, "{}: {crates:?}", crates.len());
    for name in &crates {
        assert!(
            !name.starts_with("iceoryx2") && !name.starts_with("serde"),
            "{name}"
        );
    }
}

#[test]
fn the_feature_transport_adds_iceoryx2() {
    assert!(crates(&["--features", "transport"]).contains("iceoryx2"));
}
