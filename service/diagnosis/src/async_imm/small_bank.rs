//! The bank of mode filters for few filter states: moments in arrays whose order N = n the compiler knows.
//!
//! The steps are those of method sheet 4.2 (mixing, prediction, Joseph update) for all modes of one design. Every
//! loop over filter states has a fixed length and runs along rows, every sum has a fixed order, nothing is fused:
//! equal inputs give equal bits on every machine.

use super::{
    interval::Interval, joseph_update::JosephUpdate, mixing::Mixer, sensor::SensorModel,
    small_transport::SmallTransport, state::ModeState,
};
use crate::matrix::Matrix;

/// Mean and covariance of one mode.
#[derive(Clone, Copy, Debug)]
pub(super) struct Moments<const N: usize> {
    /// x̂.
    pub mean: [f64; N],
    /// P, symmetric.
    pub covariance: [[f64; N]; N],
}

/// What a bank does between two fusion instants, whatever its order.
pub(super) trait SmallBank: Send {
    /// Mixes the posteriors of the last instant into the filters of this interval (paper (24)-(25)), with the
    /// weights that the mixer found.
    fn mix(&mut self, from: &[ModeState], mixer: &Mixer);

    /// Takes the interval of the next predictions.
    fn prepare(&mut self, interval: &Interval);

    /// x̂ ← Φ̄x̂ + ū, P ← Φ̄PΦ̄' + Ω̄ in mode `m` with amplitude direction D, over the interval prepared last.
    fn predict(&mut self, m: usize, interval: &Interval, direction: &Matrix);

    /// Prepares the update of mode `m` with a sample z; false if S = H̄PH̄' + R has no factor.
    fn innovate(&mut self, m: usize, sensor: &SensorModel, z: &[f64]) -> bool;

    /// Updates mode `m` with the sample that was prepared; returns log N(e; 0, S).
    fn update(&mut self, m: usize, sensor: &SensorModel) -> f64;

    /// Hands out the moments of all modes.
    fn store(&self, to: &mut [ModeState]);

    /// A copy.
    fn boxed_clone(&self) -> Box<dyn SmallBank>;
}

impl Clone for Box<dyn SmallBank> {
    fn clone(&self) -> Self {
        self.as_ref().boxed_clone()
    }
}

/// A bank of `modes` filters of order `n` for sensors of at most `widest` rows; `None` if the order is not small.
pub(super) fn small_bank(n: usize, modes: usize, widest: usize) -> Option<Box<dyn SmallBank>> {
    Some(match n {
        1 => Box::new(Bank::<1>::new(modes, widest)),
        2 => Box::new(Bank::<2>::new(modes, widest)),
        3 => Box::new(Bank::<3>::new(modes, widest)),
        4 => Box::new(Bank::<4>::new(modes, widest)),
        5 => Box::new(Bank::<5>::new(modes, widest)),
        6 => Box::new(Bank::<6>::new(modes, widest)),
        7 => Box::new(Bank::<7>::new(modes, widest)),
        8 => Box::new(Bank::<8>::new(modes, widest)),
        _ => return None,
    })
}

#[derive(Clone)]
struct Bank<const N: usize> {
    modes: Vec<Moments<N>>,
    transport: SmallTransport<N>,
    updates: Vec<JosephUpdate<N>>,
}

impl<const N: usize> Bank<N> {
    fn new(modes: usize, widest: usize) -> Self {
        Self {
            modes: vec![Moments::ZERO; modes],
            transport: SmallTransport::EMPTY,
            updates: vec![JosephUpdate::new(widest); modes],
        }
    }
}

impl<const N: usize> SmallBank for Bank<N> {
    fn mix(&mut self, from: &[ModeState], mixer: &Mixer) {
        for (m, mixed) in self.modes.iter_mut().enumerate() {
            *mixed = Moments::ZERO;
            for (i, source) in from.iter().enumerate() {
                let (weight, carried) = mixer.pair(i, m);
                if weight != 0.0 {
                    add_scaled(&mut mixed.mean, weight, &moved_mean(source, carried, mixer));
                }
            }
            for (i, source) in from.iter().enumerate() {
                let (weight, carried) = mixer.pair(i, m);
                if weight != 0.0 {
                    mixed.add_covariance(weight, source, carried, mixer);
                }
            }
        }
    }

    fn prepare(&mut self, interval: &Interval) {
        self.transport.prepare(interval);
    }

    fn predict(&mut self, m: usize, interval: &Interval, direction: &Matrix) {
        if let Some(moments) = self.modes.get_mut(m) {
            self.transport.direct(interval, direction);
            self.transport.predict(moments);
        }
    }

    fn innovate(&mut self, m: usize, sensor: &SensorModel, z: &[f64]) -> bool {
        match (self.modes.get(m), self.updates.get_mut(m)) {
            (Some(moments), Some(update)) => update.innovate(moments, sensor, z),
            _ => false,
        }
    }

    fn update(&mut self, m: usize, sensor: &SensorModel) -> f64 {
        match (self.modes.get_mut(m), self.updates.get_mut(m)) {
            (Some(moments), Some(update)) => update.apply(moments, sensor),
            _ => 0.0,
        }
    }

    fn store(&self, to: &mut [ModeState]) {
        for (moments, state) in self.modes.iter().zip(to) {
            state.mean.copy_from_slice(&moments.mean);
            for (i, row) in moments.covariance.iter().enumerate() {
                state.spread.row_mut(i).copy_from_slice(row);
            }
        }
    }

    fn boxed_clone(&self) -> Box<dyn SmallBank> {
        Box::new(self.clone())
    }
}

/// x̂^{i→m}: the slots that are not carried are back at their prior.
fn moved_mean<const N: usize>(source: &ModeState, carried: &[bool], mixer: &Mixer) -> [f64; N] {
    let (restart, _) = mixer.restart();
    let mut moved = [0.0; N];
    let values = source.mean.iter().zip(restart).zip(carried);
    for (moved, ((own, restart), carried)) in moved.iter_mut().zip(values) {
        *moved = if *carried { *own } else { *restart };
    }
    moved
}

impl<const N: usize> Moments<N> {
    const ZERO: Self = Self {
        mean: [0.0; N],
        covariance: [[0.0; N]; N],
    };

    /// P̌ += w [P^{i→m} + (x̌ - x̂^{i→m})(·)'], P^{i→m}: what is carried, and of the rest its prior.
    fn add_covariance(&mut self, weight: f64, source: &ModeState, carried: &[bool], mixer: &Mixer) {
        let mut deviation = self.mean;
        add_scaled(&mut deviation, -1.0, &moved_mean(source, carried, mixer));
        let first_slot = mixer.plant_states();
        for (r, row) in self.covariance.iter_mut().enumerate() {
            let kept = carried[r];
            let from = if kept { &source.spread } else { mixer.restart().1 };
            let Some(moved) = from.row(r).first_chunk::<N>() else {
                continue;
            };
            let mut moved = *moved;
            for (entry, carried) in moved.iter_mut().zip(carried).skip(first_slot) {
                *entry = if *carried == kept { *entry } else { 0.0 };
            }
            for (sum, (moved, other)) in row.iter_mut().zip(moved.iter().zip(&deviation)) {
                *sum += weight * (moved + deviation[r] * other);
            }
        }
    }

    /// P ← (P + P') / 2.
    #[inline(always)]
    pub fn symmetrise(&mut self) {
        for i in 0..N {
            for j in 0..i {
                let mean = 0.5 * (self.covariance[i][j] + self.covariance[j][i]);
                self.covariance[i][j] = mean;
                self.covariance[j][i] = mean;
            }
        }
    }
}

/// `out` += `factor` x.
#[inline(always)]
pub(super) fn add_scaled<const N: usize>(out: &mut [f64; N], factor: f64, x: &[f64; N]) {
    for (target, value) in out.iter_mut().zip(x) {
        *target += factor * value;
    }
}
