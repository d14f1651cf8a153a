//! The scalar systems of the χ² paper, x(k) = a x(k-1) + w, z = x + v + f: stable, unstable and marginal.

use super::linear::Draw;
use super::{Emission, Source, Ticking, Ticks};
use crate::demo::scenario::Variation;

const PERIOD_NS: u64 = 100_000_000;
/// 200 instants, as in the paper's figures.
const TICKS: u64 = 200;
/// The sensor fault begins at instant 50.
const FIRST_FAULTY_TICK: u64 = 50;
/// Standard deviation of w and v.
const DEVIATION: f64 = 0.1;

/// The sensor fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// Grows by this much per instant: the soft fault.
    Ramp(f64),
    /// Jumps by this much: the hard fault.
    Step(f64),
}

/// One scalar system.
pub struct Scalar {
    input: &'static str,
    a: f64,
    fault: Fault,
    state: f64,
    draw: Draw,
}

/// The three systems with a ramp each.
pub fn sources(variation: &Variation) -> Vec<Box<dyn Source>> {
    let system = |place: u64, input, a, fault| -> Box<dyn Source> {
        let scalar = Scalar {
            input,
            a,
            fault,
            state: 0.0,
            draw: Draw::new(variation.seed.wrapping_mul(3).wrapping_add(place)),
        };
        Box::new(Ticks::new(scalar, TICKS))
    };
    vec![
        system(0, "stable_sensor", 0.8, Fault::Ramp(0.02)),
        system(1, "unstable_sensor", 1.1, Fault::Step(1.0)),
        system(2, "marginal_sensor", -1.0, Fault::Ramp(0.02)),
    ]
}

impl Ticking for Scalar {
    fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>) {
        let fault = match (k.checked_sub(FIRST_FAULTY_TICK), self.fault) {
            (None, _) => 0.0,
            (Some(age), Fault::Ramp(rate)) => rate * age as f64,
            (Some(_), Fault::Step(size)) => size,
        };
        // The state x(0) is known; the first sample belongs to k = 1.
        if k > 0 {
            self.state = self.a * self.state + self.draw.normal(DEVIATION);
            let measured = self.state + self.draw.normal(DEVIATION) + fault;
            emissions.push(Emission {
                time_ns: k * PERIOD_NS,
                input: self.input,
                elements: Some(vec![measured]),
                event: (k == FIRST_FAULTY_TICK).then(|| {
                    format!(
                        "the sensor of the system with a = {} fails: {:?}",
                        self.a, self.fault
                    )
                }),
            });
        }
    }
}
