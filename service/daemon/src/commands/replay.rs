//! `residuald replay`: a recording instead of sensors.

use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::Diagnostic;
use residual_diagnosis::diagnoser::Description;
use residual_shared::record::StepRecord;

use crate::configuration::{Configuration, ConfigurationError, Loaded};
use crate::replay::injection::{Fault, FaultError};
use crate::replay::mapping::{Mapping, MappingError, TimedSample};
use crate::replay::outcome::{Outcome, median};
use crate::replay::recording::{Recording, RecordingError, Run, RunSelection};
use crate::replay::records::{RecordWriter, ReplayRecord, WriteError};
use crate::replay::through_daemon::ThroughDaemonError;
use crate::replay::{simulated, through_daemon};
use crate::runtime::companion::fault_names;

/// What `residuald replay` takes.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// Configuration with a `[replay]` section.
    pub configuration: PathBuf,
    /// The recording: CSV with a header line.
    pub recording: PathBuf,
    /// Publish over iceoryx2 to the running daemon of this configuration's instance, at the recorded pace.
    #[arg(long)]
    pub through_daemon: bool,
    /// Pace of a replay through the daemon, which must run at the same speed (`residuald run --speed`).
    #[arg(long, default_value_t = 1.0, requires = "through_daemon")]
    pub speed: f64,
    /// Runs to replay: all, odd, even (by position), or names separated by commas.
    #[arg(long, default_value = "all")]
    pub runs: RunSelection,
    /// Fault to write into the recording, e.g. `offset,column=steer_cmd,size=0.05,onset=50%`; kinds: offset,
    /// scale, freeze, dropout, spike. May be given several times; detection counts from the first one.
    #[arg(long = "fault", value_name = "FAULT")]
    pub faults: Vec<Fault>,
    /// Write every record to this CSV file (one file per diagnoser when there are several).
    #[arg(long)]
    pub records: Option<PathBuf>,
    /// Leave out the line of each run; print the totals only.
    #[arg(long)]
    pub totals: bool,
}

/// Why a replay failed.
#[derive(Debug, thiserror::Error, Diagnostic)]
pub enum ReplayError {
    /// The configuration is wrong.
    #[error(transparent)]
    #[diagnostic(transparent)]
    Configuration(#[from] ConfigurationError),
    /// The configuration has no `[replay]` section.
    #[error("`{0}` has no [replay] section: say there which columns feed which input")]
    NoReplaySection(PathBuf),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recording does not fit the `[replay]` section.
    #[error(transparent)]
    Mapping(#[from] MappingError),
    /// A fault cannot be injected.
    #[error(transparent)]
    Fault(#[from] FaultError),
    /// No run was selected.
    #[error("no run is selected; the recording has the runs: {0}")]
    NoRun(String),
    /// A daemon cannot be reset between runs.
    #[error(
        "{0} runs are selected, but a replay through the daemon takes one at a time; choose it with --runs NAME"
    )]
    SeveralRuns(usize),
    /// The daemon could not be fed.
    #[error(transparent)]
    Daemon(#[from] ThroughDaemonError),
    /// Records cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The recorder missed records.
    #[error("{0} records were lost on the way from the daemon; the written records are incomplete")]
    Lost(u64),
}

/// A recording with its configuration, ready to be replayed.
pub struct Replay {
    /// The configuration with its diagnosers' recipes.
    pub loaded: Loaded,
    recording: Recording,
    mapping: Mapping,
}

impl Replay {
    /// Loads both files; keeps the selected runs and writes the faults into them.
    pub fn load(
        configuration: &Path,
        recording: &Path,
        runs: &RunSelection,
        faults: &[Fault],
    ) -> Result<Self, ReplayError> {
        let loaded = Configuration::from_file(configuration)?;
        let replay = loaded
            .configuration
            .replay
            .as_ref()
            .ok_or_else(|| ReplayError::NoReplaySection(configuration.to_path_buf()))?;
        let mut recording = Recording::read(recording, &replay.time_column, replay.run_column.as_deref())?;
        let names = recording
            .runs
            .iter()
            .map(|run| run.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        let mut position = 0;
        recording.runs.retain(|run| {
            position += 1;
            runs.takes(position - 1, &run.name)
        });
        if recording.runs.is_empty() {
            return Err(ReplayError::NoRun(names));
        }
        for fault in faults {
            fault.inject(&mut recording)?;
        }
        let mapping = Mapping::new(&loaded.configuration, replay, &recording)?;
        Ok(Self {
            loaded,
            recording,
            mapping,
        })
    }

    /// The selected runs.
    pub fn runs(&self) -> &[Run] {
        &self.recording.runs
    }

    /// The samples of one run, in time order.
    pub fn samples(&self, run: &Run) -> Vec<TimedSample> {
        self.mapping.samples(run)
    }

    /// Replays one run in this process; `take` gets every record.
    pub fn simulate(&self, run: &Run, take: impl FnMut(ReplayRecord)) -> Result<(), ReplayError> {
        let diagnosers = self.loaded.build_diagnosers()?;
        simulated::replay(
            &self.loaded.configuration,
            diagnosers,
            &self.mapping.samples(run),
            take,
        );
        Ok(())
    }
}

/// Executes the command; the report goes to standard output.
pub fn execute(arguments: &ReplayArguments) -> Result<(), ReplayError> {
    let replay = Replay::load(
        &arguments.configuration,
        &arguments.recording,
        &arguments.runs,
        &arguments.faults,
    )?;
    if arguments.through_daemon && replay.runs().len() > 1 {
        return Err(ReplayError::SeveralRuns(replay.runs().len()));
    }
    let configuration = &replay.loaded.configuration;
    let descriptions: Vec<(String, Description)> = configuration
        .diagnosers
        .iter()
        .zip(replay.loaded.build_diagnosers()?)
        .map(|(configured, built)| (configured.name.clone(), built.diagnoser.description().clone()))
        .collect();
    let mut writer = arguments
        .records
        .as_deref()
        .map(|path| RecordWriter::create(path, &descriptions))
        .transpose()?;

    let mut report = Report::new(descriptions, !arguments.totals);
    let samples = replay.runs().iter().map(|run| run.rows.len() as u64).sum();
    let bar = ProgressBar::new(samples).with_style(progress_style());
    for run in replay.runs() {
        let onset_ns = arguments.faults.iter().map(|fault| fault.onset_ns(run)).min();
        report.begin(run, onset_ns);
        let mut failed = None;
        let take = |replayed: ReplayRecord| {
            report.take(replayed.slot, &replayed.record);
            if let (Some(writer), None) = (&mut writer, &failed) {
                failed = writer.write(&run.name, &replayed).err();
            }
        };
        if arguments.through_daemon {
            let samples = replay.samples(run);
            let done = |sent| bar.set_position(sent);
            let instance = configuration.daemon.instance();
            bar.set_length(samples.len() as u64);
            let lost =
                through_daemon::replay(configuration, &instance, arguments.speed, &samples, take, done)?;
            if lost > 0 {
                return Err(ReplayError::Lost(lost));
            }
        } else {
            replay.simulate(run, take)?;
            bar.inc(run.rows.len() as u64);
        }
        if let Some(error) = failed {
            return Err(error.into());
        }
        bar.suspend(|| report.end());
    }
    bar.finish_and_clear();
    report.totals();
    writer.map_or(Ok(()), RecordWriter::finish)?;
    Ok(())
}

/// A bar with counts, times and a message.
pub(super) fn progress_style() -> ProgressStyle {
    let template = "{wide_bar} {pos}/{len} {elapsed} (eta {eta}) {msg}";
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}

/// Prints what each run and all runs together showed.
struct Report {
    diagnosers: Vec<(String, Description)>,
    each_run: bool,
    run: String,
    onset_ns: Option<u64>,
    outcomes: Vec<Outcome>,
    /// Outcomes of all runs with their onsets, by slot.
    all: Vec<Vec<(Outcome, Option<u64>)>>,
}

impl Report {
    fn new(diagnosers: Vec<(String, Description)>, each_run: bool) -> Self {
        let all = vec![Vec::new(); diagnosers.len()];
        Self {
            diagnosers,
            each_run,
            run: String::new(),
            onset_ns: None,
            outcomes: Vec::new(),
            all,
        }
    }

    fn begin(&mut self, run: &Run, onset_ns: Option<u64>) {
        self.run.clone_from(&run.name);
        self.onset_ns = onset_ns;
        self.outcomes = vec![Outcome::default(); self.diagnosers.len()];
    }

    fn take(&mut self, slot: usize, record: &StepRecord) {
        self.outcomes[slot].take(record, self.onset_ns);
    }

    fn end(&mut self) {
        for (slot, outcome) in self.outcomes.iter().enumerate() {
            if self.each_run {
                let run = if self.run.is_empty() {
                    String::new()
                } else {
                    format!("run {} · ", self.run)
                };
                println!(
                    "{run}{}: {}",
                    self.diagnosers[slot].0,
                    self.describe(slot, outcome)
                );
            }
            self.all[slot].push((outcome.clone(), self.onset_ns));
        }
    }

    fn describe(&self, slot: usize, outcome: &Outcome) -> String {
        let seconds = |time_ns: u64| time_ns as f64 * 1e-9;
        let mut text = format!(
            "{} steps, {} evaluated, {} false alarms",
            outcome.steps, outcome.evaluated, outcome.false_alarms
        );
        if let Some(onset_ns) = self.onset_ns {
            text += &match outcome.detected_ns {
                Some(at) => format!(
                    ", fault at {:.3} s detected after {:.3} s",
                    seconds(onset_ns),
                    seconds(at - onset_ns)
                ),
                None => format!(", fault at {:.3} s not detected", seconds(onset_ns)),
            };
        }
        if let Some((at, faults)) = outcome.isolated {
            let names: Vec<&str> = fault_names(&self.diagnosers[slot].1.faults, faults).collect();
            text += &format!(", isolated {} at {:.3} s", names.join("+"), seconds(at));
        }
        text
    }

    fn totals(&self) {
        for ((name, description), outcomes) in self.diagnosers.iter().zip(&self.all) {
            let runs = outcomes.len();
            let sum = |of: fn(&Outcome) -> u64| outcomes.iter().map(|(outcome, _)| of(outcome)).sum::<u64>();
            println!(
                "{name}: {runs} runs, {} steps, {} evaluated, {} false alarms in {} runs",
                sum(|outcome| outcome.steps),
                sum(|outcome| outcome.evaluated),
                sum(|outcome| outcome.false_alarms),
                outcomes
                    .iter()
                    .filter(|(outcome, _)| outcome.false_alarms > 0)
                    .count(),
            );
            let delays: Vec<u64> = outcomes
                .iter()
                .filter_map(|(outcome, onset)| Some(outcome.detected_ns? - (*onset)?))
                .collect();
            if outcomes.iter().all(|(_, onset)| onset.is_none()) {
                continue;
            }
            let detected = delays.len();
            let delay = median(delays).map_or("-".into(), |delay| format!("{:.3} s", delay as f64 * 1e-9));
            println!("{name}: fault detected in {detected} of {runs} runs, median delay {delay}");
            for (bit, fault) in description.faults.iter().enumerate() {
                let isolated = outcomes
                    .iter()
                    .filter(|(o, _)| o.isolated.is_some_and(|(_, set)| set >> bit & 1 == 1));
                println!("{name}: isolated {fault} in {} of {runs} runs", isolated.count());
            }
        }
    }
}
