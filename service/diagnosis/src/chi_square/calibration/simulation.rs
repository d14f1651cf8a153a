//! Synthetic whitened innovations through the gains of a run, several runs side by side.

use super::gains::{InstantGains, RunGains, Whitening};
use crate::chi_square::{
    engine::EngineDesign,
    options::{StatisticKind, ThresholdOptions},
    random::Random,
};
use crate::matrix::Matrix;

/// Runs side by side: the compiler keeps them in vector registers.
const LANES: usize = 16;

type Lane = [f64; LANES];

/// The largest value of each statistic in each run; chi-square statistics divided by t_d.
pub(super) fn simulate(
    gains: &RunGains,
    kinds: &[StatisticKind],
    design: &EngineDesign,
    threshold: &ThresholdOptions,
) -> Vec<Vec<f64>> {
    let runs = threshold.calibration_runs;
    let mut maxima = vec![Vec::with_capacity(runs + LANES); kinds.len()];
    let mut random = Random::new(threshold.calibration_seed);
    while maxima
        .first()
        .is_some_and(|values: &Vec<f64>| values.len() < runs)
    {
        let mut batch = Batch::new(design);
        let mut best = vec![[0.0; LANES]; kinds.len()];
        for k in 1..=threshold.run_steps {
            batch.step(k, gains.at(k), kinds, &mut best, || random.normal());
        }
        for (values, best) in maxima.iter_mut().zip(&best) {
            values.extend_from_slice(best);
        }
    }
    maxima.iter_mut().for_each(|values| values.truncate(runs));
    maxima
}

/// The data of several runs: what the statistics remember of e.
struct Batch<'a> {
    design: &'a EngineDesign,
    e: Vec<Lane>,
    correction: Vec<Lane>,
    plain: Vec<Lane>,
    /// Differences of the pair, and which one is in use.
    pair: [Vec<Lane>; 2],
    second_in_use: bool,
    /// e of the last instants, that of instant k at k modulo the length.
    history: Vec<Vec<Lane>>,
    upper: Vec<Lane>,
    lower: Vec<Lane>,
    /// A, slot by slot.
    score: Vec<Lane>,
    scratch: Vec<Lane>,
    moved: Vec<Lane>,
}

impl<'a> Batch<'a> {
    fn new(design: &'a EngineDesign) -> Self {
        let lanes = |count: usize| vec![[0.0; LANES]; count];
        let (n, m) = (design.states, design.measurements);
        let columns = design.glr.as_ref().map_or(0, |glr| glr.slots() * glr.modes.len());
        Self {
            design,
            e: lanes(m),
            correction: lanes(n),
            plain: lanes(n),
            pair: [lanes(n), lanes(n)],
            second_in_use: false,
            history: vec![lanes(m); design.window_steps.last().copied().unwrap_or(0)],
            upper: lanes(m),
            lower: lanes(m),
            score: lanes(columns),
            scratch: lanes(n),
            moved: lanes(n),
        }
    }

    /// One instant of every run: draws e and raises `best` where a statistic exceeds it.
    fn step(
        &mut self,
        k: usize,
        gains: &InstantGains,
        kinds: &[StatisticKind],
        best: &mut [Lane],
        mut draw: impl FnMut() -> f64,
    ) {
        self.e.iter_mut().flatten().for_each(|e| *e = draw());
        product(&gains.gain, &self.e, &mut self.correction);
        for (kind, best) in kinds.iter().zip(best) {
            match kind {
                StatisticKind::Residual => {
                    let mut squares = [0.0; LANES];
                    self.e.iter().for_each(|e| add_square(&mut squares, e));
                    raise(best, &squares, gains.inverse_residual);
                }
                StatisticKind::StatePlain => {
                    move_difference(
                        &gains.transition,
                        &mut self.plain,
                        &self.correction,
                        &mut self.moved,
                    );
                    if let Some(whitening) = &gains.plain {
                        raise_by_form(best, whitening, &self.plain);
                    }
                }
                StatisticKind::StateTwoPropagator => self.step_pair(k, gains, best),
                StatisticKind::StateWindow => self.step_windows(k, gains, best),
                StatisticKind::Cusum => self.step_cusum(gains, best),
                StatisticKind::Glr => self.step_glr(k, gains, best),
            }
        }
    }

    fn step_pair(&mut self, k: usize, gains: &InstantGains, best: &mut Lane) {
        let Some(reset_steps) = self.design.pair_reset_steps.map(|steps| steps as usize) else {
            return;
        };
        let past = k - 1;
        if past > 0 && past.is_multiple_of(reset_steps) {
            let restarted = usize::from(past == reset_steps || self.second_in_use);
            self.pair[restarted].fill([0.0; LANES]);
            if past > reset_steps {
                self.second_in_use = !self.second_in_use;
            }
        }
        for difference in &mut self.pair {
            move_difference(&gains.transition, difference, &self.correction, &mut self.moved);
        }
        if let Some(whitening) = &gains.pair {
            raise_by_form(best, whitening, &self.pair[usize::from(self.second_in_use)]);
        }
    }

    fn step_windows(&mut self, k: usize, gains: &InstantGains, best: &mut Lane) {
        let length = self.history.len();
        let newest = k % length.max(1);
        self.history[newest].copy_from_slice(&self.e);
        self.scratch.fill([0.0; LANES]);
        let mut age = 0;
        for (steps, whitening) in &gains.windows {
            while age < *steps && age < gains.window_gains.len() && age < k {
                let e = &self.history[(newest + length - age) % length];
                subtract_product(&gains.window_gains[age], e, &mut self.scratch);
                age += 1;
            }
            raise_by_form(best, whitening, &self.scratch);
        }
    }

    fn step_cusum(&mut self, gains: &InstantGains, best: &mut Lane) {
        let Some(reference) = self.design.cusum_reference else {
            return;
        };
        for (i, row) in gains.normalised.iter_rows().enumerate() {
            let mut c = [0.0; LANES];
            for (factor, e) in row.iter().zip(&self.e) {
                add(&mut c, *factor, e);
            }
            let (upper, lower) = (&mut self.upper[i], &mut self.lower[i]);
            for lane in 0..LANES {
                upper[lane] = (upper[lane] + c[lane] - reference).max(0.0);
                lower[lane] = (lower[lane] - c[lane] - reference).max(0.0);
                best[lane] = best[lane].max(upper[lane]).max(lower[lane]);
            }
        }
    }

    fn step_glr(&mut self, k: usize, gains: &InstantGains, best: &mut Lane) {
        let (Some(design), Some(gains)) = (&self.design.glr, &gains.glr) else {
            return;
        };
        let (slots, modes, stride) = (design.slots(), design.modes.len(), design.stride as usize);
        let newest = (k - 1) / stride % slots;
        if (k - 1).is_multiple_of(stride) {
            self.score[newest * modes..(newest + 1) * modes].fill([0.0; LANES]);
        }
        for rank in 0..slots.min((k - 1) / stride + 1) {
            let slot = (newest + slots - rank) % slots;
            for mode in 0..modes {
                let column = rank * modes + mode;
                let score = &mut self.score[slot * modes + mode];
                for (row, e) in gains.signature.iter_rows().zip(&self.e) {
                    add(score, row[column], e);
                }
                let inverse_energy = gains.inverse_energy[column];
                for lane in 0..LANES {
                    let value = score[lane] * score[lane] * inverse_energy;
                    best[lane] = if value > best[lane] { value } else { best[lane] };
                }
            }
        }
    }
}

fn add(sum: &mut Lane, factor: f64, x: &Lane) {
    for lane in 0..LANES {
        sum[lane] += factor * x[lane];
    }
}

fn add_square(sum: &mut Lane, x: &Lane) {
    for lane in 0..LANES {
        sum[lane] += x[lane] * x[lane];
    }
}

fn raise(best: &mut Lane, values: &Lane, scale: f64) {
    for lane in 0..LANES {
        best[lane] = best[lane].max(values[lane] * scale);
    }
}

/// `out` = `matrix` x.
fn product(matrix: &Matrix, x: &[Lane], out: &mut [Lane]) {
    for (out, row) in out.iter_mut().zip(matrix.iter_rows()) {
        *out = [0.0; LANES];
        row.iter().zip(x).for_each(|(factor, x)| add(out, *factor, x));
    }
}

/// `out` -= `matrix` x.
fn subtract_product(matrix: &Matrix, x: &[Lane], out: &mut [Lane]) {
    for (out, row) in out.iter_mut().zip(matrix.iter_rows()) {
        row.iter().zip(x).for_each(|(factor, x)| add(out, -factor, x));
    }
}

/// β ← Φ β - γ.
fn move_difference(transition: &Matrix, difference: &mut [Lane], correction: &[Lane], moved: &mut [Lane]) {
    product(transition, difference, moved);
    for ((difference, moved), correction) in difference.iter_mut().zip(&*moved).zip(correction) {
        for lane in 0..LANES {
            difference[lane] = moved[lane] - correction[lane];
        }
    }
}

/// ‖W β‖² / t_d.
fn raise_by_form(best: &mut Lane, whitening: &Whitening, difference: &[Lane]) {
    let mut value = [0.0; LANES];
    for row in whitening.rows.iter_rows() {
        let mut element = [0.0; LANES];
        row.iter()
            .zip(difference)
            .for_each(|(factor, x)| add(&mut element, *factor, x));
        add_square(&mut value, &element);
    }
    raise(best, &value, whitening.inverse_threshold);
}
