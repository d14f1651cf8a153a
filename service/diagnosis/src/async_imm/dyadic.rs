//! Discretisation without exponentials: the intervals of 2^j microseconds, put together (method sheet 3, step 3).

use super::{
    exact::discretise,
    interval::{Interval, IntervalWork},
    plant::LinearPlant,
};

/// Intervals of the table: up to 2^42 µs, 50 days; a longer one is cut to that.
const ENTRIES: u32 = 42;
/// Distinct lengths remembered, for sensors that sample periodically.
const REMEMBERED: usize = 16;

/// Φ, \[Υ, Ξ\] and Ω for any whole number of microseconds.
#[derive(Clone, Debug)]
pub struct DyadicTable {
    entries: Vec<Interval>,
    remembered: Vec<(i64, Interval)>,
    oldest: usize,
    work: IntervalWork,
}

impl DyadicTable {
    /// The table of a plant.
    pub fn new(plant: &LinearPlant) -> Self {
        let (n, columns) = (plant.a.nrows(), plant.b.ncols() + plant.f.ncols());
        let entries = (0..ENTRIES)
            .map(|j| discretise(plant, f64::from(j).exp2() * 1e-6))
            .collect();
        Self {
            entries,
            remembered: vec![(0, Interval::empty(n, columns)); REMEMBERED],
            oldest: 0,
            work: IntervalWork::new(n, columns),
        }
    }

    /// The interval of `microseconds` (0 if negative).
    ///
    /// Remembered intervals are the very same numbers, so that they change no result.
    pub fn over(&mut self, microseconds: i64) -> &Interval {
        let length = microseconds.clamp(0, (1 << ENTRIES) - 1);
        let place = match self.remembered.iter().position(|(known, _)| *known == length) {
            Some(place) => place,
            None => self.compose(length),
        };
        &self.remembered[place].1
    }

    fn compose(&mut self, length: i64) -> usize {
        let place = self.oldest;
        self.oldest = (place + 1) % REMEMBERED;
        let (known, interval) = &mut self.remembered[place];
        *known = length;
        interval.clear();
        for (j, entry) in self.entries.iter().enumerate() {
            if length >> j & 1 == 1 {
                interval.follow(entry, &mut self.work);
            }
        }
        place
    }
}
