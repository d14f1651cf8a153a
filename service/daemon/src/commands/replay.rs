//! `residuald replay`: a recording instead of sensors.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use miette::Diagnostic;
use residual_diagnosis::diagnoser::Description;

use super::replay_recorded;
use crate::configuration::{Configuration, ConfigurationError, Loaded};
use crate::replay::alarms::AlarmWriter;
use crate::replay::detection_table::TableFormat;
use crate::replay::detections::Detections;
use crate::replay::injection::{Fault, FaultError};
use crate::replay::loss::{Loss, LossError};
use crate::replay::mapping::{Mapping, MappingError, TimedSample};
use crate::replay::recorded::{RecordedError, is_mcap};
use crate::replay::recording::{ColumnRoles, Recording, RecordingError};
use crate::replay::records::{RecordWriter, Replayed, WriteError};
use crate::replay::report::Report;
use crate::replay::run::Run;
use crate::replay::selection::RunSelection;
use crate::replay::through_daemon::ThroughDaemonError;
use crate::replay::{simulated, through_daemon};

/// What `residuald replay` takes.
#[derive(Debug, Args)]
pub struct ReplayArguments {
    /// The configuration; for a CSV recording with a `[replay]` section.
    pub configuration: PathBuf,
    /// The recording: CSV with a header line, or MCAP made by `residual record --samples`.
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
    /// Share of samples to lose, e.g. `gyroscope=0.3,seed=1` (`all` for every input): they are left out, but their
    /// sequence numbers count on, so that the loss is known.
    #[arg(long, value_name = "LOSS")]
    pub loss: Option<Loss>,
    /// Write every record to this CSV file (one file per diagnoser when there are several).
    #[arg(long)]
    pub records: Option<PathBuf>,
    /// Write every transition of an alarm to this CSV file.
    #[arg(long)]
    pub alarms: Option<PathBuf>,
    /// Leave out the line of each run; print the totals only.
    #[arg(long)]
    pub totals: bool,
    /// Print a table instead: what each diagnoser detected in each run, and the totals of each kind of run.
    #[arg(long, value_enum, value_name = "FORMAT", num_args = 0..=1, require_equals = true)]
    #[arg(default_missing_value = "text", conflicts_with = "totals")]
    pub table: Option<TableFormat>,
    /// Fail unless every record of an MCAP recording comes out again, the same to the last bit but for the flag of an
    /// overrun, which tells that the daemon was late.
    #[arg(long)]
    pub verify: bool,
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
    /// No samples can be lost as asked for.
    #[error(transparent)]
    Loss(#[from] LossError),
    /// No run was selected.
    #[error("no run is selected; the recording has the runs: {0}; choose with --runs")]
    NoRun(String),
    /// A run is selected that is not there.
    #[error("the recording has no run `{name}`; its runs are: {runs}")]
    UnknownRun {
        /// The name.
        name: String,
        /// The runs there are.
        runs: String,
    },
    /// A daemon cannot be reset between runs.
    #[error(
        "{0} runs are selected, but a replay through the daemon takes one at a time; choose it with --runs NAME"
    )]
    SeveralRuns(usize),
    /// The daemon could not be fed.
    #[error(transparent)]
    Daemon(#[from] ThroughDaemonError),
    /// An MCAP recording cannot be replayed.
    #[error(transparent)]
    Recorded(#[from] RecordedError),
    /// The option works on the rows and columns of a CSV recording.
    #[error("{0} works on CSV recordings only; leave it out")]
    OnlyForCsv(&'static str),
    /// A CSV recording holds no records.
    #[error("--verify needs a recording with records: an MCAP file made by `residual record --samples`")]
    NothingToVerify,
    /// Recorded records did not come out again.
    #[error("the replay differs from the recording; was it made with this configuration?")]
    NotTheSame,
    /// Records cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The recorder missed records.
    #[error(
        "{0} records were lost on the way from the daemon, or came after it had read its configuration again; the \
         written records are incomplete"
    )]
    Lost(u64),
}

/// A recording with its configuration, ready to be replayed.
pub struct Replay {
    /// The configuration with its diagnosers' recipes.
    pub loaded: Loaded,
    recording: Recording,
    mapping: Mapping,
    loss: Option<Loss>,
}

impl Replay {
    /// Loads both files; keeps the selected runs, writes the faults into them and will lose samples as asked for.
    pub fn load(
        configuration: &Path,
        recording: &Path,
        runs: &RunSelection,
        faults: &[Fault],
        loss: Option<Loss>,
    ) -> Result<Self, ReplayError> {
        let loaded = Configuration::from_file(configuration)?;
        let replay = loaded
            .configuration
            .replay
            .as_ref()
            .ok_or_else(|| ReplayError::NoReplaySection(configuration.to_path_buf()))?;
        if let Some(loss) = &loss {
            loss.check(&loaded.configuration)?;
        }
        let roles = ColumnRoles {
            time: &replay.time_column,
            run: replay.run_column.as_deref(),
            kind: replay.kind_column.as_deref(),
            fault: replay.fault_column.as_deref(),
        };
        let mut recording = Recording::read(recording, roles)?;
        if let Some(period_ns) = replay.row_period_ns {
            recording.replay_rows_every(period_ns);
        }
        let names = recording
            .runs
            .iter()
            .map(|run| run.name.as_str())
            .collect::<Vec<_>>()
            .join(", ");
        let known: Vec<&str> = recording.runs.iter().map(|run| run.name.as_str()).collect();
        if let Some(name) = runs.unknown(&known) {
            return Err(ReplayError::UnknownRun {
                name: name.to_owned(),
                runs: names,
            });
        }
        recording.runs.retain(|run| runs.takes(run.position, &run.name));
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
            loss,
        })
    }

    /// The selected runs.
    pub fn runs(&self) -> &[Run] {
        &self.recording.runs
    }

    /// The samples of one run, in time order, without those that are lost.
    pub fn samples(&self, run: &Run) -> Vec<TimedSample> {
        let mut samples = self.mapping.samples(run);
        if let Some(loss) = &self.loss {
            loss.inject(&self.loaded.configuration, run, &mut samples);
        }
        samples
    }

    /// Replays one run in this process; `take` gets every record and alarm.
    pub fn simulate(&self, run: &Run, take: impl FnMut(Replayed)) -> Result<(), ReplayError> {
        let diagnosers = self.loaded.build_diagnosers()?;
        simulated::replay(&self.loaded.configuration, diagnosers, &self.samples(run), take);
        Ok(())
    }
}

/// Executes the command; the report goes to standard output.
pub fn execute(arguments: &ReplayArguments) -> Result<(), ReplayError> {
    if is_mcap(&arguments.recording) {
        return replay_recorded::execute(arguments);
    }
    if arguments.verify {
        return Err(ReplayError::NothingToVerify);
    }
    let replay = Replay::load(
        &arguments.configuration,
        &arguments.recording,
        &arguments.runs,
        &arguments.faults,
        arguments.loss.clone(),
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
    let mut alarms = arguments.alarms.as_deref().map(AlarmWriter::create).transpose()?;

    let mut report = Report::new(descriptions);
    let samples = replay.runs().iter().map(|run| run.rows.len() as u64).sum();
    let bar = ProgressBar::new(samples).with_style(progress_style());
    for run in replay.runs() {
        let injected_ns = arguments.faults.iter().map(|fault| fault.onset_ns(run)).min();
        let onsets_ns = [injected_ns, run.labelled_onset_ns];
        report.begin(run, onsets_ns.into_iter().flatten().min());
        let mut failed = None;
        let take = |replayed: Replayed| match replayed {
            Replayed::Record(record) => {
                report.take(run, &record);
                if let (Some(writer), None) = (&mut writer, &failed) {
                    failed = writer.write(&run.name, &record).err();
                }
            }
            Replayed::Alarm(transition) => {
                report.take_alarm(run, &transition);
                if let (Some(alarms), None) = (&mut alarms, &failed) {
                    failed = alarms.write(&run.name, report.diagnosers(), &transition).err();
                }
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
        if arguments.table.is_none() && !arguments.totals {
            bar.suspend(|| say(&report.last_run()));
        }
    }
    bar.finish_and_clear();
    say(&match arguments.table {
        Some(format) => Detections::new(report.diagnosers(), report.runs()).show(format),
        None => report.totals(),
    });
    writer.map_or(Ok(()), RecordWriter::finish)?;
    alarms.map_or(Ok(()), AlarmWriter::finish)?;
    Ok(())
}

/// Prints a report; whoever stops reading it halfway has read enough.
pub(super) fn say(report: &str) {
    let _ = std::io::stdout().write_all(report.as_bytes());
}

/// A bar with counts, times and a message.
pub(super) fn progress_style() -> ProgressStyle {
    let template = "{wide_bar} {pos}/{len} {elapsed} (eta {eta}) {msg}";
    ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
}
