//! Starts publisher, daemon and client, waits for them, and judges what the client saw.

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::{Args, ValueEnum as _};
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::monotonic_ns;
use residual_shared::names::{DEFAULT_RUNTIME_DIRECTORY, Instance, InstanceName, InstanceNameError};

use super::client::ClientReport;
use super::plant::{Disturbance, FIRST_FAULTY_TRANSITION, PERIOD_NS};
use crate::summary::Summary;

/// The configuration that the demonstration runs: the same file that users start from.
const CONFIGURATION: &str = include_str!("../../../../deploy/config/vtol.toml");

/// The line of [`CONFIGURATION`] that names the instance, to be replaced by one of the demonstration's own.
const INSTANCE_KEY: &str = "instance = ";

/// How long the daemon may take to open its bounds table.
const START_LIMIT: Duration = Duration::from_secs(10);

/// From the decision to start a case until its first sample: time for two processes to start and connect.
const HEAD_START_NS: u64 = 500_000_000;

/// What `residuald demo` takes.
#[derive(Debug, Args)]
pub struct DemoArguments {
    /// The paper's case: 1 (actuator 1 fails), 2 (actuator 2 fails); without it both, one after the other.
    #[arg(long, value_parser = clap::value_parser!(u8).range(1..=2))]
    pub case: Option<u8>,
    /// Seed of the measurement noise and of random disturbances.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Disturbance on the aircraft.
    #[arg(long, value_enum, default_value = "sine")]
    pub disturbance: Disturbance,
}

/// Why the demonstration could not be shown, or did not show what it should.
#[derive(Debug, thiserror::Error)]
pub enum DemoError {
    /// A process could not be started or read.
    #[error("cannot {what}: {source}")]
    Process {
        /// What was tried.
        what: &'static str,
        /// The system's reason.
        source: io::Error,
    },
    /// A name for the demonstration's instance could not be made.
    #[error(transparent)]
    Instance(#[from] InstanceNameError),
    /// The daemon opened no bounds table.
    #[error("the daemon did not start within {} s; its messages stand above", START_LIMIT.as_secs())]
    NoDaemon,
    /// A process ended with a failure.
    #[error("the {0} failed; its messages stand above")]
    Failed(&'static str),
    /// A process reported something else than agreed.
    #[error("the {0} gave no report")]
    NoReport(&'static str),
    /// The right actuator was not isolated, or there were false alarms.
    #[error("case {0}: the demonstration did not show what it should")]
    Wrong(u8),
}

fn process(what: &'static str) -> impl Fn(io::Error) -> DemoError {
    move |source| DemoError::Process { what, source }
}

/// Shows the cases; an error if a wrong actuator was isolated or a false alarm occurred.
pub fn execute(arguments: &DemoArguments) -> Result<(), DemoError> {
    let cases = arguments.case.map_or(vec![1, 2], |case| vec![case]);
    for case in cases {
        let stage = Stage::open(case)?;
        let report = stage.perform(case, arguments)?;
        if !report {
            return Err(DemoError::Wrong(case));
        }
    }
    Ok(())
}

/// The daemon of one case; killed if the case ends before it is stopped in good order.
struct Stage {
    instance: Instance,
    program: PathBuf,
    daemon: Child,
}

impl Stage {
    fn open(case: u8) -> Result<Self, DemoError> {
        let name: InstanceName = format!("demo{case}-{}", std::process::id()).parse()?;
        let instance = Instance::new(name, DEFAULT_RUNTIME_DIRECTORY);
        let program = std::env::current_exe().map_err(process("find this program"))?;
        let mut daemon = Command::new(&program)
            .args(["run", "-", "--summary", "json"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .env("RESIDUALD_LOG", "warn")
            .spawn()
            .map_err(process("start the daemon"))?;
        let text = configuration(&instance.name);
        let written = daemon
            .stdin
            .take()
            .map_or(Ok(()), |mut input| input.write_all(text.as_bytes()));
        let stage = Self {
            instance,
            program,
            daemon,
        };
        written.map_err(process("hand the daemon its configuration"))?;
        Ok(stage)
    }

    /// Plays one case; true if it went as it should.
    fn perform(mut self, case: u8, arguments: &DemoArguments) -> Result<bool, DemoError> {
        let start_ns = self.wait_for_daemon()?;
        println!(
            "\n=== case {case}: actuator {case} fails at t = 1 s (seed {}, disturbance {}) ===",
            arguments.seed,
            arguments
                .disturbance
                .to_possible_value()
                .map_or_else(String::new, |v| v.get_name().into())
        );
        println!(
            "processes: daemon {}, then publisher and client",
            self.daemon.id()
        );
        let mut client = self.start("demo-client", start_ns, case, &[])?;
        let seed = arguments.seed.to_string();
        let disturbance = arguments.disturbance.to_possible_value();
        let disturbance = disturbance.as_ref().map_or("sine", |value| value.get_name());
        let publisher_arguments = ["--seed", &seed, "--disturbance", disturbance];
        let mut publisher = self.start("demo-publisher", start_ns, case, &publisher_arguments)?;

        let report = show_and_parse(&mut client)?;
        let published = publisher.wait().map_err(process("wait for the publisher"))?;
        let polled = client.wait().map_err(process("wait for the client"))?;
        let summary = self.stop_daemon()?;
        if !published.success() {
            return Err(DemoError::Failed("publisher"));
        }
        if !polled.success() {
            return Err(DemoError::Failed("client"));
        }
        Ok(judge(case, &report, &summary))
    }

    /// Waits for the bounds table of our daemon; returns the moment of the first sample.
    fn wait_for_daemon(&mut self) -> Result<u64, DemoError> {
        let begin = Instant::now();
        while begin.elapsed() < START_LIMIT {
            if let Ok(Some(_)) = self.daemon.try_wait() {
                return Err(DemoError::Failed("daemon"));
            }
            if let Ok(table) = TableReader::open(&self.instance.bounds_path()) {
                let epoch_ns = table.directory().spec.schedule_epoch_ns;
                let earliest_ns = monotonic_ns() + HEAD_START_NS;
                return Ok(epoch_ns + (earliest_ns - epoch_ns).div_ceil(PERIOD_NS) * PERIOD_NS);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Err(DemoError::NoDaemon)
    }

    fn start(
        &self,
        subcommand: &'static str,
        start_ns: u64,
        case: u8,
        more: &[&str],
    ) -> Result<Child, DemoError> {
        Command::new(&self.program)
            .arg(subcommand)
            .args(["--instance", &self.instance.name.to_string()])
            .arg("--runtime-directory")
            .arg(&self.instance.runtime_directory)
            .args(["--start-ns", &start_ns.to_string(), "--case", &case.to_string()])
            .args(more)
            .stdin(Stdio::null())
            .stdout(if subcommand == "demo-client" {
                Stdio::piped()
            } else {
                Stdio::inherit()
            })
            .spawn()
            .map_err(process("start a process of the demonstration"))
    }

    /// Stops the daemon in good order and reads its summary.
    fn stop_daemon(&mut self) -> Result<Summary, DemoError> {
        let pid = Pid::from_raw(self.daemon.id().cast_signed());
        kill(pid, Signal::SIGTERM).map_err(|error| process("stop the daemon")(error.into()))?;
        let mut text = String::new();
        if let Some(mut output) = self.daemon.stdout.take() {
            output
                .read_to_string(&mut text)
                .map_err(process("read the daemon's summary"))?;
        }
        let ended = self.daemon.wait().map_err(process("wait for the daemon"))?;
        if !ended.success() {
            return Err(DemoError::Failed("daemon"));
        }
        serde_json::from_str(&text).map_err(|_| DemoError::NoReport("daemon"))
    }
}

impl Drop for Stage {
    fn drop(&mut self) {
        // Does nothing to a daemon that has ended already.
        let _ = self.daemon.kill();
        let _ = self.daemon.wait();
        for path in [self.instance.bounds_path(), self.instance.lock_path()] {
            let _ = std::fs::remove_file(path);
        }
    }
}

/// The embedded configuration under another instance name.
fn configuration(instance: &InstanceName) -> String {
    let lines = CONFIGURATION.lines().map(|line| {
        if line.starts_with(INSTANCE_KEY) {
            format!("{INSTANCE_KEY}\"{instance}\"")
        } else {
            line.to_owned()
        }
    });
    lines.map(|line| line + "\n").collect()
}

/// Passes the client's lines on to the terminal; its last one is the report.
fn show_and_parse(client: &mut Child) -> Result<ClientReport, DemoError> {
    let output = client.stdout.take().ok_or(DemoError::NoReport("client"))?;
    let mut report = None;
    for line in BufReader::new(output).lines() {
        let line = line.map_err(process("read from the client"))?;
        match line.strip_prefix(ClientReport::PREFIX) {
            Some(json) => report = serde_json::from_str(json).ok(),
            None => println!("{line}"),
        }
    }
    report.ok_or(DemoError::NoReport("client"))
}

/// Prints the summary of a case; true if the right actuator, and nothing else, was found.
fn judge(case: u8, report: &ClientReport, summary: &Summary) -> bool {
    let faulty = usize::from(case - 1);
    let injected_s = FIRST_FAULTY_TRANSITION as f64 * PERIOD_NS as f64 * 1e-9;
    let at = |k: u64| format!("y({k}), t = {:.2} s", k as f64 * PERIOD_NS as f64 * 1e-9);
    println!("--- summary of case {case}");
    println!(
        "injected          actuator {case}, on transitions k >= {FIRST_FAULTY_TRANSITION} (t = {injected_s:.2} s)"
    );
    println!(
        "detected          {}",
        report
            .first_alarm
            .as_ref()
            .map_or("no".into(), |alarm| format!("{}, by {}", at(alarm.k), alarm.by))
    );
    println!(
        "isolated          {}",
        report.isolated.as_ref().map_or("no".into(), |found| format!(
            "{} ({}), at {}",
            found.names,
            actuator(found.actuators),
            at(found.k)
        ))
    );
    println!("false alarms      {}", report.false_alarms);
    println!(
        "records polled    {} ({} overwritten before they were read)",
        report.records, report.missed
    );
    println!(
        "steps             {}, instants skipped {}, overruns {}",
        summary.schedule_total("steps"),
        summary.schedule_total("skipped"),
        summary.schedule_total("overruns")
    );
    println!("step time         {}", summary.step_times);
    let right = report
        .isolated
        .as_ref()
        .is_some_and(|found| found.actuators == 1 << faulty);
    let good = right && report.false_alarms == 0;
    println!(
        "result            {}",
        if good { "as it should be" } else { "WRONG" }
    );
    good
}

fn actuator(set: u64) -> String {
    let numbers = (0..64)
        .filter(|bit| set >> bit & 1 == 1)
        .map(|bit| (bit + 1).to_string());
    format!("actuator {}", numbers.collect::<Vec<_>>().join("+"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_configuration_takes_another_instance_name() {
        let name: InstanceName = "other".parse().unwrap();
        let text = configuration(&name);
        assert_eq!(
            text.lines().filter(|line| line.starts_with(INSTANCE_KEY)).count(),
            1
        );
        assert!(text.contains("instance = \"other\""));
    }
}
