//! The likeliest fault: ℓ = max A²/E over modes and onsets.

use super::glr::{Glr, GlrDesign, GlrWork, LikelihoodRatio, NO_TRACE};

impl Glr {
    /// ℓ of every component and of all: the oldest slot and the lowest mode win ties.
    pub(super) fn find_best(&self, design: &GlrDesign, work: &mut GlrWork) {
        let terms = self.score.iter().zip(&self.energy);
        for (ratio, (score, energy)) in work.ratio.iter_mut().zip(terms) {
            let value = score * score / energy;
            *ratio = if *energy > NO_TRACE {
                value
            } else {
                f64::NEG_INFINITY
            };
        }
        largest_per_lane(&work.ratio, &mut work.largest);
        work.best_of_component.fill(None);
        for (mode, fault) in design.modes.iter().enumerate() {
            let lanes = work.largest.iter().skip(mode).step_by(design.modes.len());
            let value = lanes.fold(f64::NEG_INFINITY, |one, other| larger(one, *other));
            let Some(best) = work.best_of_component.get_mut(fault.component) else {
                continue;
            };
            let enough = best.map_or(f64::MIN, |best| best.value);
            if value < enough {
                continue;
            }
            let Some(found) = self.oldest_with(design, mode, value, &work.ratio) else {
                continue;
            };
            if best.is_none_or(|best| value > best.value || found.age > best.age) {
                *best = Some(found);
            }
        }
        let older = |a: &LikelihoodRatio, b: &LikelihoodRatio| (b.age, a.mode) < (a.age, b.mode);
        work.best = None;
        for found in work.best_of_component.iter().flatten() {
            let better = work.best.is_none_or(|best| {
                found.value > best.value || found.value == best.value && older(found, &best)
            });
            if better {
                work.best = Some(*found);
            }
        }
    }

    /// The oldest onset of a mode with this ratio.
    fn oldest_with(
        &self,
        design: &GlrDesign,
        mode: usize,
        value: f64,
        ratio: &[f64],
    ) -> Option<LikelihoodRatio> {
        let modes = design.modes.len();
        let oldest = self.newest_slot(design) + 1;
        let (new, old) = ratio.split_at(oldest * modes);
        let find = |part: &[f64]| {
            let mut slots = part.iter().skip(mode).step_by(modes);
            slots.position(|ratio| *ratio == value)
        };
        let slot = find(old).map(|slot| oldest + slot).or_else(|| find(new))?;
        let column = slot * modes + mode;
        let (score, energy) = (self.score[column], self.energy[column]);
        Some(LikelihoodRatio {
            value,
            mode,
            age: self.steps - self.onsets[slot],
            size: score / energy,
            standard_deviation: 1.0 / energy.sqrt(),
            column,
        })
    }
}

/// `largest`\[i\] = the largest of the values i, i + l, i + 2l, … with l the length of `largest`.
fn largest_per_lane(values: &[f64], largest: &mut [f64]) {
    largest.fill(f64::NEG_INFINITY);
    for block in values.chunks(largest.len()) {
        for (largest, value) in largest.iter_mut().zip(block) {
            *largest = larger(*largest, *value);
        }
    }
}

/// The larger of two numbers.
fn larger(one: f64, other: f64) -> f64 {
    if other > one { other } else { one }
}
