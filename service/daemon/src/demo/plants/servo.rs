//! The servo of the reduced-order observer's paper: three states, two outputs, one actuator, one bounded disturbance.

use nalgebra::{DMatrix, DVector};

use super::linear::{Draw, LinearPlant};
use super::{Emission, Source, Ticking, Ticks};
use crate::demo::scenario::Variation;

const PERIOD_NS: u64 = 100_000_000;
/// 15 s.
const TICKS: u64 = 150;
/// The fault acts on the transitions from 5 s on.
const FIRST_FAULTY_TICK: u64 = 50;
/// Size of the fault: a sixteenth of the paper's.
const FAULT: f64 = 0.5;
/// Bound of the disturbance.
const DISTURBANCE: f64 = 1.0;
/// Bound of the noise of each output.
const NOISE: f64 = 0.01;

/// The servo whose actuator gets an offset.
pub struct Servo {
    plant: LinearPlant,
    draw: Draw,
}

/// The servo with its fault.
pub fn sources(variation: &Variation) -> Vec<Box<dyn Source>> {
    vec![Box::new(Ticks::new(Servo::new(variation.seed), TICKS))]
}

impl Servo {
    /// The servo at a random state of the box that the configuration declares.
    pub fn new(seed: u64) -> Self {
        let mut draw = Draw::new(seed);
        let column = |entries: &[f64]| DMatrix::from_column_slice(entries.len(), 1, entries);
        Self {
            plant: LinearPlant {
                a: DMatrix::from_row_slice(3, 3, &[0.49, 0.10, 0.06, -0.32, 0.95, -0.23, -0.25, -0.06, 0.63]),
                b: column(&[0.4, 0.4, 0.5]),
                e: column(&[-0.1, 0.2, -0.1]),
                f: column(&[0.4, 0.4, 0.5]),
                c: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
                d: DMatrix::zeros(2, 1),
                d_d: DMatrix::zeros(2, 1),
                d_f: DMatrix::zeros(2, 1),
                state: DVector::from_fn(3, |_, _| draw.bounded(1.0)),
            },
            draw,
        }
    }
}

impl Ticking for Servo {
    fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>) {
        let command = DVector::from_element(1, (0.1 * k as f64).sin());
        let disturbance = DVector::from_element(1, self.draw.bounded(DISTURBANCE));
        let fault = DVector::from_element(1, if k >= FIRST_FAULTY_TICK { FAULT } else { 0.0 });
        let noise = DVector::from_fn(2, |_, _| self.draw.bounded(NOISE));
        let output = self.plant.output(&command, &disturbance, &fault) + noise;
        self.plant.advance(&command, &disturbance, &fault);
        let event = (k == FIRST_FAULTY_TICK).then(|| format!("the actuator of the servo is off by {FAULT}"));
        let emission = |input, elements: &DVector<f64>, event| Emission {
            time_ns: k * PERIOD_NS,
            input,
            elements: Some(elements.as_slice().to_vec()),
            event,
        };
        emissions.push(emission("servo_sensors", &output, None));
        emissions.push(emission("servo_command", &command, event));
    }
}
