//! From samples to step inputs: gathers what one diagnoser needs at one sampling instant.

use residual_diagnosis::diagnoser::{PacketHeader, PacketRules, PacketSource, Packets, StepInput};
use serde::{Deserialize, Serialize};

use super::inbox::Inbox;
use crate::configuration::SignalReference;

/// Gathers measurements and commands of one diagnoser; an element that was not received is NaN.
#[derive(Debug)]
pub struct Assembler {
    inputs: Vec<AssembledInput>,
    measurements: Vec<f64>,
    /// The instant that was gathered last.
    instant_ns: u64,
    packets: PacketStore,
    state: AssemblerState,
}

/// Everything that one instant leaves to the next.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AssemblerState {
    /// Ring of the last `command_delay_steps + 1` command vectors, newest at `newest`.
    commands: Vec<Vec<f64>>,
    newest: usize,
    /// Late samples of each input when it was last handed out.
    late_seen: Vec<u64>,
    /// Samples of each packet source's input that had been accepted when it was last gathered.
    packets_seen: Vec<u64>,
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
}

/// Where the elements of one input go.
#[derive(Debug)]
struct AssembledInput {
    input: usize,
    /// (element of the sample, place among the measurements)
    measurements: Vec<(usize, usize)>,
    /// (element of the sample, place among the commands)
    commands: Vec<(usize, usize)>,
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
            state: AssemblerState {
                commands: vec![vec![f64::NAN; commands.len()]; command_delay_steps + 1],
                newest: 0,
                late_seen: vec![0; inputs.len()],
                packets_seen: Vec::new(),
            },
            inputs,
            measurements: vec![f64::NAN; measurements.len()],
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
        self.state.packets_seen = vec![0; self.packets.sources.len()];
        self
    }

    /// Gathers the samples stamped in (`after_ns`, `until_ns`].
    pub fn gather(&mut self, inboxes: &mut [Inbox], after_ns: u64, until_ns: u64) -> Gathered {
        self.skip();
        self.instant_ns = until_ns;
        self.packets
            .gather(inboxes, after_ns, until_ns, &mut self.state.packets_seen);
        let commands = &mut self.state.commands[self.state.newest];
        self.measurements.fill(f64::NAN);
        let mut gathered = Gathered::default();
        for (assembled, late_seen) in self.inputs.iter().zip(&mut self.state.late_seen) {
            let inbox = &mut inboxes[assembled.input];
            let late = inbox.counters().late;
            gathered.late |= late > *late_seen;
            *late_seen = late;
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
        let AssemblerState { commands, newest, .. } = &mut self.state;
        *newest = (*newest + 1) % commands.len();
        commands[*newest].fill(f64::NAN);
    }

    /// Begins with what arrives from now on: what the inboxes took before is neither late nor a late packet.
    pub fn begin(&mut self, inboxes: &[Inbox]) {
        for (assembled, late_seen) in self.inputs.iter().zip(&mut self.state.late_seen) {
            *late_seen = inboxes[assembled.input].counters().late;
        }
        for (source, seen) in self.packets.sources.iter().zip(&mut self.state.packets_seen) {
            *seen = inboxes[source.input].counters().accepted;
        }
    }

    /// Everything that one instant leaves to the next.
    pub fn state(&self) -> &AssemblerState {
        &self.state
    }

    /// Goes on from a state that an assembler of the same signals had; false if it is of another shape, and
    /// nothing has changed then.
    ///
    /// An inbox that began anew in the meantime has no more than its own samples.
    pub fn restore(&mut self, mut state: AssemblerState, inboxes: &[Inbox]) -> bool {
        let own = &self.state;
        let fits = state.newest < own.commands.len()
            && state.commands.len() == own.commands.len()
            && state.late_seen.len() == own.late_seen.len()
            && state.packets_seen.len() == own.packets_seen.len()
            && (state.commands.iter().zip(&own.commands)).all(|(saved, own)| saved.len() == own.len());
        if fits {
            for (assembled, late_seen) in self.inputs.iter().zip(&mut state.late_seen) {
                *late_seen = inboxes[assembled.input].counters().late.min(*late_seen);
            }
            for (source, seen) in self.packets.sources.iter().zip(&mut state.packets_seen) {
                *seen = inboxes[source.input].counters().accepted.min(*seen);
            }
            self.state = state;
        }
        fits
    }

    /// Exchanges the numbers of the inputs with an assembler of the same signals, whose inputs are numbered
    /// otherwise.
    pub fn exchange_inputs(&mut self, other: &mut Self) {
        std::mem::swap(&mut self.inputs, &mut other.inputs);
        std::mem::swap(&mut self.packets.sources, &mut other.packets.sources);
    }

    /// What the step sees: measurements of this instant and the commands that begin to act at it.
    pub fn step_input(&self) -> StepInput<'_> {
        let AssemblerState { commands, newest, .. } = &self.state;
        let oldest = (newest + 1) % commands.len();
        StepInput {
            instant_ns: self.instant_ns,
            measurements: &self.measurements,
            commands: &commands[oldest],
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

    fn gather(&mut self, inboxes: &[Inbox], after_ns: u64, until_ns: u64, seen: &mut [u64]) {
        self.headers.clear();
        self.values.clear();
        for (source, seen) in self.sources.iter().zip(seen) {
            let inbox = &inboxes[source.input];
            for (header, elements) in inbox.packets(after_ns, until_ns, *seen) {
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
            *seen = inbox.counters().accepted;
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
