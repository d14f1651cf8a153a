//! The smallest constant faults that are detected with a stated probability, by non-centralities (method sheet 3).
//!
//! A unit fault gives each chi-square statistic a non-centrality δ(k), k instants after its onset, and the likelihood
//! ratio at the true onset the energy E(k); a fault of size f gives f²δ and f²E. The alarm needs c consecutive
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

/// Products of the signatures Σ g_i'g_j up to each age, q x q.
pub(super) fn signature_products(
    sensitivity: &Sensitivity<'_>,
    glr: &GlrDesign,
) -> Option<Vec<DMatrix<f64>>> {
    let model = sensitivity.plant.models.first()?;
    let design = EngineDesign {
        plain: false,
        pair_reset_steps: None,
        window_steps: Vec::new(),
        cusum_reference: None,
        glr: Some(GlrDesign {
            stride: glr.window_steps,
            ..glr.clone()
        }),
        ..sensitivity.design.clone()
    };
    let z = vec![0.0; design.measurements];
    let mut run = SteadyRun::new(model, design, sensitivity.steady);
    let mut sum = DMatrix::zeros(glr.modes.len(), glr.modes.len());
    let mut products = Vec::new();
    for _ in 0..glr.window_steps {
        run.step(&z);
        let g = run.engine.outcome.glr.as_ref()?.signature.to_dense();
        sum += g.tr_mul(&g);
        products.push(sum.clone());
    }
    Some(products)
}

impl Sensitivity<'_> {
    /// For each component and each number of instants 1 .. `HORIZON` after its onset the smallest constant fault that
    /// is detected by then; infinite if none.
    pub fn sizes(&self, products: Option<&[DMatrix<f64>]>) -> Vec<Vec<f64>> {
        let components = self.design.measurements + self.process_faults();
        let settled = self.settled_run();
        (0..components)
            .map(|component| {
                let mut ratios = match &settled {
                    Some(run) => self.chi_square_ratios(component, run.clone()),
                    None => Vec::new(),
                };
                ratios.extend(products.and_then(|products| self.likelihood_ratios(component, products)));
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

    /// E(k) of a step of the component over what the likelihood ratio requires; only if every onset has a slot.
    fn likelihood_ratios(&self, component: usize, products: &[DMatrix<f64>]) -> Option<Vec<f64>> {
        let glr = self.design.glr.as_ref().filter(|glr| glr.stride == 1)?;
        if !self.decides(StatisticKind::Glr) {
            return None;
        }
        let step =
            |mode: &super::FaultMode| mode.component == component && mode.profile == FaultProfile::Step;
        let mode = glr.modes.iter().position(step)?;
        let needed = required_non_centrality(self.thresholds.glr, 1, self.probability())?;
        let last = products.last()?[(mode, mode)];
        let energy = |k: usize| products.get(k).map_or(last, |products| products[(mode, mode)]);
        Some((0..HORIZON).map(|k| energy(k) / needed).collect())
    }
}
