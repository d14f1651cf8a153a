//! From samples to step inputs: gathers what one diagnoser needs at one sampling instant.

use residual_diagnosis::diagnoser::{PacketHeader, PacketRules, PacketSource, Packets, StepInput};

use super::inbox::Inbox;
use crate::configuration::SignalReference;

/// Gathers measurements and commands of one diagnoser; an element that was not received is NaN.
#[derive(Debug)]
pub struct Assembler {
    inputs: Vec<AssembledInput>,
    measurements: Vec<f64>,
    /// Ring of the last `command_delay_steps + 1` command vectors, newest at `newest`.
    commands: Vec<Vec<f64>>,
    newest: usize,
    /// The instant that was gathered last.
    instant_ns: u64,
    packets: PacketStore,
}

/// The packets of one step, for methods that asked for them.
#[derive(Debug, Default)]
struct PacketStore {
    sources: Vec<PacketInput>,
    headers: Vec<PacketHeader>,
    values: Vec<f64>,
}

/// Which elements of an input make the packets of one source.
#[derive(Debug)]
struct PacketInput {
    input: usize,
    source: PacketSource,
    elements: Vec<usize>,
    /// Samples of the input that had been accepted when it was last gathered.
    seen: u64,
}

/// Where the elements of one input go.
#[derive(Debug)]
struct AssembledInput {
    input: usize,
    /// (element of the sample, place among the measurements)
    measurements: Vec<(usize, usize)>,
    /// (element of the sample, place among the commands)
    commands: Vec<(usize, usize)>,
    /// Late samples of this input when it was last handed out.
    late_seen: u64,
}

/// What gathering found beside the values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Gathered {
    /// Bit i: element i of measurements followed by commands was received.
    pub inputs_valid: u64,
    /// An element was not received.
    pub missing: bool,
    /// A sample of an earlier instant came after that instant had been stepped.
    pub late: bool,
}

impl Assembler {
    /// An assembler of the given signals; commands act `command_delay_steps` instants later than received.
    pub fn new(
        measurements: &[SignalReference],
        commands: &[SignalReference],
        command_delay_steps: usize,
    ) -> Self {
        let mut inputs: Vec<AssembledInput> = Vec::new();
        let mut place_of = |signal: &SignalReference| {
            if let Some(place) = inputs.iter().position(|input| input.input == signal.input) {
                return place;
            }
            inputs.push(AssembledInput {
                input: signal.input,
                measurements: Vec::new(),
                commands: Vec::new(),
                late_seen: 0,
            });
            inputs.len() - 1
        };
        let places: Vec<usize> = measurements.iter().chain(commands).map(&mut place_of).collect();
        for (index, signal) in measurements.iter().enumerate() {
            inputs[places[index]].measurements.push((signal.element, index));
        }
        for (index, signal) in commands.iter().enumerate() {
            inputs[places[measurements.len() + index]]
                .commands
                .push((signal.element, index));
        }
        Self {
            inputs,
            measurements: vec![f64::NAN; measurements.len()],
            commands: vec![vec![f64::NAN; commands.len()]; command_delay_steps + 1],
            newest: 0,
            instant_ns: 0,
            packets: PacketStore::default(),
        }
    }

    /// Gathers single packets as well: sensor by sensor the `measurements` in order, and the `commands`.
    ///
    /// The packets of one source come from one input; elements of another input than its first are left out
    /// (the configuration refuses them).
    pub fn with_packets(
        mut self,
        rules: &PacketRules,
        measurements: &[SignalReference],
        commands: &[SignalReference],
        inboxes: &[Inbox],
    ) -> Self {
        let mut rest = measurements;
        for (sensor, &rows) in rules.sensor_rows.iter().enumerate() {
            let (own, others) = rest.split_at(rows.min(rest.len()));
            self.packets.add(PacketSource::Sensor(sensor), own, inboxes);
            rest = others;
        }
        self.packets.add(PacketSource::Commands, commands, inboxes);
        self
    }

    /// Gathers the samples stamped in (`after_ns`, `until_ns`].
    pub fn gather(&mut self, inboxes: &mut [Inbox], after_ns: u64, until_ns: u64) -> Gathered {
        self.skip();
        self.instant_ns = until_ns;
        self.packets.gather(inboxes, after_ns, until_ns);
        let commands = &mut self.commands[self.newest];
        self.measurements.fill(f64::NAN);
        let mut gathered = Gathered::default();
        for assembled in &mut self.inputs {
            let inbox = &mut inboxes[assembled.input];
            let late = inbox.counters().late;
            gathered.late |= late > assembled.late_seen;
            assembled.late_seen = late;
            let Some(elements) = inbox.hand_out(after_ns, until_ns) else {
                gathered.missing = true;
                continue;
            };
            for &(element, place) in &assembled.measurements {
                self.measurements[place] = elements[element];
                gathered.inputs_valid |= bit(place);
            }
            for &(element, place) in &assembled.commands {
                commands[place] = elements[element];
                gathered.inputs_valid |= bit(self.measurements.len() + place);
            }
        }
        gathered
    }

    /// Lets one instant pass without samples, so that delayed commands keep their instants.
    pub fn skip(&mut self) {
        self.newest = (self.newest + 1) % self.commands.len();
        self.commands[self.newest].fill(f64::NAN);
    }

    /// What the step sees: measurements of this instant and the commands that begin to act at it.
    pub fn step_input(&self) -> StepInput<'_> {
        let oldest = (self.newest + 1) % self.commands.len();
        StepInput {
            instant_ns: self.instant_ns,
            measurements: &self.measurements,
            commands: &self.commands[oldest],
            packets: Packets::new(&self.packets.headers, &self.packets.values),
        }
    }
}

impl PacketStore {
    /// Adds a source and room for all that its inbox can hold.
    fn add(&mut self, source: PacketSource, signals: &[SignalReference], inboxes: &[Inbox]) {
        let Some(input) = signals.first().map(|signal| signal.input) else {
            return;
        };
        let own = signals.iter().filter(|signal| signal.input == input);
        let elements: Vec<usize> = own.map(|signal| signal.element).collect();
        self.sources.push(PacketInput {
            input,
            source,
            elements,
            seen: 0,
        });
        let room = |size: fn(&PacketInput) -> usize| -> usize {
            let sources = self.sources.iter();
            sources
                .map(|source| inboxes[source.input].capacity() * size(source))
                .sum()
        };
        self.headers = Vec::with_capacity(room(|_| 1));
        self.values = Vec::with_capacity(room(|source| source.elements.len()));
    }

    fn gather(&mut self, inboxes: &[Inbox], after_ns: u64, until_ns: u64) {
        self.headers.clear();
        self.values.clear();
        for source in &mut self.sources {
            let inbox = &inboxes[source.input];
            for (header, elements) in inbox.packets(after_ns, until_ns, source.seen) {
                self.headers.push(PacketHeader {
                    source: source.source,
                    sequence: header.sequence,
                    time_ns: header.timestamp_ns,
                    start: self.values.len(),
                    length: source.elements.len(),
                });
                self.values
                    .extend(source.elements.iter().map(|&element| elements[element]));
            }
            source.seen = inbox.counters().accepted;
        }
    }
}

fn bit(place: usize) -> u64 {
    if place < 64 { 1 << place } else { 0 }
}

#[cfg(test)]
mod tests {
    use residual_shared::sample::SampleHeader;

    use super::*;

    fn signal(input: usize, element: usize) -> SignalReference {
        SignalReference { input, element }
    }

    fn send(inbox: &mut Inbox, instant: u64, elements: &[f64]) {
        inbox.accept(
            0,
            SampleHeader {
                sequence: instant,
                timestamp_ns: instant,
            },
            elements,
            instant,
        );
    }

    #[test]
    fn elements_go_to_their_places_and_absent_ones_are_nan() {
        let mut inboxes = [Inbox::new(2, 4, 0), Inbox::new(1, 4, 0)];
        let mut assembler = Assembler::new(&[signal(0, 1), signal(1, 0)], &[signal(0, 0)], 0);
        send(&mut inboxes[0], 10, &[1.0, 2.0]);
        let gathered = assembler.gather(&mut inboxes, 0, 10);
        assert_eq!(
            gathered,
            Gathered {
                inputs_valid: 0b101,
                missing: true,
                late: false
            }
        );
        let input = assembler.step_input();
        assert_eq!(input.commands, [1.0]);
        assert_eq!(input.measurements[0], 2.0);
        assert!(input.measurements[1].is_nan());
    }

    #[test]
    fn commands_act_the_configured_number_of_steps_later() {
        let mut inboxes = [Inbox::new(1, 4, 0)];
        let mut assembler = Assembler::new(&[], &[signal(0, 0)], 2);
        let mut seen = Vec::new();
        for instant in 1..5 {
            send(&mut inboxes[0], instant, &[instant as f64]);
            assembler.gather(&mut inboxes, instant - 1, instant);
            seen.push(assembler.step_input().commands[0]);
        }
        assert!(seen[0].is_nan() && seen[1].is_nan());
        assert_eq!(seen[2..], [1.0, 2.0]);
    }

    #[test]
    fn a_late_sample_is_reported_once() {
        let mut inboxes = [Inbox::new(1, 4, 0)];
        let mut assembler = Assembler::new(&[signal(0, 0)], &[], 0);
        assembler.gather(&mut inboxes, 0, 10);
        send(&mut inboxes[0], 10, &[1.0]);
        assert!(assembler.gather(&mut inboxes, 10, 20).late);
        assert!(!assembler.gather(&mut inboxes, 20, 30).late);
    }

    #[test]
    fn packets_of_one_instant_come_sensor_by_sensor_without_allocating() {
        let mut inboxes = [Inbox::new(2, 4, 0), Inbox::new(1, 4, 0)];
        let (measurements, commands) = ([signal(0, 1), signal(0, 0), signal(1, 0)], [signal(1, 0)]);
        let rules = PacketRules {
            sensor_rows: vec![2, 1],
            max_packets_per_step: 4,
            rollback_steps: 0,
        };
        let mut assembler = Assembler::new(&measurements, &commands, 0).with_packets(
            &rules,
            &measurements,
            &commands,
            &inboxes,
        );
        let room = (
            assembler.packets.headers.capacity(),
            assembler.packets.values.capacity(),
        );
        send(&mut inboxes[0], 3, &[1.0, 2.0]);
        send(&mut inboxes[1], 4, &[5.0]);
        send(&mut inboxes[0], 7, &[3.0, 4.0]);
        send(&mut inboxes[0], 11, &[0.0, 0.0]);
        assembler.gather(&mut inboxes, 0, 10);
        let input = assembler.step_input();
        assert_eq!(input.instant_ns, 10);
        let packets: Vec<_> = input
            .packets
            .iter()
            .map(|packet| {
                (
                    packet.source,
                    packet.sequence,
                    packet.time_ns,
                    packet.values.to_vec(),
                )
            })
            .collect();
        let (first, second) = (PacketSource::Sensor(0), PacketSource::Sensor(1));
        assert_eq!(
            packets,
            [
                (first, 3, 3, vec![2.0, 1.0]),
                (first, 7, 7, vec![4.0, 3.0]),
                (second, 4, 4, vec![5.0]),
                (PacketSource::Commands, 4, 4, vec![5.0]),
            ]
        );
        assert_eq!(
            room,
            (
                assembler.packets.headers.capacity(),
                assembler.packets.values.capacity()
            )
        );
    }
}
