//! The daemon's engine and publication on a simulated clock, as fast as it goes: samples do not come over iceoryx2.

use std::time::Duration;

use anyhow::Result;
use clap::Args;
use nix::time::{ClockId, clock_gettime};
use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{Access, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns};
use residual_shared::names::Instance;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use residual_shared::transport::{self, Node, RecordAudience, RecordPublisher};
use residuald::assembly::{assemble, descriptions, table_spec};
use residuald::configuration::Configuration;
use residuald::runtime::companion::Message;
use residuald::runtime::engine::{Engine, RecordSink};
use residuald::runtime::exchange::Reported;
use residuald::runtime::live::Publication;
use rtrb::Consumer;

use super::fleet::{FleetOptions, Kinds, PERIOD_NS, diagnosers, instance};
use super::plants::{Plants, Sample};

/// The simulated epoch. Any number does as long as no window begins before zero.
const EPOCH_NS: u64 = 1_000_000_000_000;

/// After the end of a period its samples arrive.
const ARRIVAL_NS: u64 = 100_000;

/// What a profiler runs: a fleet for some periods.
#[derive(Clone, Debug, Args)]
pub struct SimulatedRole {
    #[command(flatten)]
    fleet: FleetOptions,
    /// Periods of 10 ms.
    #[arg(long, default_value_t = 100)]
    periods: u64,
    /// Whether something is wrong with the plants now and then.
    #[arg(long)]
    faults: bool,
}

/// Plays the role, and says what a step took and what the records were.
///
/// # Errors
/// See [`Simulation::new`].
pub fn play(role: &SimulatedRole) -> Result<()> {
    let mut simulation = Simulation::new(&Kinds::read()?, &role.fleet, role.faults)?;
    simulation.run(20);
    simulation.busy = Duration::ZERO;
    simulation.run(role.periods);
    let steps = role.periods * role.fleet.diagnosers as u64;
    println!(
        "{} ns a step, digest of the records {:x}, {} transitions of alarms",
        simulation.busy.as_nanos() as u64 / steps.max(1),
        simulation.digest,
        simulation.transitions
    );
    Ok(())
}

/// The fleet on a simulated clock, with its bounds table and the queue to recorders.
pub struct Simulation {
    engine: Engine,
    publication: Publication,
    queue: Consumer<Message>,
    plants: Plants,
    sequences: Vec<u64>,
    inputs_of_set: usize,
    period: u64,
    /// What the records said, all in one number: equal records give equal numbers.
    pub digest: u64,
    /// Processor time in which the engine accepted samples, stepped and published.
    pub busy: Duration,
    /// Transitions of alarms.
    pub transitions: u64,
    // In this order: the stream of records that nobody listens to, its node, and what is left of them.
    _stream: RecordPublisher,
    _node: Node,
    _place: Place,
}

impl Simulation {
    /// The fleet before its first step.
    ///
    /// # Errors
    /// A configuration or the table cannot be made.
    pub fn new(kinds: &Kinds, options: &FleetOptions, with_faults: bool) -> Result<Self> {
        let instance = instance("simulated")?;
        let configuration: Configuration = kinds.configuration(options, &instance.name);
        let diagnosers = diagnosers(&kinds.design()?, options);
        let spec = table_spec(
            &configuration,
            &descriptions(&diagnosers),
            DaemonTime::MONOTONIC,
            EPOCH_NS,
        );
        let access = Access {
            group: None,
            mode: 0o600,
        };
        let table = TableWriter::create(&instance.bounds_path(), &spec, &access)?;
        let inputs = configuration.inputs.len();
        let engine = assemble(&configuration, diagnosers, EPOCH_NS, 1.0);
        let (sender, queue) = rtrb::RingBuffer::new(configuration.daemon.record_queue);
        let node = transport::open_node(&instance)?;
        let stream = RecordPublisher::create(&node, &instance)?;
        let mut publication = Publication::new(table, sender, Reported::of(&engine));
        publication.record_for(RecordAudience::open(&node, &instance)?);
        Ok(Self {
            publication,
            engine,
            queue,
            plants: Plants::new(kinds, with_faults, 1)?,
            sequences: vec![0; inputs],
            inputs_of_set: inputs / options.input_sets(),
            period: 0,
            digest: 0xcbf2_9ce4_8422_2325,
            busy: Duration::ZERO,
            transitions: 0,
            _stream: stream,
            _node: node,
            _place: Place(instance),
        })
    }

    /// Lets `periods` pass.
    pub fn run(&mut self, periods: u64) {
        for _ in 0..periods {
            let samples = self.plants.period();
            let end_ns = EPOCH_NS + self.period * PERIOD_NS;
            let begin = processor_time();
            for sample in &samples {
                self.accept(sample, end_ns);
            }
            let until_ns = end_ns + PERIOD_NS + ARRIVAL_NS;
            let mut sink = Digested {
                publication: &mut self.publication,
                digest: &mut self.digest,
                transitions: &mut self.transitions,
            };
            while let Some(due_ns) = self.engine.next_due_ns().filter(|due_ns| *due_ns < until_ns) {
                self.engine.step_due(due_ns, monotonic_ns, &mut sink);
            }
            self.busy += processor_time() - begin;
            while self.queue.pop().is_ok() {}
            self.period += 1;
        }
    }

    /// The engine.
    pub fn engine(&self) -> &Engine {
        &self.engine
    }

    fn accept(&mut self, sample: &Sample, end_ns: u64) {
        for input in (sample.input..self.sequences.len()).step_by(self.inputs_of_set) {
            let header = SampleHeader {
                sequence: self.sequences[input],
                timestamp_ns: end_ns - sample.age_ns,
            };
            self.sequences[input] += 1;
            if let Some(elements) = &sample.elements {
                self.engine
                    .accept(input, 1, header, elements, end_ns + ARRIVAL_NS);
            }
        }
    }
}

/// The files of an instance; they disappear with it.
struct Place(Instance);

impl Drop for Place {
    fn drop(&mut self) {
        // What cannot be removed harms nobody but the memory that it takes.
        let _ = transport::remove_leftovers(&self.0);
        let _ = std::fs::remove_file(self.0.bounds_path());
    }
}

/// Processor time of this thread so far.
fn processor_time() -> Duration {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).map_or(Duration::ZERO, Into::into)
}

/// Publishes records and digests them.
struct Digested<'a> {
    publication: &'a mut Publication,
    digest: &'a mut u64,
    transitions: &'a mut u64,
}

impl RecordSink for Digested<'_> {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        let mut words = [slot as u64, record.step, u64::from(record.verdict), 0];
        for channel in record.channels() {
            words[3] = words[3].rotate_left(7)
                ^ channel.residual.to_bits()
                ^ channel.ratio.to_bits().rotate_left(32);
        }
        for word in words {
            *self.digest = (*self.digest ^ word).wrapping_mul(0x0100_0000_01b3);
        }
        self.publication.publish(slot, record)
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        *self.transitions += 1;
        self.publication.alarm(transition);
    }
}
