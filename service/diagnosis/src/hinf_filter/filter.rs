//! One filter: observer, post-filter, windowed energy and its tests (method sheet 4.1).

use super::{
    bounds::{Bounds, BoundsState, WindowRule},
    observer::{Observer, ObserverState},
    rounding::Magnitudes,
    window_energy::WindowEnergy,
};
use crate::diagnoser::Channel;
use crate::matrix::{Matrix, all_finite, apply, dot};
use serde::{Deserialize, Serialize};

/// Thresholds are exceeded from this relative margin on: rounding errors of the sums stay below it.
const MARGIN: f64 = 1e-9;

/// What the residual is compared with.
#[derive(Clone, Debug)]
pub(super) enum Threshold {
    /// Jth, as in the paper.
    Constant(f64),
    /// The largest energy and residual without fault.
    Guaranteed(Box<Bounds>),
}

/// One filter without its state.
#[derive(Clone, Debug)]
pub(super) struct ResidualFilter {
    pub observer: Observer,
    /// V with further rows that are bounded but not tested.
    pub v: Matrix,
    /// s: number of tested rows.
    pub tested: usize,
    pub threshold: Threshold,
    pub rule: WindowRule,
    /// Whether each residual is tested by itself.
    pub peak_test: bool,
    pub outcome: Outcome,
    r: Vec<f64>,
}

/// What changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct FilterState {
    pub observer: ObserverState,
    /// None for a constant threshold.
    pub bounds: Option<BoundsState>,
    energy: WindowEnergy,
}

/// What one instant gave.
#[derive(Clone, Debug)]
pub(super) struct Outcome {
    /// r̃, all rows; 0 if the sample was lost.
    pub residual: Vec<f64>,
    /// ρ, all rows; infinite for a constant threshold.
    pub bound: Vec<f64>,
    /// J.
    pub energy: f64,
    /// Jth.
    pub threshold: f64,
    /// Whether the sample was there.
    pub sampled: bool,
}

impl ResidualFilter {
    pub fn new(
        observer: Observer,
        v: Matrix,
        tested: usize,
        threshold: Threshold,
        rule: WindowRule,
        peak_test: bool,
    ) -> Self {
        let (rows, q) = v.shape();
        Self {
            observer,
            v,
            tested,
            threshold,
            rule,
            peak_test,
            outcome: Outcome {
                residual: vec![0.0; rows],
                bound: vec![f64::INFINITY; rows],
                energy: 0.0,
                threshold: 0.0,
                sampled: false,
            },
            r: vec![0.0; q],
        }
    }

    /// The state before the first instant.
    pub fn initial_state(&self, bounds: Option<BoundsState>, window: Option<usize>) -> FilterState {
        FilterState {
            observer: ObserverState::new(self.observer.ad.rows()),
            bounds,
            energy: WindowEnergy::new(window),
        }
    }

    /// Puts the state to the first instant with x̂₀ = `x`.
    pub fn start(&mut self, state: &mut FilterState, x: &[f64]) {
        state.observer.start(x);
        state.energy.clear();
        if let (Threshold::Guaranteed(bounds), Some(state)) = (&self.threshold, &mut state.bounds) {
            bounds.start(state, x);
        }
    }

    /// One instant with the sample `y` (lost: `None`) and the command `u`; false if numbers grew beyond what can be
    /// represented, after which the filter must start again.
    #[must_use]
    pub fn step(&mut self, state: &mut FilterState, y: Option<&[f64]>, u: &[f64]) -> bool {
        self.observer.begin(&mut state.observer, y);
        let outcome = &mut self.outcome;
        match y {
            Some(y) => {
                self.observer.residual(&state.observer, y, u, &mut self.r);
                apply(&self.v, &self.r, &mut outcome.residual);
            }
            None => outcome.residual.fill(0.0),
        }
        outcome.sampled = y.is_some();
        let tested = &outcome.residual[..self.tested];
        outcome.energy = self.rule.root(&mut state.energy, dot(tested, tested));
        let sample = y.map(|y| (y, &self.r[..]));
        match (&mut self.threshold, &mut state.bounds) {
            (Threshold::Guaranteed(bounds), Some(present)) => {
                let magnitudes = Magnitudes {
                    x: &state.observer.x,
                    u,
                    sample,
                };
                outcome.threshold = bounds.evaluate(present, &magnitudes, self.rule, &mut outcome.bound);
                bounds.advance(present, u, y.is_none(), &outcome.bound);
            }
            (Threshold::Constant(threshold), _) => outcome.threshold = *threshold,
            (Threshold::Guaranteed(_), None) => return false,
        }
        self.observer.advance(&mut state.observer, sample, u);
        all_finite(&state.observer.x)
            && state.energy.sum().is_finite()
            && state.bounds.as_ref().is_none_or(BoundsState::is_sound)
    }

    /// The channels: energy, and one per tested residual.
    pub fn channels(&self) -> impl Iterator<Item = Channel> {
        let outcome = &self.outcome;
        let implied = outcome.threshold / self.rule.sample_time_s.sqrt();
        let residuals = outcome.residual.iter().zip(&outcome.bound).take(self.tested);
        let energy = Channel {
            lower: 0.0,
            residual: outcome.energy,
            upper: outcome.threshold,
            ratio: self.energy_ratio(),
        };
        let rows = residuals.map(move |(residual, bound)| match (outcome.sampled, self.peak_test) {
            (false, _) => Channel::NOT_EVALUATED,
            (true, true) => Channel {
                ratio: ratio(residual.abs(), *bound),
                ..Channel::two_sided(*residual, *bound)
            },
            // Without a bound of its own: what the energy threshold implies, for information.
            (true, false) => Channel {
                ratio: 0.0,
                ..Channel::two_sided(*residual, implied)
            },
        });
        std::iter::once(energy).chain(rows)
    }

    /// J / Jth, above 1 if the energy alarms.
    pub fn energy_ratio(&self) -> f64 {
        ratio(self.outcome.energy, self.outcome.threshold)
    }

    /// The largest |r̃_i| / ρ_i, above 1 if the peak test alarms; 0 where there is none.
    pub fn peak_ratio(&self) -> f64 {
        if !(self.outcome.sampled && self.peak_test) {
            return 0.0;
        }
        let rows = self.outcome.residual.iter().zip(&self.outcome.bound);
        rows.take(self.tested)
            .map(|(residual, bound)| ratio(residual.abs(), *bound))
            .fold(0.0, f64::max)
    }

    /// Whether a test alarms.
    pub fn alarms(&self) -> bool {
        self.energy_ratio() > 1.0 || self.peak_ratio() > 1.0
    }
}

/// value / bound with the margin; 0 for a zero value, infinite against a zero bound.
fn ratio(value: f64, bound: f64) -> f64 {
    if value == 0.0 {
        0.0
    } else {
        value / (bound * (1.0 + MARGIN))
    }
}

impl FilterState {
    pub fn fits(&self, other: &Self) -> bool {
        self.observer.fits(&other.observer)
            && self.energy.fits(&other.energy)
            && match (&self.bounds, &other.bounds) {
                (Some(bounds), Some(other)) => bounds.fits(other),
                (None, None) => true,
                _ => false,
            }
    }
}
