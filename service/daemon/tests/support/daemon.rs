//! The daemon as a process.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use residual_shared::bounds_table::TableReader;
use residuald::summary::Summary;

use super::{Stage, wait_for};

/// The program.
pub fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_residuald"))
}

/// What a finished command said.
pub struct Finished {
    /// Exit code, none after a signal.
    pub code: Option<i32>,
    /// Standard output.
    pub output: String,
    /// Standard error with its line breaks and decorations reduced to spaces, so that phrases can be found.
    pub messages: String,
}

/// Runs a command to its end.
pub fn finish(command: &mut Command) -> Finished {
    let output = command.stdin(Stdio::null()).output().unwrap();
    Finished {
        code: output.status.code(),
        output: String::from_utf8_lossy(&output.stdout).into_owned(),
        messages: plain(&String::from_utf8_lossy(&output.stderr)),
    }
}

/// A report without the line breaks and bars that the terminal form puts in.
pub fn plain(text: &str) -> String {
    let without_bars = text.replace(['│', '×'], " ");
    without_bars.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// A running daemon, killed when dropped.
pub struct Daemon {
    child: Child,
    bounds: PathBuf,
    output: PathBuf,
    messages: PathBuf,
}

impl Daemon {
    /// Starts the daemon of a stage and waits for its table.
    pub fn start(stage: &Stage) -> Self {
        let mut daemon = Self::spawn(stage, &[]);
        daemon.wait_ready();
        daemon
    }

    /// Starts the daemon of a stage with more arguments.
    pub fn spawn(stage: &Stage, arguments: &[&str]) -> Self {
        let mut command = program();
        command.arg("run").arg(stage.configuration_file());
        command.args(["--summary", "json"]).args(arguments);
        Self::spawn_command(stage, &mut command)
    }

    /// Starts a daemon in another way.
    pub fn spawn_command(stage: &Stage, command: &mut Command) -> Self {
        let output = stage.files.path().join("stdout");
        let messages = stage.files.path().join("stderr");
        let child = command
            .stdin(Stdio::null())
            .stdout(File::create(&output).unwrap())
            .stderr(File::create(&messages).unwrap())
            .spawn()
            .unwrap();
        Self {
            child,
            bounds: stage.instance.bounds_path(),
            output,
            messages,
        }
    }

    /// Waits until the bounds table of this very process lies at its path.
    pub fn wait_ready(&mut self) -> TableReader {
        wait_for("the daemon's bounds table", || {
            let ended = self.child.try_wait().unwrap();
            assert!(ended.is_none(), "the daemon ended: {}", self.messages());
            let table = TableReader::open(&self.bounds).ok()?;
            (table.directory().pid == self.pid()).then_some(table)
        })
    }

    /// Process number.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }

    /// What it wrote to standard error so far.
    pub fn messages(&self) -> String {
        plain(&read(&self.messages))
    }

    /// What it wrote to standard output so far.
    pub fn output(&self) -> String {
        read(&self.output)
    }

    /// Whether it has not ended.
    pub fn is_alive(&mut self) -> bool {
        self.child.try_wait().unwrap().is_none()
    }

    /// Sends a signal.
    pub fn signal(&self, signal: Signal) {
        kill(Pid::from_raw(self.child.id().cast_signed()), signal).unwrap();
    }

    /// Kills it with SIGKILL and takes its corpse away.
    pub fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits for its end.
    pub fn wait(&mut self) -> ExitStatus {
        wait_for("the daemon's end", || self.child.try_wait().unwrap())
    }

    /// Stops it in good order; gives the summary, which must have been asked for in JSON.
    pub fn stop(mut self) -> Summary {
        self.signal(Signal::SIGTERM);
        let status = self.wait();
        assert_eq!(status.code(), Some(0), "{}", self.messages());
        serde_json::from_str(&self.output()).unwrap_or_else(|error| panic!("{error}: {}", self.output()))
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        if std::thread::panicking() {
            eprintln!("the daemon said: {}", read(&self.messages));
        }
    }
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_default()
}
