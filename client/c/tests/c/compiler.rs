//! The library for C and the system's compiler.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use tempfile::TempDir;

/// How a program takes the library.
#[derive(Clone, Copy)]
pub enum Linked {
    Dynamically,
    Statically,
}

/// The folder of the package.
fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Where cargo puts libraries: the tests lie one folder below. Cargo makes a library that no Rust program can use only
/// when it is asked to.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let test = std::env::current_exe().unwrap();
        let directory = test.ancestors().nth(2).unwrap();
        let profile = match directory.file_name().unwrap().to_str().unwrap() {
            "debug" => "dev",
            other => other,
        };
        let status = Command::new(env!("CARGO"))
            .args([
                "build",
                "--offline",
                "--quiet",
                "--profile",
                profile,
                "--target-dir",
            ])
            .arg(directory.parent().unwrap())
            .current_dir(package())
            .status()
            .unwrap();
        assert!(status.success());
        directory.into()
    })
}

/// Whether there is this compiler; says it where there is none.
fn exists(compiler: &str) -> bool {
    let mut command = Command::new(compiler);
    command
        .arg("--version")
        .stdout(Stdio::null())
        .stderr(Stdio::null());
    let exists = command.status().is_ok_and(|status| status.success());
    if !exists {
        eprintln!("SKIPPED: there is no `{compiler}`; the C interface was not tested with it");
    }
    exists
}

fn run(command: &mut Command) {
    let output = command.output().unwrap();
    let messages = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{command:?}: {messages}");
}

/// Compiles a file of the package into a folder; none where there is no compiler.
pub fn compile(source: &str, linked: Linked, folder: &TempDir) -> Option<PathBuf> {
    if !exists("cc") {
        return None;
    }
    let program = folder.path().join("program");
    let mut command = Command::new("cc");
    command
        .args(["-std=c11", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-I"])
        .arg(package().join("include"))
        .arg(package().join(source))
        .arg("-o")
        .arg(&program);
    match linked {
        Linked::Dynamically => command
            .arg("-L")
            .arg(library())
            .arg("-lresidual_client")
            .arg(format!("-Wl,-rpath,{}", library().display())),
        Linked::Statically => {
            command
                .arg(library().join("libresidual_client.a"))
                .args(["-lpthread", "-ldl", "-lm"])
        }
    };
    run(&mut command);
    Some(program)
}

#[test]
fn the_header_is_good_for_cpp() {
    if exists("c++") {
        let header = package().join("include/residual_client.h");
        run(Command::new("c++")
            .args([
                "-std=c++17",
                "-Wall",
                "-Wextra",
                "-Werror",
                "-fsyntax-only",
                "-x",
                "c++",
            ])
            .arg(header));
    }
}
