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
        work.best_of_component.fill(None);
        for (mode, fault) in design.modes.iter().enumerate() {
            let Some((value, slot)) = self.largest_of_mode(design, mode, &work.ratio) else {
                continue;
            };
            let Some(best) = work.best_of_component.get_mut(fault.component) else {
                continue;
            };
            let age = self.steps - self.onsets[slot];
            let column = slot * design.modes.len() + mode;
            if best.is_none_or(|best| value > best.value || value == best.value && age > best.age) {
                let (score, energy) = (self.score[column], self.energy[column]);
                *best = Some(LikelihoodRatio {
                    value,
                    mode,
                    age,
                    size: score / energy,
                    standard_deviation: 1.0 / energy.sqrt(),
                    column,
                });
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

    /// The largest ratio of a mode and its slot, the oldest one of several; `None` without any trace.
    fn largest_of_mode(&self, design: &GlrDesign, mode: usize, ratio: &[f64]) -> Option<(f64, usize)> {
        let modes = design.modes.len();
        let oldest = self.newest_slot(design) + 1;
        let (new, old) = ratio.split_at(oldest * modes);
        let mut largest = (f64::NEG_INFINITY, 0);
        for (part, first) in [(old, oldest), (new, 0)] {
            for (slot, value) in part.iter().skip(mode).step_by(modes).enumerate() {
                if *value > largest.0 {
                    largest = (*value, first + slot);
                }
            }
        }
        (largest.0 > f64::NEG_INFINITY).then_some(largest)
    }
}
