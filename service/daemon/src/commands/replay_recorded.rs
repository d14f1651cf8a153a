//! `residuald replay` of an MCAP recording.

use residual_diagnosis::diagnoser::Description;

use super::replay::{ReplayArguments, ReplayError, say};
use crate::configuration::Configuration;
use crate::replay::alarms::AlarmWriter;
use crate::replay::comparison::Comparison;
use crate::replay::detections::Detections;
use crate::replay::recorded::Recorded;
use crate::replay::records::{RecordWriter, ReplayRecord, Replayed};
use crate::replay::report::Report;
use crate::replay::run::Run;
use crate::replay::selection::RunSelection;
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::StepRecord;

/// Replays the recording and compares the records with the recorded ones; the report goes to standard output.
pub(super) fn execute(arguments: &ReplayArguments) -> Result<(), ReplayError> {
    refuse_what_needs_rows(arguments)?;
    let loaded = Configuration::from_file(&arguments.configuration)?;
    let configuration = &loaded.configuration;
    let recorded = Recorded::read(&arguments.recording, configuration)?;
    let diagnosers = loaded.build_diagnosers()?;
    let names = configuration
        .diagnosers
        .iter()
        .map(|configured| configured.name.clone());
    let descriptions = diagnosers
        .iter()
        .map(|built| built.diagnoser.description().clone());
    let descriptions: Vec<(String, Description)> = names.zip(descriptions).collect();
    let mut writer = arguments
        .records
        .as_deref()
        .map(|path| RecordWriter::create(path, &descriptions))
        .transpose()?;

    let mut alarms = arguments.alarms.as_deref().map(AlarmWriter::create).transpose()?;

    let [first_ns, last_ns] = recorded.instants_ns();
    let times_ns = vec![0, last_ns - first_ns];
    let run = Run {
        recorded_ns: times_ns.clone(),
        times_ns,
        ..Run::default()
    };
    let name = recorded.header().instance.clone();
    let mut report = Report::new(descriptions);
    report.begin(&run, None);
    let mut comparison = Comparison::new(&recorded, configuration)?;
    let mut failed: Option<ReplayError> = None;
    recorded.simulate(configuration, diagnosers, |replayed| {
        if failed.is_some() {
            return;
        }
        match replayed {
            Replayed::Record(replayed) => {
                let record = StepRecord {
                    instant_ns: replayed.record.instant_ns - first_ns,
                    ..replayed.record
                };
                report.take(&run, &ReplayRecord { record, ..replayed });
                let written = writer.as_mut().map(|writer| writer.write(&name, &replayed));
                let compared = comparison.take(&replayed);
                failed = (written.and_then(Result::err).map(Into::into)).or(compared.err().map(Into::into));
            }
            Replayed::Alarm(transition) => {
                let since_start = AlarmTransition {
                    instant_ns: transition.instant_ns - first_ns,
                    ..transition
                };
                report.take_alarm(&run, &since_start);
                let written = alarms
                    .as_mut()
                    .map(|alarms| alarms.write(&name, report.diagnosers(), &transition));
                failed = written.and_then(Result::err).map(Into::into);
            }
        }
    });
    if let Some(error) = failed {
        return Err(error);
    }
    writer.map_or(Ok(()), RecordWriter::finish)?;
    alarms.map_or(Ok(()), AlarmWriter::finish)?;
    if arguments.table.is_none() && !arguments.totals {
        say(&report.last_run());
    }
    say(&match arguments.table {
        Some(format) => Detections::new(report.diagnosers(), report.runs()).show(format),
        None => report.totals(),
    });
    let agreements = comparison.finish()?;
    for note in recorded.notes() {
        eprintln!("{note}");
    }
    // A table is for programs: nothing else beside it on standard output.
    for (name, agreement) in &agreements {
        eprintln!("{name}: {}", agreement.describe());
    }
    if arguments.verify && !agreements.iter().all(|(_, agreement)| agreement.is_complete()) {
        return Err(ReplayError::NotTheSame);
    }
    Ok(())
}

/// What works on rows and columns of a CSV file.
fn refuse_what_needs_rows(arguments: &ReplayArguments) -> Result<(), ReplayError> {
    let options = [
        ("--through-daemon", arguments.through_daemon),
        ("--runs", arguments.runs != RunSelection::All),
        ("--fault", !arguments.faults.is_empty()),
        ("--loss", arguments.loss.is_some()),
    ];
    match options.into_iter().find(|(_, given)| *given) {
        Some((option, _)) => Err(ReplayError::OnlyForCsv(option)),
        None => Ok(()),
    }
}
