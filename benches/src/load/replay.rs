//! `residual-bench replay`: the data of the five-method demonstration through `residuald replay`, against real time.

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, ensure};
use clap::Args;
use residual_recording::header::{Diagnoser, Input};
use residual_recording::{Header, SampleMessage, Totals, Writer};
use residual_shared::clock::DaemonTime;
use residual_shared::sample::SampleHeader;
use residuald::commands::replay::{ReplayArguments, execute};
use residuald::configuration::Configuration;
use residuald::demo::composition::compose;
use residuald::demo::plants::Merged;
use residuald::demo::plants::aircraft::Disturbance;
use residuald::demo::scenario::{self, Variation};
use residuald::replay::selection::RunSelection;

use crate::percentiles::{duration, significant};
use crate::results::{Finding, Results, Table};

/// Seconds of recording in a second.
const AIM: f64 = 1_000.0;

/// Epoch of the recording. Any number does as long as no window begins before zero.
const EPOCH_NS: u64 = 1_000_000_000_000;

/// The demonstration lasts as long as its longest scenario.
const DEMONSTRATION_NS: u64 = 40_000_000_000;

/// The role of a replay.
#[derive(Clone, Debug, Args)]
pub struct ReplayRole {
    configuration: PathBuf,
    recording: PathBuf,
}

/// Plays the role.
///
/// # Errors
/// The replay failed.
pub fn play(role: &ReplayRole) -> Result<()> {
    Ok(execute(&ReplayArguments {
        configuration: role.configuration.clone(),
        recording: role.recording.clone(),
        through_daemon: false,
        speed: 1.0,
        runs: RunSelection::All,
        faults: Vec::new(),
        loss: None,
        records: None,
        alarms: None,
        totals: false,
        table: None,
        verify: false,
    })?)
}

/// Measures.
///
/// # Errors
/// The recording cannot be made or replayed.
pub fn measure(quick: bool) -> Result<Results> {
    let mut results = Results::begin(
        "replay",
        "Replay",
        "A recording (MCAP with samples) of the demonstration of all five methods, once and several times in a row, \
         through `residuald replay` as a whole: reading configuration, gains and recording, recomputing what the gains \
         achieve, every step, and the report. The aircraft is sampled at 100 Hz for 4 s of every 40 s, the two-state \
         plant at 100 Hz for 20 s, the others at 1 to 10 Hz; all seven diagnosers are stepped for all of the time.",
        quick,
    );
    let directory = tempfile::tempdir_in("/dev/shm").context("no directory in memory")?;
    let mut table = Table::new(
        "Whole command, best of its runs",
        &[
            "demonstrations",
            "recording",
            "samples",
            "steps",
            "time",
            "seconds of recording per second",
        ],
    );
    let repetitions = if quick { [1, 10] } else { [1, 50] };
    let (mut last, mut times) = (f64::NAN, Vec::new());
    for repeated in repetitions {
        let recording = Recording::make(directory.path(), repeated)?;
        let mut best = Duration::MAX;
        for _ in 0..if quick { 3 } else { 5 } {
            best = best.min(recording.replay()?);
        }
        let recorded_s = repeated as f64 * DEMONSTRATION_NS as f64 / 1e9;
        times.push((recorded_s, best.as_secs_f64()));
        last = recorded_s / best.as_secs_f64();
        table.row([
            repeated.to_string(),
            format!("{recorded_s} s"),
            recording.samples.to_string(),
            recording.steps.to_string(),
            duration(best.as_nanos() as f64),
            significant(last),
        ]);
    }
    results.findings.push(Finding::at_least(
        format!(
            "replay of {} demonstrations of all methods in a row",
            repetitions[1]
        ),
        last,
        AIM,
        "× real time",
    ));
    results.tables.push(table);
    Ok(results)
}

/// A recording with its configuration.
struct Recording {
    configuration: PathBuf,
    file: PathBuf,
    samples: usize,
    steps: u64,
}

impl Recording {
    /// The demonstration so many times in a row.
    fn make(directory: &Path, repeated: u64) -> Result<Self> {
        let configuration = directory.join("all.toml");
        let gains = directory.join("all.gains.toml");
        let scenarios = scenario::of_all_methods();
        let examples: Vec<_> = scenarios.iter().map(|scenario| scenario.example).collect();
        let composed = compose(&examples, &"replay".parse()?, &gains)?;
        fs::write(&configuration, &composed.configuration)?;
        fs::write(&gains, &composed.gains)?;
        let loaded = Configuration::from_file(&configuration)?.configuration;

        let input_of: HashMap<&str, usize> = loaded
            .inputs
            .iter()
            .enumerate()
            .map(|(number, input)| (input.name.as_str(), number))
            .collect();
        let file = directory.join(format!("{repeated}.mcap"));
        let mut writer = Writer::create(&file, header(&loaded), &[], true)?;
        let mut sequences = vec![0; loaded.inputs.len()];
        let mut samples = 0;
        for seed in 1..=repeated {
            let variation = Variation {
                seed,
                disturbance: Disturbance::Sine,
            };
            let plants = scenarios
                .iter()
                .flat_map(|scenario| (scenario.plants)(&variation));
            let begin_ns = EPOCH_NS + (seed - 1) * DEMONSTRATION_NS;
            for emission in Merged::new(plants.collect()) {
                // The last tick of one is the first of the next.
                if emission.time_ns >= DEMONSTRATION_NS {
                    continue;
                }
                let input = *input_of.get(emission.input).context("an input of the plants")?;
                let time_ns = begin_ns + emission.time_ns;
                let sequence = sequences[input];
                sequences[input] += 1;
                if let Some(elements) = emission.elements {
                    writer.write_sample(&SampleMessage {
                        input,
                        publisher: 1,
                        header: SampleHeader {
                            sequence,
                            timestamp_ns: time_ns,
                        },
                        looked_ns: time_ns,
                        received_ns: time_ns,
                        elements,
                    })?;
                    samples += 1;
                }
            }
        }
        writer.finish(&Totals::default())?;
        let recorded_ns = repeated * DEMONSTRATION_NS;
        let steps = loaded
            .diagnosers
            .iter()
            .map(|diagnoser| recorded_ns / diagnoser.period_ns);
        Ok(Self {
            configuration,
            file,
            samples,
            steps: steps.sum(),
        })
    }

    /// Replays it in a process of its own; how long that takes.
    fn replay(&self) -> Result<Duration> {
        let begin = Instant::now();
        let status = Command::new(std::env::current_exe()?)
            .arg("load-replay")
            .args([&self.configuration, &self.file])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()?;
        ensure!(status.success(), "the replay ended with {status}");
        Ok(begin.elapsed())
    }
}

fn header(configuration: &Configuration) -> Header {
    Header {
        instance: configuration.daemon.instance.to_string(),
        epoch: 1,
        pid: std::process::id(),
        time: DaemonTime::MONOTONIC,
        wall_clock_offset_ns: 0,
        schedule_epoch_ns: EPOCH_NS,
        configuration: None,
        earlier_samples: 0,
        diagnosers: configuration
            .diagnosers
            .iter()
            .map(|diagnoser| Diagnoser {
                name: diagnoser.name.clone(),
                method: diagnoser.method.name().to_owned(),
                period_ns: diagnoser.period_ns,
                phase_ns: diagnoser.phase_ns,
                margin_ns: diagnoser.margin_ns,
                channels: Vec::new(),
                faults: Vec::new(),
            })
            .collect(),
        inputs: configuration
            .inputs
            .iter()
            .map(|input| Input {
                name: input.name.clone(),
                signals: input.signals.clone(),
            })
            .collect(),
    }
}
