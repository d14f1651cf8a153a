//! What the sensors of one plant of each kind say, period by period, without end.
//!
//! x(k+1) = A x + B u + E d, y = C x + D u + D_d d + F_y f + v, with the matrices of the examples; every so often
//! something is wrong for a while, so that alarms come and go.

use anyhow::{Context, Result};
use nalgebra::{DMatrix, DVector};
use residuald::demo::plants::linear::{Draw, LinearPlant, zero_order_hold};
use toml::{Table, Value};

use super::fleet::{KINDS, Kinds, PERIOD_NS};

/// Periods from one fault to the next, and for how many of them it lasts.
const FAULT_EVERY: u64 = 1_000;
const FAULT_FOR: u64 = 100;

/// Tenths of the period: the sensors of the turning target speak in between.
const TENTH_NS: u64 = PERIOD_NS / 10;

/// One sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Its input among those of [`Kinds::inputs`].
    pub input: usize,
    /// How long before the end of the period it was taken, nanoseconds.
    pub age_ns: u64,
    /// One element for each signal; none: it gets lost on the way.
    pub elements: Option<Vec<f64>>,
}

/// One plant of each kind.
pub struct Plants {
    vtol: LinearPlant,
    servo: LinearPlant,
    target: LinearPlant,
    two_state: LinearPlant,
    vehicle: LinearPlant,
    first_input: [usize; KINDS],
    with_faults: bool,
    period: u64,
    draw: Draw,
}

impl Plants {
    /// The plants of the examples at rest.
    ///
    /// # Errors
    /// An example has no such matrix.
    pub fn new(kinds: &Kinds, with_faults: bool, seed: u64) -> Result<Self> {
        let model = |kind: usize, section: &str| Model::of(&kinds.tables[kind], section);
        let (vtol, servo, target) = (model(0, "model")?, model(1, "model")?, model(2, "plant")?);
        let (two_state, vehicle) = (model(3, "model")?, model(4, "model")?);
        // [B Bd] of the continuous plant, held over a period.
        let inputs = [two_state.matrix("B")?, two_state.matrix("Bd")?];
        let inputs = DMatrix::from_fn(2, 2, |row, column| inputs[column][(row, 0)]);
        let (two_state_a, inputs) = zero_order_hold(&two_state.matrix("A")?, &inputs, PERIOD_NS as f64 / 1e9);
        let held = zero_order_hold(&target.matrix("A")?, &target.matrix("B")?, TENTH_NS as f64 / 1e9);
        Ok(Self {
            vtol: plant(
                vtol.matrix("A")?,
                vtol.matrix("B")?,
                vtol.matrix("D")?,
                vtol.matrix("C")?,
            ),
            servo: plant(
                servo.matrix("A")?,
                servo.matrix("B")?,
                servo.matrix("D")?,
                servo.matrix("C")?,
            ),
            target: plant(
                held.0,
                held.1.clone(),
                held.1,
                DMatrix::from_fn(2, 4, |row, column| if column == 2 * row { 1.0 } else { 0.0 }),
            ),
            two_state: LinearPlant {
                d: two_state.matrix("D")?,
                d_d: two_state.matrix("Dd")?,
                ..plant(
                    two_state_a,
                    inputs.columns(0, 1).into_owned(),
                    inputs.columns(1, 1).into_owned(),
                    two_state.matrix("C")?,
                )
            },
            vehicle: plant(
                vehicle.matrix("transition")?,
                vehicle.matrix("input")?,
                vehicle.matrix("process_noise_input")?,
                vehicle.matrix("measurement")?,
            ),
            first_input: std::array::from_fn(|kind| kinds.first_input(kind)),
            with_faults,
            period: 0,
            draw: Draw::new(seed),
        })
    }

    /// The samples of the next period, in order of time for each input.
    pub fn period(&mut self) -> Vec<Sample> {
        let time = self.period as f64;
        let wrong = self.with_faults && self.period % FAULT_EVERY >= FAULT_EVERY - FAULT_FOR;
        let fault = |size: f64| if wrong { size } else { 0.0 };
        let draw = &mut self.draw;
        let mut samples = Vec::new();
        let [vtol, servo, target, two_state, vehicle] = self.first_input;
        let mut say = |input, elements: &DVector<f64>| {
            samples.push(Sample {
                input,
                age_ns: 0,
                elements: Some(elements.as_slice().to_vec()),
            });
        };

        let command = DVector::from_element(2, (0.05 * time).sin());
        let disturbance = DVector::from_element(4, 0.01 * (0.05 * time).sin());
        let noise = DVector::from_fn(4, |_, _| draw.bounded(0.01));
        say(vtol, &(output(&self.vtol, &command, &disturbance) + noise));
        say(vtol + 1, &command);
        let acting = DVector::from_vec(vec![command[0] + fault(2.0), command[1]]);
        advance(&mut self.vtol, &acting, &disturbance);

        let command = DVector::from_element(1, (0.1 * time).sin());
        let disturbance = DVector::from_element(1, draw.bounded(1.0));
        let noise = DVector::from_fn(2, |_, _| draw.bounded(0.01));
        say(servo, &(output(&self.servo, &command, &disturbance) + noise));
        say(servo + 1, &command);
        advance(&mut self.servo, &command.add_scalar(fault(0.5)), &disturbance);

        let command = DVector::from_element(1, 1.0);
        let disturbance = DVector::from_element(1, 0.01 * (0.01 * time).sin());
        let wrong_sensor = DVector::from_vec(vec![0.0, fault(0.2)]);
        say(
            two_state,
            &(output(&self.two_state, &command, &disturbance) + wrong_sensor),
        );
        say(two_state + 1, &command);
        advance(&mut self.two_state, &command, &disturbance);

        let command = DVector::from_element(1, (0.02 * time).sin());
        let noises = DVector::from_vec(vec![draw.normal(0.05), draw.normal(1e-3)]);
        let noise = [draw.normal(1.5), draw.normal(0.08)];
        let measured = output(&self.vehicle, &command, &noises);
        say(
            vehicle,
            &DVector::from_element(1, measured[0] + noise[0] + fault(20.0)),
        );
        say(vehicle + 1, &DVector::from_element(1, measured[1] + noise[1]));
        say(vehicle + 2, &command);
        advance(&mut self.vehicle, &command, &noises);

        self.follow_target(target, fault(2.0), &mut samples);
        self.period += 1;
        samples
    }

    /// The target has three sensors, each with its own rate and losses, and two commands in a period.
    fn follow_target(&mut self, first_input: usize, fault: f64, samples: &mut Vec<Sample>) {
        for tenth in 1..=10 {
            let tick = 10 * self.period + tenth;
            let age_ns = (10 - tenth) * TENTH_NS;
            for (place, (every, arrives)) in [(6, 0.9), (6, 0.8), (9, 0.8)].into_iter().enumerate() {
                if tick % every == 2 + place as u64 {
                    let position = &self.target.c * &self.target.state;
                    let measured = position.map(|position| position + self.draw.normal(5.0));
                    samples.push(Sample {
                        input: first_input + place,
                        age_ns,
                        elements: self.draw.chance(arrives).then(|| measured.as_slice().to_vec()),
                    });
                }
            }
            let command = DVector::from_element(2, 0.5);
            if tick.is_multiple_of(5) {
                samples.push(Sample {
                    input: first_input + 3,
                    age_ns,
                    elements: Some(command.as_slice().to_vec()),
                });
            }
            let acting = DVector::from_vec(vec![command[0], command[1] + fault]);
            let noise = DVector::from_fn(2, |_, _| self.draw.normal(0.3));
            advance(&mut self.target, &acting, &noise);
        }
    }
}

/// Matrices of an example's diagnoser.
struct Model<'a>(&'a Table);

impl<'a> Model<'a> {
    fn of(example: &'a Table, section: &str) -> Result<Self> {
        let diagnoser = example.get("diagnoser").and_then(|diagnosers| diagnosers.get(0));
        let model = diagnoser.and_then(|diagnoser| diagnoser.get(section)?.as_table());
        Ok(Self(model.with_context(|| format!("no {section}"))?))
    }

    fn matrix(&self, key: &str) -> Result<DMatrix<f64>> {
        let rows = self.0.get(key).and_then(Value::as_array);
        let rows = rows.with_context(|| format!("no matrix {key}"))?;
        let entries: Vec<Vec<f64>> = rows
            .iter()
            .map(|row| row.as_array().into_iter().flatten().filter_map(number).collect())
            .collect();
        let columns = entries.first().map_or(0, Vec::len);
        Ok(DMatrix::from_row_iterator(
            entries.len(),
            columns,
            entries.into_iter().flatten(),
        ))
    }
}

fn number(value: &Value) -> Option<f64> {
    value
        .as_float()
        .or_else(|| value.as_integer().map(|integer| integer as f64))
}

/// A plant at rest without direct terms.
fn plant(a: DMatrix<f64>, b: DMatrix<f64>, e: DMatrix<f64>, c: DMatrix<f64>) -> LinearPlant {
    let (states, outputs) = (a.nrows(), c.nrows());
    LinearPlant {
        f: DMatrix::zeros(states, 0),
        d: DMatrix::zeros(outputs, b.ncols()),
        d_d: DMatrix::zeros(outputs, e.ncols()),
        d_f: DMatrix::zeros(outputs, 0),
        state: DVector::zeros(states),
        a,
        b,
        e,
        c,
    }
}

fn output(plant: &LinearPlant, command: &DVector<f64>, disturbance: &DVector<f64>) -> DVector<f64> {
    plant.output(command, disturbance, &DVector::zeros(0))
}

fn advance(plant: &mut LinearPlant, command: &DVector<f64>, disturbance: &DVector<f64>) {
    plant.advance(command, disturbance, &DVector::zeros(0));
}
