//! The processes of one show: the daemon, and those that play with it.

use std::io::{self, BufRead as _, BufReader, Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use clap::ValueEnum as _;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::monotonic_ns;
use residual_shared::names::{DEFAULT_RUNTIME_DIRECTORY, Instance};

use super::client::{self, Seen};
use super::composition::{Example, compose};
use super::conductor::DemoError;
use super::scenario::Variation;
use crate::summary::Summary;

/// How long the daemon may take to design its diagnosers and open its bounds table.
const START_LIMIT: Duration = Duration::from_secs(30);

/// From the decision to start until the first sample: time for two processes to start and connect.
const HEAD_START_NS: u64 = 500_000_000;

/// The plants start at a whole second of the daemon's time since its epoch: a sampling instant of every diagnoser
/// whose period divides a second.
const GRID_NS: u64 = 1_000_000_000;

fn process(what: &'static str) -> impl Fn(io::Error) -> DemoError {
    move |source| DemoError::Process { what, source }
}

/// The daemon of one show; killed if the show ends before it is stopped in good order.
pub struct Stage {
    instance: Instance,
    /// Until the daemon has read it.
    gains_file: Option<GainsOfShow>,
    program: PathBuf,
    daemon: Child,
}

impl Stage {
    /// Starts the daemon with all these configurations in one, its time at this speed.
    pub fn open(name: &str, examples: &[Example], speed: f64) -> Result<Self, DemoError> {
        let instance = Instance::new(name.parse()?, DEFAULT_RUNTIME_DIRECTORY);
        let file = Path::new(DEFAULT_RUNTIME_DIRECTORY).join(format!("residuald.{name}.gains.toml"));
        let composed = compose(examples, &instance.name, &file)?;
        let gains_file = GainsOfShow(file);
        std::fs::write(&gains_file.0, &composed.gains).map_err(process("write the gains of the show"))?;
        let program = std::env::current_exe().map_err(process("find this program"))?;
        let mut daemon = Command::new(&program)
            .args(["run", "-", "--summary", "json", "--speed", &speed.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .env(crate::logging::FILTER_VARIABLE, "warn")
            .spawn()
            .map_err(process("start the daemon"))?;
        let written = daemon.stdin.take().map_or(Ok(()), |mut input| {
            input.write_all(composed.configuration.as_bytes())
        });
        let stage = Self {
            instance,
            gains_file: Some(gains_file),
            program,
            daemon,
        };
        written.map_err(process("hand the daemon its configuration"))?;
        Ok(stage)
    }

    /// Plays the scenarios at the same time; what the client saw, and what the daemon did.
    pub fn perform(
        mut self,
        scenarios: &[&str],
        variation: &Variation,
    ) -> Result<(Vec<Seen>, Summary), DemoError> {
        let start_ns = self.wait_for_daemon()?;
        self.gains_file = None;
        println!(
            "processes: daemon {}, then publisher and client",
            self.daemon.id()
        );
        let mut client = self.start("demo-client", start_ns, scenarios, &[])?;
        let seed = variation.seed.to_string();
        let disturbance = variation.disturbance.to_possible_value();
        let disturbance = disturbance.as_ref().map_or("sine", |value| value.get_name());
        let more = ["--seed", &seed, "--disturbance", disturbance];
        let mut publisher = self.start("demo-publisher", start_ns, scenarios, &more)?;

        let seen = show_and_parse(&mut client)?;
        let published = publisher.wait().map_err(process("wait for the publisher"))?;
        let polled = client.wait().map_err(process("wait for the client"))?;
        let summary = self.stop_daemon()?;
        if !published.success() {
            return Err(DemoError::Failed("publisher"));
        }
        if !polled.success() {
            return Err(DemoError::Failed("client"));
        }
        Ok((seen, summary))
    }

    /// Waits for the bounds table of our daemon; returns the moment of the first sample, in the daemon's time.
    fn wait_for_daemon(&mut self) -> Result<u64, DemoError> {
        let begin = Instant::now();
        while begin.elapsed() < START_LIMIT {
            if let Ok(Some(_)) = self.daemon.try_wait() {
                return Err(DemoError::Failed("daemon"));
            }
            if let Ok(table) = TableReader::open(&self.instance.bounds_path()) {
                let spec = &table.directory().spec;
                let epoch_ns = spec.schedule_epoch_ns;
                let earliest_ns = spec.time.from_monotonic(monotonic_ns() + HEAD_START_NS);
                return Ok(epoch_ns + (earliest_ns - epoch_ns).div_ceil(GRID_NS) * GRID_NS);
            }
            std::thread::sleep(Duration::from_millis(10));
        }
        Err(DemoError::NoDaemon)
    }

    fn start(
        &self,
        subcommand: &'static str,
        start_ns: u64,
        scenarios: &[&str],
        more: &[&str],
    ) -> Result<Child, DemoError> {
        Command::new(&self.program)
            .arg(subcommand)
            .args(["--instance", &self.instance.name.to_string()])
            .arg("--runtime-directory")
            .arg(&self.instance.runtime_directory)
            .args(["--start-ns", &start_ns.to_string()])
            .args(scenarios.iter().flat_map(|name| ["--scenario", name]))
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

/// The gains file of a show; disappears when it is dropped.
struct GainsOfShow(PathBuf);

impl Drop for GainsOfShow {
    fn drop(&mut self) {
        let _ = std::fs::remove_file(&self.0);
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

/// Passes the client's lines on to the terminal; its last one is the report.
fn show_and_parse(client: &mut Child) -> Result<Vec<Seen>, DemoError> {
    let output = client.stdout.take().ok_or(DemoError::NoReport("client"))?;
    let mut report = None;
    for line in BufReader::new(output).lines() {
        let line = line.map_err(process("read from the client"))?;
        match line.strip_prefix(client::REPORT) {
            Some(json) => report = serde_json::from_str(json).ok(),
            None => println!("{line}"),
        }
    }
    report.ok_or(DemoError::NoReport("client"))
}
