//! The measurement update of one mode in Joseph's form, for few filter states (method sheet 4.2, step 5).
//!
//! | symbol | shape | here |
//! |---|---|---|
//! | e = z - H̄x̂ | d | `innovation` |
//! | C = P H̄' | N x d | `cross`, by columns |
//! | S = H̄C + R = L_S L_S' | d x d | `factor` |
//! | K = C S⁻¹ | N x d | `gain`, by columns |
//! | V = K R - (P - KC') H̄' | N x d | `rest`, by columns |
//!
//! Joseph's form is evaluated factor by factor, each as a correction of rank d instead of a product of N x N
//! matrices: (I - KH̄) P = P - KC', and (P - KC')(I - KH̄)' + KRK' = P - KC' + V K'. It keeps the covariance
//! positive where P is far larger than R: V is small there because two almost equal numbers are subtracted exactly.

use super::{
    sensor::SensorModel,
    small_bank::{Moments, add_scaled},
};
use std::f64::consts::TAU;

/// One sample in one mode, and the room for its update.
#[derive(Clone, Debug)]
pub(super) struct JosephUpdate<const N: usize> {
    innovation: Vec<f64>,
    /// Rows of d elements, lower triangle.
    factor: Vec<f64>,
    cross: Vec<[f64; N]>,
    gain: Vec<[f64; N]>,
    rest: Vec<[f64; N]>,
}

impl<const N: usize> JosephUpdate<N> {
    /// Room for samples of up to `widest` rows.
    pub fn new(widest: usize) -> Self {
        Self {
            innovation: vec![0.0; widest],
            factor: vec![0.0; widest * widest],
            cross: vec![[0.0; N]; widest],
            gain: vec![[0.0; N]; widest],
            rest: vec![[0.0; N]; widest],
        }
    }

    /// Takes a sample; false if S has no factor.
    pub fn innovate(&mut self, moments: &Moments<N>, sensor: &SensorModel, z: &[f64]) -> bool {
        match sensor.rows() {
            1 => self.innovate_rows(1, moments, sensor, z),
            2 => self.innovate_rows(2, moments, sensor, z),
            3 => self.innovate_rows(3, moments, sensor, z),
            d => self.innovate_rows(d, moments, sensor, z),
        }
    }

    /// Uses the sample; returns log N(e; 0, S).
    pub fn apply(&mut self, moments: &mut Moments<N>, sensor: &SensorModel) -> f64 {
        match sensor.rows() {
            1 => self.apply_rows(1, moments, sensor),
            2 => self.apply_rows(2, moments, sensor),
            3 => self.apply_rows(3, moments, sensor),
            d => self.apply_rows(d, moments, sensor),
        }
    }

    /// [`Self::innovate`] with d rows; the compiler knows the usual d.
    #[inline(always)]
    fn innovate_rows(&mut self, d: usize, moments: &Moments<N>, sensor: &SensorModel, z: &[f64]) -> bool {
        for (a, entries) in sensor.entries.iter().enumerate() {
            let mut expected = 0.0;
            let mut cross = [0.0; N];
            for (column, h) in entries {
                expected += h * moments.mean[*column];
                add_scaled(&mut cross, *h, &moments.covariance[*column]);
            }
            self.innovation[a] = z[a] - expected;
            self.cross[a] = cross;
        }
        for (a, row) in self.factor.chunks_exact_mut(d).take(d).enumerate() {
            for (b, value) in row[..=a].iter_mut().enumerate() {
                let product: f64 = sensor.entries[a]
                    .iter()
                    .map(|(column, h)| h * self.cross[b][*column])
                    .sum();
                *value = product + sensor.r[(a, b)];
            }
        }
        self.innovation[..d].iter().all(|e| e.is_finite()) && factorise(&mut self.factor[..d * d], d)
    }

    /// [`Self::apply`] with d rows.
    #[inline(always)]
    fn apply_rows(&mut self, d: usize, moments: &mut Moments<N>, sensor: &SensorModel) -> f64 {
        let Self {
            innovation,
            factor,
            cross,
            gain,
            rest,
        } = self;
        let (cross, gain, rest) = (&cross[..d], &mut gain[..d], &mut rest[..d]);
        let e = &innovation[..d];
        solve(factor, cross, gain);
        for (e, gain) in e.iter().zip(gain.iter()) {
            add_scaled(&mut moments.mean, *e, gain);
        }
        // (P - KC')' = P - CK'.
        for (i, row) in moments.covariance.iter_mut().enumerate() {
            for (cross, gain) in cross.iter().zip(gain.iter()) {
                add_scaled(row, -cross[i], gain);
            }
        }
        for (a, (rest, entries)) in rest.iter_mut().zip(&sensor.entries).enumerate() {
            *rest = [0.0; N];
            for (b, gain) in gain.iter().enumerate() {
                add_scaled(rest, sensor.r[(a, b)], gain);
            }
            for (column, h) in entries {
                add_scaled(rest, -h, &moments.covariance[*column]);
            }
        }
        // (P - KC' + VK')' = P - CK' + KV'.
        for (i, row) in moments.covariance.iter_mut().enumerate() {
            for (gain, rest) in gain.iter().zip(rest.iter()) {
                add_scaled(row, gain[i], rest);
            }
        }
        moments.symmetrise();
        log_density(factor, &mut innovation[..d])
    }
}

/// S = L L' in the lower triangle of rows of `d` elements; false if a pivot is not positive or not finite.
#[inline(always)]
fn factorise(s: &mut [f64], d: usize) -> bool {
    for i in 0..d {
        let (above, row) = s.split_at_mut(i * d);
        for (j, known) in above.chunks_exact(d).enumerate() {
            let (left, rest) = row.split_at_mut(j);
            let product: f64 = left.iter().zip(known).map(|(a, b)| a * b).sum();
            rest[0] = (rest[0] - product) / known[j];
        }
        let product: f64 = row[..i].iter().map(|a| a * a).sum();
        let pivot = row[i] - product;
        if !(pivot > 0.0 && pivot.is_finite()) {
            return false;
        }
        row[i] = pivot.sqrt();
    }
    true
}

/// K' = (L L')⁻¹ C', row by row.
#[inline(always)]
fn solve<const N: usize>(factor: &[f64], cross: &[[f64; N]], gain: &mut [[f64; N]]) {
    let d = cross.len();
    for (a, row) in factor.chunks_exact(d).take(d).enumerate() {
        let (known, rest) = gain.split_at_mut(a);
        let mut solved = cross[a];
        for (known, l) in known.iter().zip(row) {
            add_scaled(&mut solved, -l, known);
        }
        let scale = 1.0 / row[a];
        rest[0] = solved.map(|value| value * scale);
    }
    for a in (0..d).rev() {
        let (rest, known) = gain.split_at_mut(a + 1);
        let mut solved = rest[a];
        for (known, row) in known.iter().zip(factor.chunks_exact(d).skip(a + 1)) {
            add_scaled(&mut solved, -row[a], known);
        }
        let scale = 1.0 / factor[a * d + a];
        rest[a] = solved.map(|value| value * scale);
    }
}

/// log N(e; 0, LL') = -½(d ln 2π + ‖L⁻¹e‖²) - Σ ln L_aa; `e` becomes L⁻¹e.
#[inline(always)]
fn log_density(factor: &[f64], e: &mut [f64]) -> f64 {
    let d = e.len();
    let (mut squares, mut logarithms) = (0.0, 0.0);
    for (a, row) in factor.chunks_exact(d).take(d).enumerate() {
        let (known, rest) = e.split_at_mut(a);
        let product: f64 = known.iter().zip(row).map(|(w, l)| w * l).sum();
        rest[0] = (rest[0] - product) / row[a];
        squares += rest[0] * rest[0];
        logarithms += row[a].ln();
    }
    -0.5 * (d as f64 * TAU.ln() + squares) - logarithms
}
