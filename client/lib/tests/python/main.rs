//! The Python client: its layout constants, and what it reads of a table that Rust wrote.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../support/mod.rs"]
mod support;

#[path = "../support/dump.rs"]
mod dump;

#[path = "../support/front_page.rs"]
mod front_page;

#[path = "../support/scenes.rs"]
mod scenes;

mod command_line;
mod layout;
mod reading;

use std::path::PathBuf;
use std::process::Command;

/// The folder of the package.
fn package() -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../python"))
}

/// Python with the package on its path; none, with a note, where there is no Python.
fn python() -> Option<Command> {
    let program = std::env::var("RESIDUAL_PYTHON").unwrap_or_else(|_| "python3".into());
    let works = Command::new(&program)
        .args(["-c", "import sys; assert sys.version_info >= (3, 9)"])
        .status()
        .is_ok_and(|status| status.success());
    if !works {
        eprintln!("SKIPPED: `{program}` is no Python of 3.9 or later; the Python client was not tested");
        return None;
    }
    let mut python = Command::new(program);
    python
        .env("PYTHONPATH", package())
        .env("PYTHONDONTWRITEBYTECODE", "1");
    Some(python)
}
