//! The bank of mode filters on the turning target, in each of its forms.

use crate::case::{Case, Promise, design};
use crate::conforms;
use crate::plant::{Draw, Noise, Plant, RelativePacket, Sample};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    async_imm::{exact::discretise, options::AsyncImmTables, plant::LinearPlant},
    covariance::semidefinite_factor,
    diagnoser::PacketSource,
};
use std::sync::OnceLock;

/// What happens to packets on their way.
#[derive(Clone, Copy, PartialEq)]
enum Link {
    /// Some are lost.
    Lossy,
    /// A gateway repeats the last value for those that are lost.
    Held,
    /// Some are lost, some come one or two periods late.
    Late,
}

/// Three position sensors of the turning target; an offset of 2 in actuator 2 while faulty.
struct Target {
    /// e^{A 0.1 s} and \[∫e^{Aτ}dτ B, ∫e^{Aτ}dτ F\].
    phi: DMatrix<f64>,
    gain: DMatrix<f64>,
    noise: DMatrix<f64>,
    state: DVector<f64>,
    draw: Draw,
    link: Link,
    /// Ticks of 0.1 s since the start.
    tick: u32,
    sequences: [u64; 3],
    held: [[f64; 2]; 3],
    /// Packets that come with a later sample: how many periods later, and their values.
    delayed: Vec<(u32, RelativePacket, [f64; 2])>,
}

impl Target {
    fn new(seed: u64, link: Link) -> Self {
        let b = DMatrix::from_row_slice(4, 2, &[0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let plant = LinearPlant {
            a: DMatrix::from_row_slice(
                4,
                4,
                &[
                    0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.2, 0.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.0, 0.0,
                ],
            ),
            noise: &b * b.transpose() * 0.01,
            f: b.clone(),
            b,
        };
        let interval = discretise(&plant, 0.1);
        let mut draw = Draw::new(seed, Noise::Gaussian);
        let spread = draw.vector(&[5.0, 2.0, 5.0, 2.0]);
        Self {
            phi: interval.phi.to_dense(),
            gain: interval.gain.to_dense(),
            noise: semidefinite_factor(&interval.omega.to_dense()).unwrap(),
            state: DVector::from_column_slice(&[0.0, 5.0, 0.0, 5.0]) + spread,
            draw,
            link,
            tick: 0,
            sequences: [0; 3],
            held: [[0.0; 2]; 3],
            delayed: Vec::new(),
        }
    }

    /// The packet of a sensor sampled at a part of the interval, or `None` if it is lost.
    fn send(&mut self, sensor: usize, moment: f64) -> Option<(u32, RelativePacket, [f64; 2])> {
        let arrives = self.draw.chance([0.9, 0.8, 0.8][sensor]);
        let value = [
            self.state[0] + self.draw.number(5.0),
            self.state[2] + self.draw.number(5.0),
        ];
        self.sequences[sensor] += 1;
        if arrives {
            self.held[sensor] = value;
        } else if self.link != Link::Held {
            return None;
        }
        let late = match self.link {
            Link::Late if self.draw.chance(0.3) => 1 + u32::from(self.draw.chance(0.5)),
            _ => 0,
        };
        let packet = RelativePacket {
            source: PacketSource::Sensor(sensor),
            sequence: self.sequences[sensor],
            moment: moment - f64::from(late),
            start: 0,
            length: 2,
        };
        Some((late, packet, self.held[sensor]))
    }
}

impl Plant for Target {
    fn next(&mut self, faulty: bool) -> Sample {
        let command = [0.5, 0.5];
        let mut sample = Sample {
            measurements: vec![f64::NAN; 6],
            commands: command.to_vec(),
            ..Sample::default()
        };
        let mut packets: Vec<(RelativePacket, Vec<f64>)> = Vec::new();
        let offset = if faulty { 2.0 } else { 0.0 };
        for part in 1..=10 {
            let entering = DVector::from_column_slice(&[command[0], command[1], 0.0, offset]);
            self.state =
                &self.phi * &self.state + &self.gain * entering + &self.noise * self.draw.vector(&[1.0; 4]);
            self.tick += 1;
            for (sensor, (period, first)) in [(6, 2), (6, 3), (9, 4)].into_iter().enumerate() {
                if self.tick % period == first {
                    let sent = self.send(sensor, f64::from(part) / 10.0);
                    self.delayed.extend(sent);
                }
            }
        }
        for (late, packet, values) in std::mem::take(&mut self.delayed) {
            match late {
                0 => packets.push((packet, values.to_vec())),
                _ => self.delayed.push((late - 1, packet, values)),
            }
        }
        packets.push((
            RelativePacket {
                source: PacketSource::Commands,
                sequence: u64::from(self.tick),
                moment: 1.0,
                start: 0,
                length: 2,
            },
            command.to_vec(),
        ));
        for (packet, values) in packets {
            let start = sample.packet_values.len();
            sample.packets.push(RelativePacket { start, ..packet });
            if let PacketSource::Sensor(sensor) = packet.source {
                sample.measurements[2 * sensor..2 * sensor + 2].copy_from_slice(&values);
            }
            sample.packet_values.extend(values);
        }
        sample
    }
}

/// The tables of the example with other entries at the top and another mixing of amplitudes.
fn tables(top: &str, mixing: &str) -> String {
    let example: toml::Table = include_str!("../../../../deploy/config/turning_target.toml")
        .parse()
        .unwrap();
    let mut table = example["diagnoser"].as_array().unwrap()[0]
        .as_table()
        .unwrap()
        .clone();
    for key in [
        "name",
        "method",
        "sample_time_s",
        "phase_s",
        "margin_s",
        "priority",
        "measurements",
        "commands",
        "command_delay_steps",
    ] {
        table.remove(key);
    }
    table.extend(top.parse::<toml::Table>().unwrap());
    let amplitude = table["amplitude"].as_table_mut().unwrap();
    amplitude.extend(mixing.parse::<toml::Table>().unwrap());
    toml::to_string(&table).unwrap()
}

fn case(top: &str, mixing: &str) -> Case {
    Case {
        tables: tables(top, mixing),
        design: design::<AsyncImmTables>,
        period_ns: 1_000_000_000,
        plant: |seed| Box::new(Target::new(seed, Link::Lossy)),
        // Less than 0.01 alarms in an hour of 3600 instants were seen, and 0.002 at each start.
        promise: Promise::PerRun {
            probability: 0.01,
            steps: 1000,
            at_most: true,
        },
        designed: OnceLock::new(),
    }
}

conforms! {
    sequential => case("", "");
    sequential_square_root => Case {
        promise: Promise::NoClaim("the same numbers as the covariance form"),
        ..case("form = \"sequential_square_root\"", "")
    };
    random_walk => Case {
        promise: Promise::NoClaim("the rate depends on the random walk"),
        ..case("", "random_walk_psd = [0.1]")
    };
    late_packets => Case {
        plant: |seed| Box::new(Target::new(seed, Link::Late)),
        promise: Promise::NoClaim("instants are judged before their late packets are in"),
        ..case("rollback_steps = 2", "")
    };
    batch_unobserved => Case {
        plant: |seed| Box::new(Target::new(seed, Link::Held)),
        promise: Promise::NoClaim("held values look like a fault now and then"),
        ..case("form = \"batch_unobserved\"", "mixing = \"all\"")
    };
}
