//! A turning target and three position sensors with their own rates, phases and packet losses.
//!
//! | symbol | what |
//! |---|---|
//! | x | position and velocity east, position and velocity north: m, m/s |
//! | u, f | lateral accelerations of two actuators and their faults, m/s² |
//! | w | white acceleration noise, 0.01 m²/s³ |

use nalgebra::{DMatrix, DVector};

use super::linear::{Draw, zero_order_hold};
use super::{Emission, Source, Ticking, Ticks};
use crate::demo::scenario::Variation;

/// Every event happens at a multiple of this.
const TICK_NS: u64 = 100_000_000;
const TICK_S: f64 = 0.1;
/// 40 s, as in the paper's figures.
const TICKS: u64 = 400;
/// The fault of actuator 2 begins at 16.5 s.
const FIRST_FAULTY_TICK: u64 = 165;
const FAULT: f64 = 2.0;
const COMMAND: [f64; 2] = [0.5, 0.5];
/// Ticks between two commands.
const COMMAND_TICKS: u64 = 5;
/// Power spectral density of the acceleration noise, m²/s³.
const NOISE_DENSITY: f64 = 0.01;
/// Standard deviation of a measured position, m.
const POSITION_DEVIATION: f64 = 5.0;

/// A sensor: which input it feeds, at which ticks, and how many of its packets arrive.
struct Sensor {
    input: &'static str,
    first_tick: u64,
    /// Ticks between two samples: the smallest number, and how many more it may be.
    ticks: u64,
    jitter: u64,
    arrival_probability: f64,
}

const SENSORS: [Sensor; 3] = [
    Sensor {
        input: "position_1",
        first_tick: 2,
        ticks: 6,
        jitter: 0,
        arrival_probability: 0.9,
    },
    Sensor {
        input: "position_2",
        first_tick: 3,
        ticks: 6,
        jitter: 0,
        arrival_probability: 0.8,
    },
    Sensor {
        input: "position_3",
        first_tick: 4,
        ticks: 8,
        jitter: 2,
        arrival_probability: 0.8,
    },
];

/// The target with its sensors.
pub struct Target {
    transition: DMatrix<f64>,
    input: DMatrix<f64>,
    state: DVector<f64>,
    next_sample: [u64; 3],
    /// Whether the fault has been told.
    announced: bool,
    draw: Draw,
}

/// The target whose actuator 2 fails.
pub fn sources(variation: &Variation) -> Vec<Box<dyn Source>> {
    vec![Box::new(Ticks::new(Target::new(variation.seed), TICKS))]
}

impl Target {
    /// The target at t = 0.
    pub fn new(seed: u64) -> Self {
        let a = DMatrix::from_row_slice(
            4,
            4,
            &[
                0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.2, 0.0, 0.0, 0.0, 1.0, 0.0, 0.2, 0.0, 0.0,
            ],
        );
        let b = DMatrix::from_row_slice(4, 2, &[0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
        let (transition, input) = zero_order_hold(&a, &b, TICK_S);
        Self {
            transition,
            input,
            state: DVector::from_column_slice(&[0.0, 5.0, 0.0, 5.0]),
            next_sample: SENSORS.map(|sensor| sensor.first_tick),
            announced: false,
            draw: Draw::new(seed),
        }
    }

    fn measure(&mut self) -> Vec<f64> {
        [0, 2]
            .map(|row| self.state[row] + self.draw.normal(POSITION_DEVIATION))
            .to_vec()
    }

    fn advance(&mut self, fault: f64) {
        let mut acting = DVector::from_column_slice(&COMMAND);
        acting[1] += fault;
        // Noise held over a tick: exact for the velocities, and within 1 mm for the positions.
        let deviation = (NOISE_DENSITY / TICK_S).sqrt();
        let noise = DVector::from_fn(2, |_, _| self.draw.normal(deviation));
        self.state = &self.transition * &self.state + &self.input * (acting + noise);
    }
}

impl Ticking for Target {
    fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>) {
        if k.is_multiple_of(COMMAND_TICKS) {
            emissions.push(Emission {
                time_ns: k * TICK_NS,
                input: "target_commands",
                elements: Some(COMMAND.to_vec()),
                event: None,
            });
        }
        for (place, sensor) in SENSORS.iter().enumerate() {
            if self.next_sample[place] != k {
                continue;
            }
            let jitter = if self.draw.chance(0.5) { 0 } else { sensor.jitter };
            self.next_sample[place] = k + sensor.ticks + jitter;
            let elements = self.measure();
            let announced = std::mem::replace(&mut self.announced, k >= FIRST_FAULTY_TICK);
            let event = (self.announced && !announced).then(|| "actuator 2 of the target fails".to_owned());
            let arrives = self.draw.chance(sensor.arrival_probability);
            emissions.push(Emission {
                time_ns: k * TICK_NS,
                input: sensor.input,
                elements: arrives.then_some(elements),
                event,
            });
        }
        self.advance(if k >= FIRST_FAULTY_TICK { FAULT } else { 0.0 });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sensors_keep_their_rates_and_lose_their_share() {
        let mut source = Ticks::new(Target::new(1), 6_000);
        let (mut sent, mut lost) = ([0_u32; 3], [0_u32; 3]);
        while let Some(emission) = source.next_emission() {
            let place = SENSORS
                .iter()
                .position(|sensor| sensor.input == emission.input)
                .unwrap();
            sent[place] += 1;
            lost[place] += u32::from(emission.elements.is_none());
        }
        assert_eq!(sent[..2], [1000, 1000]);
        assert!((620..=720).contains(&sent[2]), "{sent:?}");
        for (place, sensor) in SENSORS.iter().enumerate() {
            let share = f64::from(lost[place]) / f64::from(sent[place]);
            assert!(
                (share - (1.0 - sensor.arrival_probability)).abs() < 0.05,
                "{share}"
            );
        }
    }
}
