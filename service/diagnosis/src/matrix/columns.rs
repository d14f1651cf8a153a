//! Small matrices by columns, a vector for each: all their inner products with one argument at once.

use super::Matrix;
use super::vectors::{LANES, Lanes, absolute, load};
use pulp::Simd;

/// A matrix of at most [`LANES`] rows and fewer columns than that, zeros below it.
///
/// Inner products of fewer than [`LANES`] terms are summed one term after the other, so that theirs have the bits
/// of [`super::dot`] and [`super::absolute_dot`] with the rows.
#[derive(Clone, Debug)]
pub(crate) struct Columns(Vec<Lanes>);

impl Columns {
    /// The columns of `matrix` (allocates; off-line), `None` if it has too many or too long ones.
    pub fn of(matrix: &Matrix) -> Option<Self> {
        let (rows, columns) = matrix.shape();
        let column = |k| {
            let mut column = [0.0; LANES];
            (0..rows).for_each(|i| column[i] = matrix[(i, k)]);
            column
        };
        (rows <= LANES && columns < LANES).then(|| Self((0..columns).map(column).collect()))
    }

    /// Inner products of the rows with `x`.
    #[inline(always)]
    pub fn dot<S: Simd>(&self, simd: S, x: &[f64]) -> S::f64s {
        self.sum(
            simd,
            x,
            #[inline(always)]
            |a, x| simd.mul_f64s(a, x),
        )
    }

    /// Inner products of the absolute values of the rows with `x`.
    #[inline(always)]
    pub fn absolute_dot<S: Simd>(&self, simd: S, x: &[f64]) -> S::f64s {
        self.sum(
            simd,
            x,
            #[inline(always)]
            |a, x| simd.mul_f64s(absolute(simd, a), x),
        )
    }

    /// Sums of the absolute values of the terms of [`Self::dot`].
    #[inline(always)]
    pub fn dot_size<S: Simd>(&self, simd: S, x: &[f64]) -> S::f64s {
        self.sum(
            simd,
            x,
            #[inline(always)]
            |a, x| absolute(simd, simd.mul_f64s(a, x)),
        )
    }

    #[inline(always)]
    fn sum<S: Simd>(&self, simd: S, x: &[f64], term: impl Fn(S::f64s, S::f64s) -> S::f64s) -> S::f64s {
        let mut sum = simd.splat_f64s(0.0);
        for (column, value) in self.0.iter().zip(x) {
            sum = simd.add_f64s(sum, term(load::<S>(column), simd.splat_f64s(*value)));
        }
        sum
    }
}

#[cfg(test)]
mod tests {
    use super::super::kernels::{absolute_dot, dot};
    use super::super::vectors::{Work, lanes_of, on_every_set};
    use super::*;

    struct Sums<'a>(&'a Columns, &'a [f64]);

    impl Work for Sums<'_> {
        type Output = [Lanes; 3];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [Lanes; 3] {
            let Self(columns, x) = self;
            [
                lanes_of::<S>(columns.dot(simd, x)),
                lanes_of::<S>(columns.absolute_dot(simd, x)),
                lanes_of::<S>(columns.dot_size(simd, x)),
            ]
        }
    }

    #[test]
    fn the_sums_have_the_bits_of_the_inner_products_of_the_rows() {
        for (rows, columns) in (0..10).flat_map(|rows| (0..10).map(move |columns| (rows, columns))) {
            let mut matrix = Matrix::zeros(rows, columns);
            let value = |place: usize| match place % 7 {
                2 => 0.0,
                3 => -0.0,
                _ => (place as f64 * 0.731).sin() * 10.0_f64.powi((place % 9) as i32 - 4),
            };
            for i in 0..rows {
                (0..columns).for_each(|k| matrix[(i, k)] = value(5 + i * 37 + k * 3));
            }
            let x: Vec<f64> = (0..columns).map(|k| value(3 + 11 * k)).collect();
            let Some(found) = Columns::of(&matrix) else {
                assert!(rows > LANES || columns >= LANES);
                continue;
            };
            on_every_set(
                || Sums(&found, &x),
                |[plain, absolute, sizes], set| {
                    for (i, row) in matrix.iter_rows().enumerate() {
                        assert_eq!(plain[i].to_bits(), dot(row, &x).to_bits(), "{set}");
                        assert_eq!(absolute[i].to_bits(), absolute_dot(row, &x).to_bits(), "{set}");
                        let terms = row.iter().zip(&x).map(|(a, x)| (a * x).abs());
                        assert_eq!(sizes[i].to_bits(), (0.0 + terms.sum::<f64>()).to_bits(), "{set}");
                    }
                },
            );
        }
    }
}
