//! Simulated plants with their sensors: what they say, and when.

pub mod aircraft;
pub mod linear;
pub mod scalar;
pub mod servo;
pub mod target;
pub mod two_state;

/// What a sensor or a controller sends at one moment.
#[derive(Clone, Debug, PartialEq)]
pub struct Emission {
    /// Nanoseconds since the start of the scenario, never falling.
    pub time_ns: u64,
    /// The input that carries it.
    pub input: &'static str,
    /// One element per signal; `None` when the packet gets lost on the way: its number is used up all the same.
    pub elements: Option<Vec<f64>>,
    /// What happens at this moment, for people.
    pub event: Option<String>,
}

/// A plant: its emissions in order of time.
pub trait Source {
    /// The next emission; `None` at the end of the scenario.
    fn next_emission(&mut self) -> Option<Emission>;
}

/// Emissions of several plants as one, in order of time.
pub struct Merged {
    sources: Vec<(Option<Emission>, Box<dyn Source>)>,
}

impl Merged {
    /// Merges plants.
    pub fn new(sources: Vec<Box<dyn Source>>) -> Self {
        let primed = |mut source: Box<dyn Source>| (source.next_emission(), source);
        Self {
            sources: sources.into_iter().map(primed).collect(),
        }
    }
}

impl Iterator for Merged {
    type Item = Emission;

    fn next(&mut self) -> Option<Emission> {
        let waiting = self.sources.iter_mut().filter(|(emission, _)| emission.is_some());
        let (slot, source) =
            waiting.min_by_key(|(emission, _)| emission.as_ref().map(|emission| emission.time_ns))?;
        std::mem::replace(slot, source.next_emission())
    }
}

/// A plant that emits on every tick of one period.
pub trait Ticking {
    /// Appends what is sent at tick `k`, then goes on to tick k + 1.
    fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>);
}

/// Runs a [`Ticking`] plant from tick 0 to its last one.
pub struct Ticks<P> {
    plant: P,
    next: u64,
    last: u64,
    waiting: std::vec::IntoIter<Emission>,
}

impl<P: Ticking> Ticks<P> {
    /// Ticks 0 to `last`.
    pub fn new(plant: P, last: u64) -> Self {
        Self {
            plant,
            next: 0,
            last,
            waiting: Vec::new().into_iter(),
        }
    }
}

impl<P: Ticking> Source for Ticks<P> {
    fn next_emission(&mut self) -> Option<Emission> {
        loop {
            if let Some(emission) = self.waiting.next() {
                return Some(emission);
            }
            if self.next > self.last {
                return None;
            }
            let mut emissions = Vec::new();
            self.plant.tick(self.next, &mut emissions);
            self.next += 1;
            self.waiting = emissions.into_iter();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Clock(u64, &'static str);

    impl Ticking for Clock {
        fn tick(&mut self, k: u64, emissions: &mut Vec<Emission>) {
            emissions.push(Emission {
                time_ns: k * self.0,
                input: self.1,
                elements: None,
                event: None,
            });
        }
    }

    #[test]
    fn several_plants_are_merged_in_order_of_time_to_their_ends() {
        let merged = Merged::new(vec![
            Box::new(Ticks::new(Clock(30, "slow"), 1)),
            Box::new(Ticks::new(Clock(20, "fast"), 2)),
        ]);
        let order: Vec<_> = merged
            .map(|emission| (emission.time_ns, emission.input))
            .collect();
        assert_eq!(
            order,
            [(0, "slow"), (0, "fast"), (20, "fast"), (30, "slow"), (40, "fast")]
        );
    }
}
