//! The arrows between the crates point downwards only.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::process::Command;

use serde_json::Value;

/// Each crate of the workspace and those it may use.
const ALLOWED: [(&str, &[&str]); 10] = [
    ("residual-shared", &[]),
    ("residual-diagnosis", &["residual-shared"]),
    ("residual-synthesis", &["residual-diagnosis", "residual-shared"]),
    ("residual-client", &["residual-shared"]),
    ("residual-client-c", &["residual-client"]),
    ("residual-recording", &["residual-client", "residual-shared"]),
    ("residual-chart", &[]),
    (
        "residual-cli",
        &[
            "residual-recording",
            "residual-chart",
            "residual-client",
            "residual-shared",
        ],
    ),
    (
        "residuald",
        // The demonstration plays a client, a replay reads recordings, `design --plot` draws.
        &[
            "residual-synthesis",
            "residual-diagnosis",
            "residual-shared",
            "residual-client",
            "residual-recording",
            "residual-chart",
        ],
    ),
    (
        "residual-benches",
        &[
            "residuald",
            "residual-synthesis",
            "residual-diagnosis",
            "residual-shared",
            "residual-client",
            "residual-recording",
            "residual-chart",
        ],
    ),
];

fn cargo(arguments: &[&str]) -> String {
    let output = Command::new(env!("CARGO"))
        .args(arguments)
        .arg("--offline")
        .current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
        .output()
        .unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "cargo {arguments:?}: {messages}");
    String::from_utf8(output.stdout).unwrap()
}

/// The crates of the workspace with the crates of the workspace that each uses (in tests, too, where `dev`).
fn arrows(dev: bool) -> BTreeMap<String, BTreeSet<String>> {
    let metadata: Value =
        serde_json::from_str(&cargo(&["metadata", "--no-deps", "--format-version", "1"])).unwrap();
    let packages = metadata["packages"].as_array().unwrap();
    let name = |value: &Value| value["name"].as_str().unwrap().to_owned();
    let members: BTreeSet<String> = packages.iter().map(name).collect();
    let uses = |package: &Value| {
        let dependencies = package["dependencies"].as_array().unwrap().iter();
        dependencies
            .filter(|dependency| dev || dependency["kind"] != "dev")
            .map(name)
            .filter(|used| members.contains(used))
            .collect()
    };
    packages
        .iter()
        .map(|package| (name(package), uses(package)))
        .collect()
}

#[test]
fn every_crate_uses_only_those_below_it() {
    let allowed: HashMap<_, _> = ALLOWED.into_iter().collect();
    let arrows = arrows(false);
    assert!(arrows.contains_key("residuald"), "the workspace was not read");
    for (package, uses) in &arrows {
        let may = allowed.get(package.as_str()).unwrap_or_else(|| {
            panic!("`{package}` is new: give it its place in this test and in the architecture")
        });
        for used in uses {
            assert!(
                may.contains(&used.as_str()),
                "`{package}` uses `{used}`, which lies above it"
            );
        }
    }
}

#[test]
fn tests_of_the_lower_crates_need_nothing_from_above() {
    let arrows = arrows(true);
    for (package, forbidden) in [
        ("residual-shared", ["residuald", "residual-client"]),
        ("residual-diagnosis", ["residuald", "residual-client"]),
        ("residual-client", ["residuald", "residual-diagnosis"]),
    ] {
        for name in forbidden {
            assert!(
                !arrows[package].contains(name),
                "tests of `{package}` use `{name}`"
            );
        }
    }
}

#[test]
fn the_daemon_without_synthesis_holds_no_solver() {
    let tree = |features: &[&str]| {
        let arguments = ["tree", "-p", "residuald", "-e", "normal", "--prefix", "none"];
        cargo(&[&arguments[..], features].concat())
    };
    let (complete, vehicle) = (tree(&[]), tree(&["--no-default-features"]));
    for solver in ["clarabel", "residual-synthesis"] {
        assert!(complete.contains(solver), "{complete}");
        assert!(
            !vehicle.contains(solver),
            "`{solver}` without the feature:\n{vehicle}"
        );
    }
}

#[test]
fn mathematics_and_clients_are_built_without_iceoryx2() {
    for package in ["residual-diagnosis", "residual-client", "residual-client-c"] {
        let tree = cargo(&["tree", "-p", package, "-e", "normal", "--prefix", "none"]);
        assert!(tree.contains("residual-shared"), "{tree}");
        assert!(!tree.contains("iceoryx2"), "`{package}` pulls iceoryx2:\n{tree}");
    }
}
