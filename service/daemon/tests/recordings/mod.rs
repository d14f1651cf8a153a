//! Recordings of real vehicles. They are not part of the project: without them the tests say so and pass.
#![allow(dead_code)] // Not every test file needs every helper.

use std::path::PathBuf;
use std::process::Command;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// A recording and the configuration of `deploy/config` that replays it.
pub struct Recording {
    configuration: PathBuf,
    recording: PathBuf,
}

impl Recording {
    /// The recording, or none with a note.
    pub fn find(recording: &str, configuration: &str) -> Option<Self> {
        let folder = std::env::var_os("RESIDUALD_RECORDINGS")
            .map_or_else(|| root().join("../shared/data"), PathBuf::from);
        let recording = folder.join(recording);
        if !recording.exists() {
            println!(
                "SKIPPED: there is no {}; name its folder in RESIDUALD_RECORDINGS",
                recording.display()
            );
            return None;
        }
        Some(Self {
            configuration: root().join("deploy/config").join(configuration),
            recording,
        })
    }

    /// Where it is.
    pub fn path(&self) -> &std::path::Path {
        &self.recording
    }

    /// Replays it; gives what was printed.
    pub fn replay(&self, options: &[&str]) -> String {
        let output = Command::new(env!("CARGO_BIN_EXE_residuald"))
            .arg("replay")
            .args([&self.configuration, &self.recording])
            .args(options)
            .output()
            .unwrap();
        assert!(
            output.status.success(),
            "{}",
            String::from_utf8_lossy(&output.stderr)
        );
        String::from_utf8(output.stdout).unwrap()
    }

    /// Replays it; gives the table of what was detected.
    pub fn table(&self, options: &[&str]) -> serde_json::Value {
        let printed = self.replay(&[&["--table=json"], options].concat());
        serde_json::from_str(&printed).unwrap()
    }
}
