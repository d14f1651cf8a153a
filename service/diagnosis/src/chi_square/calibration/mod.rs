//! Thresholds per run by simulation without a plant (method sheet 3, threshold rules 2 and 3).
//!
//! Without fault e is independent and N(0, I), and every statistic is a function of e and of gains that no data
//! enter. The gains of a run are computed once (`gains`), then synthetic e are fed through them (`simulation`);
//! the (1 - x) quantile of a statistic's maximum over the run is its threshold.

mod gains;
mod simulation;

use super::{
    engine::EngineDesign,
    error::ChiSquareError,
    model_options::Schedule,
    options::{ChiSquareOptions, StatisticKind, ThresholdMode},
    plant::Plant,
    quantile::chi_square_upper_quantile,
    thresholds::Calibrated,
};
use gains::RunGains;
use simulation::simulate;

/// Rate up to which quantiles are simulated; smaller ones are extrapolated.
const SIMULATED_RATE: f64 = 0.05;
/// Bisections of the common share; each halves an interval inside (0, 1).
const BISECTIONS: usize = 60;

/// The maxima over every simulated run, one list per statistic.
#[derive(Clone, Debug, PartialEq)]
pub struct Calibration {
    /// The statistics.
    pub statistics: Vec<StatisticKind>,
    /// Their largest values in each run; chi-square statistics divided by their threshold per instant.
    pub maxima: Vec<Vec<f64>>,
    /// The same in ascending order.
    ascending: Vec<Vec<f64>>,
}

impl Calibration {
    fn new(statistics: Vec<StatisticKind>, maxima: Vec<Vec<f64>>) -> Self {
        let sorted = |values: &Vec<f64>| {
            let mut values = values.clone();
            values.sort_by(f64::total_cmp);
            values
        };
        let ascending = maxima.iter().map(sorted).collect();
        Self {
            statistics,
            maxima,
            ascending,
        }
    }

    /// The value that statistic number `index` exceeds in a share of the runs, interpolated between runs.
    pub fn quantile(&self, index: usize, share: f64) -> f64 {
        let Some(values) = self.ascending.get(index).filter(|values| !values.is_empty()) else {
            return f64::INFINITY;
        };
        let place = (values.len() - 1) as f64 * (1.0 - share.clamp(0.0, 1.0));
        let below = place.floor() as usize;
        let above = (below + 1).min(values.len() - 1);
        values[below] + (place - below as f64) * (values[above] - values[below])
    }

    /// The share of the runs in which any of these statistics exceeds its own quantile of `share`.
    pub fn joint_rate(&self, indices: &[usize], share: f64) -> f64 {
        let limits: Vec<f64> = indices.iter().map(|index| self.quantile(*index, share)).collect();
        let runs = self.maxima.first().map_or(0, Vec::len);
        let alarmed = |run: &usize| {
            let mut pairs = indices.iter().zip(&limits);
            pairs.any(|(index, limit)| self.maxima[*index][*run] > *limit)
        };
        (0..runs).filter(alarmed).count() as f64 / runs.max(1) as f64
    }

    /// The common share x with which several statistics together alarm in a part `rate` of the runs.
    pub fn common_share(&self, indices: &[usize], rate: f64) -> f64 {
        if indices.len() < 2 {
            return rate;
        }
        let (mut low, mut high) = (rate / indices.len() as f64, rate);
        for _ in 0..BISECTIONS {
            let middle = (low + high) / 2.0;
            if self.joint_rate(indices, middle) > rate {
                high = middle;
            } else {
                low = middle;
            }
        }
        low
    }
}

/// Which statistics need a simulation: (statistic, whether it decides).
pub(super) fn targets(options: &ChiSquareOptions) -> Vec<(StatisticKind, bool)> {
    let threshold = &options.threshold;
    let needs = |kind: StatisticKind, decides: bool| match kind {
        StatisticKind::Glr => !(threshold.glr > 0.0),
        StatisticKind::Cusum => !(threshold.cusum > 0.0),
        StatisticKind::StateWindow => {
            threshold.mode == ThresholdMode::PerRun && decides && !(threshold.bank > 0.0)
        }
        _ => threshold.mode == ThresholdMode::PerRun && decides,
    };
    let enabled = options.statistics.enabled.iter();
    enabled
        .map(|kind| (*kind, options.statistics.decision.contains(kind)))
        .filter(|(kind, decides)| needs(*kind, *decides))
        .collect()
}

/// Simulates what has no fixed threshold; the simulation comes along for inspection.
pub(super) fn calibrate(
    plant: &Plant,
    design: &EngineDesign,
    options: &ChiSquareOptions,
) -> Result<(Calibrated, Option<Calibration>), ChiSquareError> {
    let targets = targets(options);
    if targets.is_empty() {
        return Ok((Calibrated::default(), None));
    }
    if plant.schedule == Schedule::External {
        return Err(impossible(&targets));
    }
    let kinds: Vec<StatisticKind> = targets.iter().map(|(kind, _)| *kind).collect();
    let gains = RunGains::new(plant, design, options, &kinds)?;
    let maxima = simulate(&gains, &kinds, design, &options.threshold);
    let calibration = Calibration::new(kinds.clone(), maxima);
    let rate = options.threshold.run_false_alarm_probability;
    let simulated = rate.max(SIMULATED_RATE);
    let deciding: Vec<usize> = (0..targets.len()).filter(|index| targets[*index].1).collect();
    let share = calibration.common_share(&deciding, simulated);
    let bounds = targets.iter().enumerate().map(|(index, (kind, decides))| {
        let simulated_bound = calibration.quantile(index, if *decides { share } else { simulated });
        let further = (simulated / rate).ln() / slope(*kind, options, &gains);
        (*kind, simulated_bound + further)
    });
    Ok((
        Calibrated {
            bounds: bounds.collect(),
        },
        Some(calibration),
    ))
}

fn impossible(targets: &[(StatisticKind, bool)]) -> ChiSquareError {
    let kind = targets.first().map_or(StatisticKind::Glr, |(kind, _)| *kind);
    let key = match kind {
        StatisticKind::Glr => "threshold.glr",
        StatisticKind::Cusum => "threshold.cusum",
        StatisticKind::StateWindow => "threshold.bank",
        _ => "threshold.mode",
    };
    ChiSquareError::CalibrationImpossible {
        key,
        statistic: kind.name(),
    }
}

/// The slope of ln(rate) over the threshold between 5 % and 1 %, low end of what was seen (method sheet 3, rule 3);
/// of a chi-square statistic over λ/t_d with the degrees of freedom it has in the end.
fn slope(kind: StatisticKind, options: &ChiSquareOptions, gains: &RunGains) -> f64 {
    let reference = options.cusum.reference;
    let of_statistic = match kind {
        StatisticKind::Residual => 0.53,
        StatisticKind::StatePlain | StatisticKind::StateWindow | StatisticKind::StateTwoPropagator => 0.44,
        StatisticKind::Glr => 0.43,
        // Seen at ref 0.25 and 0.5; proportional to ref outside, where the theory of the random walk has 2 ref.
        StatisticKind::Cusum if reference <= 0.25 => 0.52 * reference / 0.25,
        StatisticKind::Cusum if reference >= 0.5 => 0.93 * reference / 0.5,
        StatisticKind::Cusum => 0.52 + (0.93 - 0.52) * (reference - 0.25) / 0.25,
    };
    match gains.final_degrees(kind) {
        Some(degrees) => {
            of_statistic * chi_square_upper_quantile(options.threshold.false_alarm_probability, degrees)
        }
        None => of_statistic,
    }
}

#[cfg(test)]
mod tests;
