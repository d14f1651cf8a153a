//! Other processes of this program: publishers, daemons, readers.
//!
//! Each role is a hidden subcommand. The process tells what it has measured as lines on its standard output and ends
//! when its standard input is closed, so that none is left behind.

use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Lines, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// A running process of this program; killed when dropped.
#[derive(Debug)]
pub struct Process {
    name: String,
    child: Child,
    input: Option<ChildStdin>,
    lines: Lines<BufReader<ChildStdout>>,
}

impl Process {
    /// Starts this program with `arguments`.
    ///
    /// # Errors
    /// The process cannot be started.
    pub fn start(arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Result<Self> {
        let program = std::env::current_exe().context("this program's own path")?;
        let mut command = Command::new(program);
        command.args(arguments);
        Self::start_command(command)
    }

    /// Starts another program.
    ///
    /// # Errors
    /// The process cannot be started.
    pub fn start_command(mut command: Command) -> Result<Self> {
        let name = format!("{command:?}");
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command
            .spawn()
            .with_context(|| format!("{name} does not start"))?;
        let (input, output) = (child.stdin.take(), child.stdout.take());
        let lines = BufReader::new(output.context("no standard output")?).lines();
        Ok(Self {
            name,
            child,
            input,
            lines,
        })
    }

    /// Its process number.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has ended.
    ///
    /// # Errors
    /// The system does not tell.
    pub fn has_ended(&mut self) -> Result<bool> {
        Ok(self.child.try_wait()?.is_some())
    }

    /// Its next line; waits for it.
    ///
    /// # Errors
    /// It ended without one.
    pub fn line(&mut self) -> Result<String> {
        match self.lines.next() {
            Some(line) => Ok(line?),
            None => bail!(
                "{} ended without saying what was expected ({})",
                self.name,
                self.child.wait()?
            ),
        }
    }

    /// Its next line, as JSON.
    ///
    /// # Errors
    /// It ended without one, or the line is something else.
    pub fn said<T: DeserializeOwned>(&mut self) -> Result<T> {
        let line = self.line()?;
        serde_json::from_str(&line).with_context(|| format!("{} said: {line}", self.name))
    }

    /// Writes a line to its standard input.
    ///
    /// # Errors
    /// It has ended, or was asked to.
    pub fn tell(&mut self, line: &str) -> Result<()> {
        let input = self.input.as_mut().context("it was asked to end")?;
        writeln!(input, "{line}")
            .and_then(|()| input.flush())
            .with_context(|| format!("{} has ended", self.name))
    }

    /// Closes its standard input, which asks it to end.
    pub fn ask_to_end(&mut self) {
        self.input = None;
    }

    /// Asks it to end and waits until it has.
    ///
    /// # Errors
    /// It failed.
    pub fn end(mut self) -> Result<()> {
        self.ask_to_end();
        let status = self.child.wait()?;
        if !status.success() {
            bail!("{} ended with {status}", self.name);
        }
        Ok(())
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // Both fail if it has ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// In a started process: waits until the other side asks to end.
pub fn wait_until_asked_to_end() {
    let mut line = String::new();
    while std::io::stdin()
        .lock()
        .read_line(&mut line)
        .is_ok_and(|bytes| bytes > 0)
    {
        line.clear();
    }
}

/// In a started process that has no time to wait: a flag that is set when the other side asks to end.
pub fn asked_to_end() -> Arc<AtomicBool> {
    let asked = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&asked);
    std::thread::spawn(move || {
        wait_until_asked_to_end();
        flag.store(true, Ordering::Release);
    });
    asked
}

/// In a started process: tells the other side what it measured, as [`Process::said`] expects it.
///
/// # Errors
/// It cannot be written as JSON.
pub fn say(what: &impl Serialize) -> Result<()> {
    println!("{}", serde_json::to_string(what)?);
    Ok(())
}
