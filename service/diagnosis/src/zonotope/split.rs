//! Columns that stay and columns that become a box.

use super::Flags;
use crate::matrix::Matrix;

/// Columns in a number of [`Flags`].
const BLOCK: usize = Flags::BITS as usize;

/// Room for splitting the columns of a matrix.
#[derive(Clone, Debug)]
pub(super) struct Split {
    /// Sum of the magnitudes of the other columns, of every row.
    radius: Vec<f64>,
    /// A block of a row; as long as there are numbers of eight bits, so that each of them is a place in it.
    block: Box<[f64; 1 << u8::BITS]>,
}

impl Split {
    /// Room for matrices of `rows` rows.
    pub fn new(rows: usize) -> Self {
        Self {
            radius: vec![0.0; rows],
            block: Box::new([0.0; 1 << u8::BITS]),
        }
    }

    /// Moves the `count` flagged columns to the front; behind them goes the box of the others.
    #[inline(always)]
    pub fn apply(&mut self, matrix: &mut Matrix, flags: &[Flags], count: usize) {
        let (rows, columns) = matrix.shape();
        self.radius.fill(0.0);
        let mut target = 0;
        for (flags, first) in flags.iter().zip((0..columns).step_by(BLOCK)) {
            let last = columns.min(first + BLOCK);
            let (mut kept, mut others) = ([0; BLOCK], [0; BLOCK]);
            let kept = places(*flags, &mut kept);
            let others = places(!flags & (Flags::MAX >> (BLOCK + first - last)), &mut others);
            for (i, radius) in self.radius.iter_mut().enumerate() {
                let row = matrix.row_mut(i);
                // No place that is written lies behind the block that is read.
                self.block[..last - first].copy_from_slice(&row[first..last]);
                *radius = others
                    .iter()
                    .fold(*radius, |sum, place| sum + self.block[usize::from(*place)].abs());
                gather(&mut row[target..target + kept.len()], kept, &self.block);
            }
            target += kept.len();
        }
        for (i, radius) in self.radius.iter().enumerate() {
            let row = matrix.row_mut(i);
            row[count..count + rows].fill(0.0);
            row[count + i] = *radius;
        }
    }
}

/// The places of the flags that are set, ascending.
#[inline(always)]
fn places(mut flags: Flags, room: &mut [u8; BLOCK]) -> &[u8] {
    let places = &mut room[..flags.count_ones() as usize];
    for place in places.iter_mut() {
        *place = flags.trailing_zeros() as u8;
        flags &= flags.wrapping_sub(1);
    }
    places
}

/// `out` = the numbers at `places`.
#[inline(always)]
fn gather(out: &mut [f64], places: &[u8], source: &[f64; 1 << u8::BITS]) {
    let ((out, out_rest), (places, places_rest)) = (out.as_chunks_mut::<4>(), places.as_chunks::<4>());
    for (out, places) in out.iter_mut().zip(places) {
        *out = places.map(|place| source[usize::from(place)]);
    }
    for (out, place) in out_rest.iter_mut().zip(places_rest) {
        *out = source[usize::from(*place)];
    }
}
