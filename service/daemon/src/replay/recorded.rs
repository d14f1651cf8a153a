//! Replay of an MCAP recording made by `residual record --samples`, in this process.
//!
//! The schedule begins at the recorded epoch and samples arrive when they arrived
//! ([`arrival_ns`](SampleMessage::arrival_ns)), so step numbers and instants are those of the recording, and
//! diagnosers whose time began within it say the same to the last bit. What cannot come out again is what the
//! daemon's own delays made: overruns, skipped instants, and samples that arrived within a fraction of a millisecond
//! of the moment at which they would have been late.

use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf};

use residual_diagnosis::method::Designed;
use residual_recording::header::Input;
use residual_recording::{Event, Header, ReadError, Reader, SampleMessage};
use residual_shared::alarm::AlarmTransition;
use residual_shared::record::StepRecord;

use super::records::{ReplayRecord, Replayed};
use super::simulated::step_before;
use crate::assembly::assemble;
use crate::configuration::Configuration;
use crate::runtime::engine::RecordSink;

/// The first bytes of every MCAP file.
const MCAP_MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// Why a recording cannot be replayed.
#[derive(Debug, thiserror::Error)]
pub enum RecordedError {
    /// The file cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// It was made without samples.
    #[error("`{0}` holds no samples to replay; record with `residual record --samples`")]
    NoSamples(PathBuf),
    /// An input of the configuration is not in it, or with other signals.
    #[error("`{path}` has no input `{input}` with the signals {wanted}; it has {there}")]
    OtherInput {
        /// The file.
        path: PathBuf,
        /// The input of the configuration.
        input: String,
        /// Its signals.
        wanted: String,
        /// What the recording has.
        there: String,
    },
}

/// A recording, ready to be replayed.
pub struct Recorded {
    path: PathBuf,
    header: Header,
    /// By arrival; the inputs are those of the configuration.
    samples: Vec<(u64, SampleMessage)>,
    first_instant_ns: u64,
    last_instant_ns: u64,
    cut_off: bool,
}

/// Whether a file begins as an MCAP file does; one that cannot be read does not.
pub fn is_mcap(path: &Path) -> bool {
    let mut magic = [0; MCAP_MAGIC.len()];
    let read = File::open(path).and_then(|mut file| file.read_exact(&mut magic));
    read.is_ok() && magic == MCAP_MAGIC
}

impl Recorded {
    /// Reads the samples of the inputs of `configuration`.
    pub fn read(path: &Path, configuration: &Configuration) -> Result<Self, RecordedError> {
        let mut reader = Reader::open(path)?;
        let header = reader.header().clone();
        let inputs = own_inputs(path, &header, configuration)?;
        let mut recorded = Self {
            path: path.into(),
            header,
            samples: Vec::new(),
            first_instant_ns: u64::MAX,
            last_instant_ns: 0,
            cut_off: false,
        };
        // The samples of one input keep their order, which its door judges them by.
        let mut latest_ns = vec![0; configuration.inputs.len()];
        while let Some(event) = reader.next_event()? {
            match event {
                Event::Record(message) => recorded.cover(message.record.instant_ns),
                Event::Sample(mut sample) => {
                    let Some(Some(input)) = inputs.get(sample.input) else {
                        continue;
                    };
                    sample.input = *input;
                    let arrival_ns = sample.arrival_ns().max(latest_ns[*input]);
                    latest_ns[*input] = arrival_ns;
                    recorded.samples.push((arrival_ns, sample));
                }
                Event::Alarm(_) => {}
            }
        }
        if recorded.samples.is_empty() {
            return Err(RecordedError::NoSamples(path.into()));
        }
        recorded.samples.sort_by_key(|(arrival_ns, _)| *arrival_ns);
        if recorded.last_instant_ns == 0 {
            // Without records: what the samples cover.
            for sample in [0, recorded.samples.len() - 1] {
                recorded.cover(recorded.samples[sample].0);
            }
        }
        recorded.cut_off = reader.is_cut_off();
        Ok(recorded)
    }

    /// What the recording says about itself.
    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The recording once more from its beginning, for its records.
    pub fn reread(&self) -> Result<Reader, RecordedError> {
        Ok(Reader::open(&self.path)?)
    }

    /// First and last sampling instant that the recording covers, nanoseconds of the daemon's time.
    pub fn instants_ns(&self) -> [u64; 2] {
        [self.first_instant_ns, self.last_instant_ns]
    }

    /// What stands in the way of records that are the same to the last bit.
    pub fn notes(&self) -> Vec<String> {
        let earlier = self.header.earlier_samples;
        let mut notes = Vec::new();
        if earlier > 0 {
            notes.push(format!(
                "the recording began after the daemon had received {earlier} samples: the states of its diagnosers \
                 at the beginning are not known"
            ));
        }
        if self.cut_off {
            notes.push("the recording has no end: its recorder was killed".to_owned());
        }
        notes
    }

    /// Steps `diagnosers` through the recording and hands over every record and alarm of an instant that it covers.
    pub fn simulate(
        &self,
        configuration: &Configuration,
        diagnosers: Vec<Designed>,
        take: impl FnMut(Replayed),
    ) {
        let speed = self.header.time.speed;
        let mut engine = assemble(configuration, diagnosers, self.header.schedule_epoch_ns, speed);
        let mut sink = Covered { recorded: self, take };
        for (arrival_ns, sample) in &self.samples {
            step_before(&mut engine, *arrival_ns, &mut sink);
            engine.accept(
                sample.input,
                sample.publisher,
                sample.header,
                &sample.elements,
                *arrival_ns,
            );
        }
        let margins = configuration
            .diagnosers
            .iter()
            .map(|diagnoser| diagnoser.margin_ns);
        let longest_ns = margins.max().unwrap_or(0) as f64 * speed;
        step_before(
            &mut engine,
            self.last_instant_ns + longest_ns as u64 + 1,
            &mut sink,
        );
    }

    fn covers(&self, instant_ns: u64) -> bool {
        (self.first_instant_ns..=self.last_instant_ns).contains(&instant_ns)
    }

    fn cover(&mut self, instant_ns: u64) {
        self.first_instant_ns = self.first_instant_ns.min(instant_ns);
        self.last_instant_ns = self.last_instant_ns.max(instant_ns);
    }
}

/// Takes the records of the instants that a recording covers.
struct Covered<'a, F> {
    recorded: &'a Recorded,
    take: F,
}

impl<F: FnMut(Replayed)> RecordSink for Covered<'_, F> {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        if self.recorded.covers(record.instant_ns) {
            let record = *record;
            (self.take)(Replayed::Record(ReplayRecord { slot, record }));
        }
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        if self.recorded.covers(transition.instant_ns) {
            (self.take)(Replayed::Alarm(*transition));
        }
    }
}

/// The input of the configuration for each input of the recording; each of the configuration must be there.
fn own_inputs(
    path: &Path,
    header: &Header,
    configuration: &Configuration,
) -> Result<Vec<Option<usize>>, RecordedError> {
    let mut inputs = vec![None; header.inputs.len()];
    for (own, configured) in configuration.inputs.iter().enumerate() {
        let same = |other: &Input| other.name == configured.name && other.signals == configured.signals;
        let place = header.inputs.iter().position(same).ok_or_else(|| {
            let describe = |input: &Input| format!("`{}` ({})", input.name, input.signals.join(", "));
            RecordedError::OtherInput {
                path: path.into(),
                input: configured.name.clone(),
                wanted: configured.signals.join(", "),
                there: header.inputs.iter().map(describe).collect::<Vec<_>>().join("; "),
            }
        })?;
        inputs[place] = Some(own);
    }
    Ok(inputs)
}
