//! The example of the paper: longitudinal motion of a VTOL aircraft, discretised with 0.01 s.
//!
//! x_{k+1} = A0 x_k + B (u_k + f_k) + d_k,  y_k = C x_k + v_k, with the numbers of (43), x_0 and u = 0, and the
//! faults of (46) and (48): actuator 1 by 2, actuator 2 by 1, on the transitions k ≥ 101, so that y_102 is the
//! first measurement that shows the fault.
//!
//! | symbol | shape | what |
//! |---|---|---|
//! | x | 4 | horizontal speed, vertical speed, pitch rate, pitch angle |
//! | u, f | 2 | collective pitch, longitudinal cyclic pitch; their fault |
//! | d, v | 4 | disturbance per step, measurement noise, each within ±0.01 |
//! | y | 4 | measurement |

use clap::ValueEnum;
use nalgebra::{Matrix4, Matrix4x2, Vector2, Vector4};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Emission, Source, Ticking, Ticks};
use crate::demo::scenario::Variation;

/// Sampling period of the example, nanoseconds.
const PERIOD_NS: u64 = 10_000_000;
/// Steps of one case: 4 s, as in the paper's figures.
const STEPS: u64 = 400;
/// The first transition on which the fault acts; its effect is first seen in the measurement after it.
const FIRST_FAULTY_TRANSITION: u64 = 101;
/// Bound of each disturbance and noise element.
const BOUND: f64 = 0.01;

const A0: [f64; 16] = [
    0.9996, 0.0003, 0.0002, -0.0046, //
    0.0005, 0.9899, 0.0, -0.0402, //
    0.0010, 0.0007, 0.9929, 0.0012, //
    0.0, 0.0, 0.0100, 1.0,
];
const B: [f64; 8] = [0.0044, 0.0018, 0.0198, -0.0759, -0.0552, 0.0449, 0.0, 0.0];
const C: [f64; 16] = [
    1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 1.0,
];
const INITIAL_STATE: [f64; 4] = [0.1, -0.2, 0.15, 0.1];

/// The disturbance that acts on the aircraft.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Disturbance {
    /// Equation (47) of the paper: 0.01 sin(0.05 k) on every state.
    Sine,
    /// None.
    Zero,
    /// Uniform within the bounds.
    Uniform,
    /// At the bounds, with random signs: the worst that the model allows.
    Vertex,
}

/// The aircraft whose actuator `case` (1 or 2) fails.
pub fn sources(case: u8, variation: &Variation) -> Vec<Box<dyn Source>> {
    let aircraft = Aircraft::new(case, variation.disturbance, variation.seed);
    vec![Box::new(Ticks::new(aircraft, STEPS))]
}

impl Ticking for Aircraft {
    fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>) {
        let outputs = self.measure().to_vec();
        let command = self.command().to_vec();
        let fails = self.advance();
        let emission = |input, elements, event| Emission {
            time_ns: k * PERIOD_NS,
            input,
            elements: Some(elements),
            event,
        };
        let event = fails.then(|| format!("actuator {} of the aircraft fails", self.faulty_actuator + 1));
        emissions.push(emission("aircraft_sensors", outputs, None));
        emissions.push(emission("aircraft_commands", command, event));
    }
}

/// The simulated aircraft with a fault in one actuator.
pub struct Aircraft {
    faulty_actuator: usize,
    disturbance: Disturbance,
    generator: ChaCha8Rng,
    state: Vector4<f64>,
    transition: u64,
}

impl Aircraft {
    /// The aircraft at k = 0; `case` 1 will fail actuator 1, case 2 actuator 2.
    pub fn new(case: u8, disturbance: Disturbance, seed: u64) -> Self {
        Self {
            faulty_actuator: usize::from(case.saturating_sub(1).min(1)),
            disturbance,
            generator: ChaCha8Rng::seed_from_u64(seed),
            state: Vector4::from(INITIAL_STATE),
            transition: 0,
        }
    }

    /// The command u, constantly zero.
    pub fn command(&self) -> [f64; 2] {
        [0.0, 0.0]
    }

    /// The measurement y_k with its noise.
    pub fn measure(&mut self) -> [f64; 4] {
        let noise = Vector4::from_fn(|_, _| self.generator.random_range(-BOUND..=BOUND));
        (Matrix4::from_row_slice(&C) * self.state + noise).into()
    }

    /// Goes on from k to k + 1; true when this transition is the first with a fault.
    pub fn advance(&mut self) -> bool {
        let mut fault = Vector2::zeros();
        if self.transition >= FIRST_FAULTY_TRANSITION {
            fault[self.faulty_actuator] = [2.0, 1.0][self.faulty_actuator];
        }
        let disturbance = self.disturbance();
        self.state = Matrix4::from_row_slice(&A0) * self.state
            + Matrix4x2::from_row_slice(&B) * (Vector2::from(self.command()) + fault)
            + disturbance;
        self.transition += 1;
        self.transition == FIRST_FAULTY_TRANSITION + 1
    }

    fn disturbance(&mut self) -> Vector4<f64> {
        let phase = 0.05 * self.transition as f64;
        match self.disturbance {
            Disturbance::Zero => Vector4::zeros(),
            Disturbance::Sine => Vector4::repeat(BOUND * phase.sin()),
            Disturbance::Uniform => Vector4::from_fn(|_, _| self.generator.random_range(-BOUND..=BOUND)),
            Disturbance::Vertex => Vector4::from_fn(|_, _| {
                if self.generator.random::<bool>() {
                    BOUND
                } else {
                    -BOUND
                }
            }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fault_shows_first_in_the_measurement_102() {
        let run = |case| {
            let mut aircraft = Aircraft::new(case, Disturbance::Sine, 1);
            let mut first_faulty = None;
            let outputs: Vec<[f64; 4]> = (0..110)
                .map(|k| {
                    let output = aircraft.measure();
                    if aircraft.advance() {
                        first_faulty = Some(k);
                    }
                    output
                })
                .collect();
            assert_eq!(first_faulty, Some(101));
            outputs
        };
        let (one, two) = (run(1), run(2));
        assert_eq!(one[..102], two[..102]);
        assert!((0..4).all(|row| (one[102][row] - two[102][row]).abs() > 1e-4));
    }

    #[test]
    fn one_seed_gives_one_course() {
        let course = |seed| {
            let mut aircraft = Aircraft::new(1, Disturbance::Vertex, seed);
            (0..50)
                .map(|_| {
                    aircraft.advance();
                    aircraft.measure()
                })
                .collect::<Vec<_>>()
        };
        assert_eq!(course(3), course(3));
        assert_ne!(course(3), course(4));
    }
}
