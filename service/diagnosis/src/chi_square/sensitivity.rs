//! The smallest constant faults that are detected with a stated probability, by non-centralities (method sheet 3).
//!
//! A unit fault gives each chi-square statistic a non-centrality δ(k), k instants after its onset, and the likelihood
//! ratio of each slot, too: at the true onset the energy E(k); a fault of size f gives f²δ. The alarm needs c consecutive
//! instants (`alarm.confirm_steps`): each must be missed with (1 - p)/c at most. The best statistic of the decision
//! at the best instant is a lower bound of the probability that any alarms by then.

use super::{
    design::SteadyRun,
    engine::EngineDesign,
    glr::GlrDesign,
    glr_modes::FaultProfile,
    options::{ChiSquareOptions, StatisticKind},
    plant::Plant,
    power::required_non_centrality,
    steady::SteadyState,
    thresholds::Thresholds,
};
use nalgebra::{DMatrix, DVector};
use std::collections::BTreeMap;

/// The probability of detection that sizes speak of.
pub(super) const ASSURANCE: f64 = 0.9;
/// Instants after the onset that are looked at.
pub(super) const HORIZON: usize = 200;
/// Instants without fault before, so that the propagators have settled.
const SETTLING: usize = 1000;

/// Everything that the steady design offers.
pub(super) struct Sensitivity<'a> {
    pub options: &'a ChiSquareOptions,
    pub plant: &'a Plant,
    pub design: &'a EngineDesign,
    pub steady: &'a SteadyState,
    pub thresholds: &'a Thresholds,
}

/// Signatures g of all modes at the ages k - θ = 0, 1, ... of a slot, m x q, as long as anybody looks at them.
pub(super) fn signatures(sensitivity: &Sensitivity<'_>, glr: &GlrDesign) -> Option<Vec<DMatrix<f64>>> {
    let model = sensitivity.plant.models.first()?;
    let ages = glr.window_steps.max(HORIZON as u64);
    let design = EngineDesign {
        plain: false,
        pair_reset_steps: None,
        window_steps: Vec::new(),
        cusum_reference: None,
        glr: Some(GlrDesign {
            window_steps: ages,
            stride: ages,
            ..glr.clone()
        }),
        ..sensitivity.design.clone()
    };
    let z = vec![0.0; design.measurements];
    let mut run = SteadyRun::new(model, design, sensitivity.steady);
    let signature = |_| {
        run.step(&z);
        Some(run.engine.outcome.glr.as_ref()?.signature.to_dense())
    };
    (0..ages).map(signature).collect()
}

/// Products of the signatures Σ g_i'g_j up to each age of the window, q x q.
pub(super) fn signature_products(signatures: &[DMatrix<f64>], glr: &GlrDesign) -> Vec<DMatrix<f64>> {
    let modes = glr.modes.len();
    let in_window = signatures.iter().zip(0..glr.window_steps);
    let sums = in_window.scan(DMatrix::zeros(modes, modes), |sum, (g, _)| {
        *sum += g.tr_mul(g);
        Some(sum.clone())
    });
    sums.collect()
}

/// What a unit step gives the likelihood ratio at worst, k = 0, 1, ... instants after its onset τ.
///
/// A slot that opened at θ = τ + i sees the innovations g(a + i) with its own signature g(a), a = k - θ: its A²/E has the
/// non-centrality (Σ g(a)'g(a + i))²/Σ g(a)'g(a), which is E at i = 0; in the same way before the onset. Slots open
/// `stride` apart and are dropped at the age `window`; each τ has its best slot at each instant, and the worst of the
/// `stride` possible τ counts.
fn worst_non_centralities(signatures: &[DVector<f64>], window: usize, stride: usize) -> Vec<f64> {
    let sums = |lag: usize| -> Vec<f64> {
        let pairs = signatures.iter().zip(signatures.iter().skip(lag));
        pairs
            .scan(0.0, |sum, (g, later)| {
                *sum += g.dot(later);
                Some(*sum)
            })
            .collect()
    };
    let energy = sums(0);
    let squared = |overlap: Option<&f64>, age: usize| match (overlap, energy.get(age)) {
        (Some(overlap), Some(energy)) if *energy > 0.0 => overlap.powi(2) / energy,
        _ => 0.0,
    };
    let mut worst = vec![f64::INFINITY; HORIZON];
    for first in 0..stride {
        let mut best = vec![0.0_f64; HORIZON];
        for lag in (first..HORIZON).step_by(stride) {
            let overlap = sums(lag);
            for (age, best) in best.iter_mut().skip(lag).take(window).enumerate() {
                *best = best.max(squared(overlap.get(age), age));
            }
        }
        let lag = stride - first;
        let overlap = sums(lag);
        for (k, best) in best.iter_mut().take(window.saturating_sub(lag)).enumerate() {
            *best = best.max(squared(overlap.get(k), k + lag));
        }
        worst
            .iter_mut()
            .zip(best)
            .for_each(|(worst, best)| *worst = worst.min(best));
    }
    worst
}

impl Sensitivity<'_> {
    /// For each component and each number of instants 1 .. `HORIZON` after its onset the smallest constant fault that
    /// is detected by then; infinite if none.
    pub fn sizes(&self, signatures: Option<&[DMatrix<f64>]>) -> Vec<Vec<f64>> {
        let components = self.design.measurements + self.process_faults();
        let settled = self.settled_run();
        (0..components)
            .map(|component| {
                let mut ratios = match &settled {
                    Some(run) => self.chi_square_ratios(component, run.clone()),
                    None => Vec::new(),
                };
                ratios
                    .extend(signatures.and_then(|signatures| self.likelihood_ratios(component, signatures)));
                let mut sizes = vec![f64::INFINITY; HORIZON];
                for ratios in ratios {
                    for (k, size) in sizes.iter_mut().enumerate() {
                        *size = size.min(self.confirmed(&ratios, k));
                    }
                }
                (1..HORIZON).for_each(|k| sizes[k] = sizes[k].min(sizes[k - 1]));
                sizes
            })
            .collect()
    }

    fn process_faults(&self) -> usize {
        self.design.glr.as_ref().map_or(0, |glr| glr.entry.columns())
    }

    /// Required probability at one instant.
    fn probability(&self) -> f64 {
        1.0 - (1.0 - ASSURANCE) / f64::from(self.options.alarm.confirm_steps.max(1))
    }

    /// The size for which c consecutive instants up to number `k` all have what they require.
    fn confirmed(&self, ratios: &[f64], k: usize) -> f64 {
        let instants = self.options.alarm.confirm_steps.max(1) as usize;
        let Some(first) = (k + 1).checked_sub(instants) else {
            return f64::INFINITY;
        };
        let weakest = ratios
            .get(first..=k)
            .map_or(0.0, |ratios| ratios.iter().copied().fold(f64::INFINITY, f64::min));
        if weakest > 0.0 {
            weakest.sqrt().recip()
        } else {
            f64::INFINITY
        }
    }

    fn decides(&self, kind: StatisticKind) -> bool {
        self.options.statistics.decision.contains(&kind)
    }

    /// The deciding chi-square statistics after many instants without fault; `None` if none decides.
    fn settled_run(&self) -> Option<SteadyRun<'_>> {
        let pair = self.decides(StatisticKind::StateTwoPropagator);
        let design = EngineDesign {
            plain: self.decides(StatisticKind::StatePlain),
            pair_reset_steps: self.design.pair_reset_steps.filter(|_| pair),
            window_steps: match self.decides(StatisticKind::StateWindow) {
                true => self.design.window_steps.clone(),
                false => Vec::new(),
            },
            cusum_reference: None,
            glr: None,
            ..self.design.clone()
        };
        let settling = match (design.plain, design.pair_reset_steps, design.window_steps.last()) {
            (false, None, None) if !self.decides(StatisticKind::Residual) => return None,
            (false, None, longest) => longest.copied().unwrap_or(0),
            _ => SETTLING,
        };
        let mut run = SteadyRun::new(self.plant.models.first()?, design, self.steady);
        let zero = vec![0.0; self.design.measurements];
        (0..settling).for_each(|_| run.step(&zero));
        Some(run)
    }

    /// For each deciding chi-square statistic δ(k) of a unit fault over what is required.
    fn chi_square_ratios(&self, component: usize, mut run: SteadyRun<'_>) -> Vec<Vec<f64>> {
        let mut required: BTreeMap<(usize, usize), f64> = BTreeMap::new();
        let probability = self.probability();
        let mut series: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for z in self.responses(component) {
            run.step(&z);
            let outcome = &run.engine.outcome;
            let windows = outcome
                .windows()
                .map(|(steps, window)| (3 + steps, &self.thresholds.window, window));
            let others = [
                (
                    0,
                    &self.thresholds.residual,
                    outcome.residual,
                    StatisticKind::Residual,
                ),
                (
                    1,
                    &self.thresholds.plain,
                    outcome.plain,
                    StatisticKind::StatePlain,
                ),
                (
                    2,
                    &self.thresholds.pair,
                    outcome.pair,
                    StatisticKind::StateTwoPropagator,
                ),
            ];
            let others = others.into_iter().filter(|(.., kind)| self.decides(*kind));
            let all = others
                .map(|(number, list, statistic, _)| (number, list, statistic))
                .chain(windows);
            for (number, list, statistic) in all {
                let degrees = statistic.degrees;
                let needed = *required.entry((number, degrees)).or_insert_with(|| {
                    let threshold = list.get(degrees).copied().unwrap_or(f64::INFINITY);
                    required_non_centrality(threshold, degrees, probability).unwrap_or(f64::INFINITY)
                });
                series.entry(number).or_default().push(statistic.value / needed);
            }
        }
        series.into_values().collect()
    }

    /// What a unit fault adds to the measurements, instant by instant.
    fn responses(&self, component: usize) -> Vec<Vec<f64>> {
        let measurements = self.design.measurements;
        let unit = |i: usize| f64::from(u8::from(i == component));
        let process = component.checked_sub(measurements).zip(self.design.glr.as_ref());
        let (Some((column, glr)), Some(model)) = (process, self.plant.models.first()) else {
            return vec![(0..measurements).map(unit).collect(); HORIZON];
        };
        let (phi, h) = (model.transition.to_dense(), model.measurement.to_dense());
        let entry: DVector<f64> = glr.entry.to_dense().column(column).into_owned();
        let feedthrough: DVector<f64> = glr.feedthrough.to_dense().column(column).into_owned();
        let mut state = DVector::zeros(entry.len());
        (0..HORIZON)
            .map(|_| {
                state = &phi * &state + &entry;
                (&h * &state + &feedthrough).as_slice().to_vec()
            })
            .collect()
    }

    /// What a unit step of the component gives the likelihood ratio over what it requires.
    fn likelihood_ratios(&self, component: usize, signatures: &[DMatrix<f64>]) -> Option<Vec<f64>> {
        let glr = self.design.glr.as_ref()?;
        let mode = self.deciding_step_mode(component)?;
        let needed = required_non_centrality(self.thresholds.glr, 1, self.probability())?;
        let signatures: Vec<DVector<f64>> = signatures.iter().map(|g| g.column(mode).into_owned()).collect();
        let [window, stride] = [glr.window_steps, glr.stride.max(1)].map(|steps| steps as usize);
        let mut ratios = worst_non_centralities(&signatures, window, stride);
        ratios.iter_mut().for_each(|ratio| *ratio /= needed);
        Some(ratios)
    }

    /// The mode of a step of the component, if the likelihood ratio decides and looks for it.
    fn deciding_step_mode(&self, component: usize) -> Option<usize> {
        let glr = self
            .design
            .glr
            .as_ref()
            .filter(|_| self.decides(StatisticKind::Glr))?;
        let step =
            |mode: &super::FaultMode| mode.component == component && mode.profile == FaultProfile::Step;
        glr.modes.iter().position(step)
    }

    /// Whether a deciding test has a formula for constant faults of the component.
    pub fn has_formula(&self, component: usize) -> bool {
        let chi_square = [
            StatisticKind::Residual,
            StatisticKind::StatePlain,
            StatisticKind::StateWindow,
            StatisticKind::StateTwoPropagator,
        ];
        chi_square.into_iter().any(|kind| self.decides(kind)) || self.deciding_step_mode(component).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The signature of a sensor step in a filter that takes it for real bit by bit: g(a) = 0.8ᵃ.
    fn fading() -> Vec<DVector<f64>> {
        (0..HORIZON)
            .map(|age| DVector::from_element(1, 0.8_f64.powi(age as i32)))
            .collect()
    }

    #[test]
    fn with_a_slot_at_every_onset_the_energy_of_the_signature_counts_while_the_slot_lives() {
        let found = worst_non_centralities(&fading(), 10, 1);
        let mut energy = 0.0;
        for (k, found) in found.iter().take(10).enumerate() {
            energy += 0.64_f64.powi(k as i32);
            assert!((found - energy).abs() < 1e-12, "{k}: {found} {energy}");
        }
        // Later slots see the rest of it: with g(a + i) = 0.8ⁱ g(a) that is 0.64ⁱ E, here i = 1, 2, ...
        for (i, found) in found.iter().skip(10).take(5).enumerate() {
            let rest = 0.64_f64.powi(i as i32 + 1) * energy;
            assert!((found - rest).abs() < 1e-12, "{i}: {found} {rest}");
        }
    }

    #[test]
    fn wider_strides_show_less() {
        let found = [1, 2, 4].map(|stride| worst_non_centralities(&fading(), 20, stride));
        for pair in found.windows(2) {
            for (narrow, wide) in pair[0].iter().zip(&pair[1]) {
                assert!(wide <= &(narrow * (1.0 + 1e-12)));
            }
        }
        assert!(found[2][5] > 0.3 * found[0][5] && found[2][5] < 0.99 * found[0][5]);
    }
}
