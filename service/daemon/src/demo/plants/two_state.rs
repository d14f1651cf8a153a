//! The plant of the H∞ paper: two states, a sinusoidal disturbance, a step of the command, two faults.
//!
//! | symbol | shape | what |
//! |---|---|---|
//! | x, u, y | 2, 1, 2 | state, command (a unit step), output |
//! | d | 1 | disturbance 0.01 sin t |
//! | f | 2 | actuator fault f1, sensor fault f2 |

use nalgebra::{DMatrix, DVector};

use super::linear::{LinearPlant, zero_order_hold};
use super::{Emission, Source, Ticking, Ticks};
use crate::demo::scenario::Variation;

const PERIOD_NS: u64 = 10_000_000;
const PERIOD_S: f64 = 0.01;
/// 20 s.
const TICKS: u64 = 2_000;
/// The faults begin at 15 s.
const FIRST_FAULTY_TICK: u64 = 1_500;
/// Amplitude of the disturbance.
const DISTURBANCE: f64 = 0.01;

/// The faults of the paper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// f1: the actuator drifts away with this rate, per second.
    ActuatorRamp(f64),
    /// f2: the sensor is off by this much.
    SensorStep(f64),
}

/// The plant with one fault.
pub struct TwoState {
    plant: LinearPlant,
    fault: Fault,
}

/// The plant with this fault.
pub fn sources(fault: Fault, _variation: &Variation) -> Vec<Box<dyn Source>> {
    vec![Box::new(Ticks::new(TwoState::new(fault), TICKS))]
}

impl TwoState {
    /// The plant at rest.
    pub fn new(fault: Fault) -> Self {
        let a = DMatrix::from_row_slice(2, 2, &[-3.37, 1.636, -0.325, -1.896]);
        // B, Bd and Bf side by side.
        let inputs = DMatrix::from_row_slice(2, 4, &[0.5, 0.01, 0.586, 0.0, 0.4, 0.01, 0.41, 0.0]);
        let (a, inputs) = zero_order_hold(&a, &inputs, PERIOD_S);
        Self {
            plant: LinearPlant {
                a,
                b: inputs.columns(0, 1).into_owned(),
                e: inputs.columns(1, 1).into_owned(),
                f: inputs.columns(2, 2).into_owned(),
                c: DMatrix::identity(2, 2),
                d: DMatrix::from_row_slice(2, 1, &[0.0, 0.267]),
                d_d: DMatrix::from_row_slice(2, 1, &[0.02, 0.02]),
                d_f: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, 0.267, 0.0]),
                state: DVector::zeros(2),
            },
            fault,
        }
    }

    fn fault_at(&self, k: u64) -> DVector<f64> {
        let Some(age) = k.checked_sub(FIRST_FAULTY_TICK) else {
            return DVector::zeros(2);
        };
        match self.fault {
            Fault::ActuatorRamp(rate) => DVector::from_column_slice(&[rate * PERIOD_S * age as f64, 0.0]),
            Fault::SensorStep(size) => DVector::from_column_slice(&[0.0, size]),
        }
    }
}

impl Ticking for TwoState {
    fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>) {
        let command = DVector::from_element(1, 1.0);
        let disturbance = DVector::from_element(1, DISTURBANCE * (PERIOD_S * k as f64).sin());
        let fault = self.fault_at(k);
        let output = self.plant.output(&command, &disturbance, &fault);
        self.plant.advance(&command, &disturbance, &fault);
        let event = (k == FIRST_FAULTY_TICK).then(|| match self.fault {
            Fault::ActuatorRamp(rate) => {
                format!("the actuator of the two-state plant drifts, {rate} per second")
            }
            Fault::SensorStep(size) => format!("the sensor of the two-state plant is off by {size}"),
        });
        let emission = |input, elements: &DVector<f64>, event| Emission {
            time_ns: k * PERIOD_NS,
            input,
            elements: Some(elements.as_slice().to_vec()),
            event,
        };
        emissions.push(emission("two_state_sensors", &output, None));
        emissions.push(emission("two_state_command", &command, event));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_its_fault_the_plant_settles_where_its_equations_say() {
        let mut source = Ticks::new(TwoState::new(Fault::SensorStep(0.2)), TICKS);
        let mut last = None;
        while let Some(emission) = source.next_emission() {
            if emission.input == "two_state_sensors" && emission.time_ns < FIRST_FAULTY_TICK * PERIOD_NS {
                last = emission.elements;
            }
        }
        // 0 = A x + B, y = x + D, both within the effect of the disturbance.
        let last = last.unwrap();
        assert!(
            (last[0] - 0.2316).abs() < 0.01 && (last[1] - 0.1713 - 0.267).abs() < 0.01,
            "{last:?}"
        );
    }
}
