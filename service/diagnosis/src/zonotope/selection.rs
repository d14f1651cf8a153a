//! The columns of largest score.

use super::Flags;
use crate::buffer::Buffer;
use pulp::{Simd, cast};

/// Columns whose ranks are counted in one vector.
const RANKS: usize = 16;
/// Blocks of [`RANKS`] columns that one number of [`Flags`] has.
const BLOCKS: usize = Flags::BITS as usize / RANKS;
/// The flag of every column of a block.
const PLACES: [u32; RANKS] = {
    let mut places = [1; RANKS];
    let mut k = 1;
    while k < RANKS {
        places[k] = places[k - 1] << 1;
        k += 1;
    }
    places
};

/// Room for choosing among columns.
#[derive(Clone, Debug)]
pub(super) struct Selection {
    /// Score of every column as a number of its own: ascending is score descending.
    keys: Buffer<u64>,
    /// One flag for each column.
    chosen: Buffer<Flags>,
}

impl Selection {
    /// Room for up to `columns` columns.
    pub fn new(columns: usize) -> Self {
        Self {
            keys: Buffer::with_capacity(columns),
            chosen: Buffer::with_capacity(columns.div_ceil(Flags::BITS as usize)),
        }
    }

    /// Chooses the `count` columns of largest score (ties: the lower index), fewer than there are. Column 64 b + k
    /// has flag k of number b.
    #[inline(always)]
    pub fn choose<S: Simd>(&mut self, simd: S, scores: &[f64], count: usize) -> &[Flags] {
        if scores.len() <= Flags::BITS as usize {
            let chosen = ranked_below(simd, scores, count);
            // More in case of a tie at the limit, also of what only differs in the lower bits.
            if chosen.count_ones() as usize == count {
                self.chosen.clear();
                self.chosen.push(chosen);
                return &self.chosen;
            }
        }
        self.partition(scores, count);
        &self.chosen
    }

    fn partition(&mut self, scores: &[f64], count: usize) {
        // Scores are sums of magnitudes, never negative, so that their bits are ordered as their values.
        let key = |score: &f64| !score.to_bits();
        self.keys.clear();
        self.keys.extend(scores.iter().map(key));
        let (before, &mut limit, _) = self.keys.select_nth_unstable(count);
        // Of the columns with the limiting score the first ones are chosen.
        let mut room = before.iter().filter(|key| **key == limit).count();
        self.chosen.clear();
        for block in scores.chunks(Flags::BITS as usize) {
            let mut flags = 0;
            for (k, score) in block.iter().enumerate() {
                let tie = key(score) == limit && room > 0;
                room -= usize::from(tie);
                flags |= Flags::from(key(score) < limit || tie) << k;
            }
            self.chosen.push(flags);
        }
    }
}

/// Flags of the columns, 64 at most, above which fewer than `count` have a larger score.
#[inline(always)]
fn ranked_below<S: Simd>(simd: S, scores: &[f64], count: usize) -> Flags {
    let mut keys = [[i32::MIN; RANKS]; BLOCKS];
    for (key, score) in keys.as_flattened_mut().iter_mut().zip(scores) {
        // The upper half of the bits has the order of the whole, but for ties; vectors compare faster with sign.
        *key = ((score.to_bits() >> u32::BITS) as u32 ^ 1 << 31).cast_signed();
    }
    let keys = &keys[..scores.len().div_ceil(RANKS).min(BLOCKS)];
    let (zero, one) = (simd.splat_u32s(0), simd.splat_u32s(1));
    let mut flags = 0;
    for (block, own) in keys.iter().enumerate() {
        let own = cast(*own);
        let mut rank = zero;
        for others in keys {
            // An array, so that the loop is unrolled.
            for key in *others {
                let larger = simd.greater_than_i32s(simd.splat_i32s(key), own);
                rank = simd.add_u32s(rank, simd.select_u32s(larger, one, zero));
            }
        }
        let below = simd.greater_than_u32s(simd.splat_u32s(count as u32), rank);
        let places: [u32; RANKS] = cast(simd.select_u32s(below, cast(PLACES), zero));
        let places = places.iter().fold(0, |sum, place| sum | place);
        flags |= Flags::from(places) << (block * RANKS);
    }
    flags
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::matrix::vectors::{Work, on_every_set};
    use std::cell::RefCell;

    struct Choice<'a> {
        selection: &'a RefCell<Selection>,
        scores: &'a [f64],
        count: usize,
    }

    impl Work for Choice<'_> {
        type Output = Vec<usize>;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> Vec<usize> {
            let mut selection = self.selection.borrow_mut();
            let flags = selection.choose(simd, self.scores, self.count).to_vec();
            let chosen = |column: &usize| flags[column / 64] >> (column % 64) & 1 == 1;
            (0..64 * flags.len()).filter(chosen).collect()
        }
    }

    #[test]
    fn the_columns_of_largest_score_are_chosen_and_of_equal_ones_the_first() {
        let selection = RefCell::new(Selection::new(130));
        for columns in 1..131_usize {
            for kind in 0..5 {
                let score = |column: usize| match (kind, column * 37 % 11) {
                    (0, _) => (column as f64 * 0.731).sin().abs(),
                    // Many ties.
                    (1, place) => place as f64 / 4.0,
                    // Scores that differ in the lower bits.
                    (2, place) => 1.0 + place as f64 * f64::EPSILON,
                    (3, 3) => f64::INFINITY,
                    (3, 5) => f64::NAN,
                    (3, place) => 1e300 * place as f64,
                    (_, place) => 1e-60 * (place / 3) as f64,
                };
                let scores: Vec<f64> = (0..columns).map(score).collect();
                let mut order: Vec<usize> = (0..columns).collect();
                order.sort_by_key(|column| (!scores[*column].to_bits(), *column));
                for count in [0, 1, columns / 3, columns * 3 / 4, columns - 1] {
                    let count = count.min(columns - 1);
                    let mut expected = order[..count].to_vec();
                    expected.sort_unstable();
                    let (scores, selection) = (&scores, &selection);
                    let choice = || Choice {
                        selection,
                        scores,
                        count,
                    };
                    on_every_set(choice, |found, set| {
                        assert_eq!(found, expected, "{count} of {columns}, kind {kind}, {set}");
                    });
                }
            }
        }
    }
}
