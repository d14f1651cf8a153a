//! The guaranteed thresholds, instant by instant (method sheet 4.1, items 3, 4 and 7).

use super::{
    constants::{ErrorModel, ThresholdConstants},
    gap::GapEnvelope,
    noise::NoiseBound,
    problem::InitialError,
    rounding::{Magnitudes, Rounding},
    window_energy::WindowEnergy,
};
use crate::matrix::{Matrix, absolute_dot, dot, multiply};
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// The initial error is forgotten when it adds less than this part of the disturbance's bound.
const EXTINGUISHED: f64 = 1e-12;

/// One model that may be the true plant.
#[derive(Clone, Debug)]
struct ModelBounds {
    a: Matrix,
    bu: Option<Matrix>,
    c: Matrix,
    /// J: how e₀ enters, dim x n.
    j: Matrix,
    /// ρ_d.
    disturbance: Vec<f64>,
    /// ρ_d + ρ_s.
    constant: Vec<f64>,
    /// J_d + J_s.
    energy: f64,
    /// Largest root energy of the initial error's response; infinite for a box.
    initial_limit: f64,
}

/// ē or ε.
#[derive(Clone, Debug)]
enum Initial {
    Box(Vec<f64>),
    Ball(f64),
}

/// Constants of the thresholds of one filter.
#[derive(Clone, Debug)]
pub(super) struct Bounds {
    models: Vec<ModelBounds>,
    initial: Initial,
    gap_rate: f64,
    gap: Matrix,
    /// ρ_n, zero without noise.
    noise: Vec<f64>,
    /// J_n.
    noise_energy: f64,
    /// Whether ρ bounds every sample (amplitudes of d are declared), so that its window bounds the energy.
    by_amplitude: bool,
    rounding: Rounding,
    tested: usize,
    work: Work,
}

#[derive(Clone, Debug)]
struct Work {
    product: Vec<Matrix>,
    from_start: Matrix,
    next: Vec<f64>,
    initial: Vec<f64>,
    command: Vec<f64>,
    all: Vec<f64>,
}

/// What changes from instant to instant.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BoundsState {
    models: Vec<ModelState>,
    /// b: what lost samples may still do, per row.
    gap: Vec<f64>,
    gap_window: WindowEnergy,
    /// What rounding errors may do, per row.
    rounding: Vec<f64>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct ModelState {
    /// S = C Aᵏ.
    s: Matrix,
    extinguished: bool,
    /// Predicted state, driven by the commands alone; empty for the nominal model.
    x: Vec<f64>,
    all: WindowEnergy,
    initial: WindowEnergy,
    command: WindowEnergy,
}

/// What a filter is made of, for its bounds.
pub(super) struct BoundsDesign<'a> {
    pub models: &'a [(ErrorModel, ThresholdConstants)],
    pub initial: InitialError,
    pub gap: &'a GapEnvelope,
    pub noise: Option<&'a NoiseBound>,
    pub by_amplitude: bool,
    pub tested: usize,
    pub window: Option<usize>,
    /// |V|, |C|, |D|, |Ad|, |Bud|, |L| for the bound of rounding errors.
    pub absolute: [DMatrix<f64>; 6],
}

/// How windows become thresholds.
#[derive(Clone, Copy, Debug)]
pub(super) struct WindowRule {
    /// Ts, s.
    pub sample_time_s: f64,
    pub include_current: bool,
}

impl WindowRule {
    /// Root energy of a window that takes `value`, by the configured convention.
    pub fn root(self, window: &mut WindowEnergy, value: f64) -> f64 {
        let before = window.sum();
        let after = window.push(value);
        let sum = if self.include_current { after } else { before };
        (self.sample_time_s * sum).sqrt()
    }
}

fn vector(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    values.into_iter().collect()
}

fn squares(values: &[f64]) -> f64 {
    dot(values, values)
}

impl Bounds {
    pub fn new(design: &BoundsDesign<'_>) -> (Self, BoundsState) {
        let rows = design.gap.envelope.nrows();
        let models: Vec<_> = design
            .models
            .iter()
            .map(|(model, constants)| ModelBounds {
                a: Matrix::from(&model.a),
                bu: model.bu.as_ref().map(Matrix::from),
                c: Matrix::from(&model.c),
                j: Matrix::from(&model.j),
                disturbance: vector(constants.amplitude.iter().copied()),
                constant: vector((&constants.amplitude + &constants.slew).iter().copied()),
                energy: constants.energy + constants.slew_energy,
                initial_limit: match design.initial {
                    InitialError::Ball(radius) => constants.initial_gain * radius,
                    InitialError::Box(_) => f64::INFINITY,
                },
            })
            .collect();
        let states = models
            .iter()
            .map(|model| ModelState {
                s: model.c.clone(),
                extinguished: false,
                x: vec![0.0; model.bu.as_ref().map_or(0, Matrix::rows)],
                all: WindowEnergy::new(design.window),
                initial: WindowEnergy::new(design.window),
                command: WindowEnergy::new(design.window),
            })
            .collect();
        let n = design.models[0].0.j.ncols();
        let largest = models.iter().map(|model| model.a.rows()).max().unwrap_or(0);
        let bounds = Self {
            work: Work {
                product: models
                    .iter()
                    .map(|model| Matrix::zeros(rows, model.a.columns()))
                    .collect(),
                from_start: Matrix::zeros(rows, n),
                next: vec![0.0; largest],
                initial: vec![0.0; rows],
                command: vec![0.0; rows],
                all: vec![0.0; rows],
            },
            rounding: Rounding::new(&design.absolute, &design.models[0].1.state_gain),
            initial: match &design.initial {
                InitialError::Box(bound) => Initial::Box(vector(bound.iter().copied())),
                InitialError::Ball(radius) => Initial::Ball(*radius),
            },
            gap_rate: design.gap.rate,
            gap: Matrix::from(&design.gap.envelope),
            noise: design
                .noise
                .map_or_else(|| vec![0.0; rows], |noise| vector(noise.peak.iter().copied())),
            noise_energy: design.noise.map_or(0.0, |noise| noise.energy),
            by_amplitude: design.by_amplitude,
            tested: design.tested,
            models,
        };
        let state = BoundsState {
            models: states,
            gap: vec![0.0; rows],
            gap_window: WindowEnergy::new(design.window),
            rounding: vec![0.0; rows],
        };
        (bounds, state)
    }

    /// Puts the state back to the first instant, the predicted plant at `x` (x̂₀).
    pub fn start(&self, state: &mut BoundsState, x: &[f64]) {
        for (model, state) in self.models.iter().zip(&mut state.models) {
            state.s.copy_from(&model.c);
            state.extinguished = false;
            // The joint state of a listed model is (x̂₀, 0).
            for (i, value) in state.x.iter_mut().enumerate() {
                *value = x.get(i).copied().unwrap_or(0.0);
            }
            state.all.clear();
            state.initial.clear();
            state.command.clear();
        }
        state.gap.fill(0.0);
        state.gap_window.clear();
        state.rounding.fill(0.0);
    }

    /// ρ of this instant into `rho` (all rows), and the threshold of the energy.
    pub fn evaluate(
        &mut self,
        state: &mut BoundsState,
        sample: &Magnitudes<'_>,
        rule: WindowRule,
        rho: &mut [f64],
    ) -> f64 {
        self.rounding.update(&mut state.rounding, sample, self.gap_rate);
        let tested = self.tested;
        let work = &mut self.work;
        let gap_energy: f64 = state
            .gap
            .iter()
            .zip(&state.rounding)
            .take(tested)
            .map(|(gap, rounding)| (gap + rounding).powi(2))
            .sum();
        let gap_root = rule.root(&mut state.gap_window, gap_energy);
        rho.fill(0.0);
        let mut threshold = 0.0_f64;
        for (model, present) in self.models.iter().zip(&mut state.models) {
            self.initial.bound(model, present, work);
            work.command.fill(0.0);
            if !present.x.is_empty() {
                for (value, row) in work.command.iter_mut().zip(model.c.iter_rows()) {
                    *value = dot(row, &present.x);
                }
            }
            for (i, rho) in rho.iter_mut().enumerate() {
                work.all[i] = model.constant[i]
                    + work.initial[i]
                    + work.command[i].abs()
                    + state.gap[i]
                    + state.rounding[i];
                *rho = rho.max(work.all[i] + self.noise[i]);
            }
            let by_samples = rule.root(&mut present.all, squares(&work.all[..tested]));
            let initial = rule.root(&mut present.initial, squares(&work.initial[..tested]));
            let command = rule.root(&mut present.command, squares(&work.command[..tested]));
            let by_norm = model.energy + initial.min(model.initial_limit) + command + gap_root;
            threshold = threshold.max(if self.by_amplitude {
                by_samples.min(by_norm)
            } else {
                by_norm
            });
        }
        threshold + self.noise_energy
    }

    /// Goes on to the next instant; `rho` is the bound of this instant's residual, needed if its sample was lost.
    pub fn advance(&mut self, state: &mut BoundsState, u: &[f64], lost: bool, rho: &[f64]) {
        for (i, gap) in state.gap.iter_mut().enumerate() {
            *gap *= self.gap_rate;
            if lost {
                *gap += dot(self.gap.row(i), rho);
            }
        }
        for (v, (model, present)) in self.models.iter().zip(&mut state.models).enumerate() {
            if !present.extinguished {
                let product = &mut self.work.product[v];
                multiply(&present.s, &model.a, product);
                std::mem::swap(&mut present.s, product);
            }
            if let Some(bu) = &model.bu {
                let next = &mut self.work.next[..present.x.len()];
                for (i, value) in next.iter_mut().enumerate() {
                    *value = dot(model.a.row(i), &present.x) + dot(bu.row(i), u);
                }
                present.x.copy_from_slice(next);
            }
        }
    }

    /// Largest ρ per row in fault-free operation long after the start and without commands.
    pub fn settled(&self) -> Vec<f64> {
        let rows = self.noise.len();
        vector((0..rows).map(|i| {
            self.models
                .iter()
                .map(|model| model.constant[i] + self.noise[i])
                .fold(0.0, f64::max)
        }))
    }

    /// The threshold of the energy in a window of `length` seconds long after the start and without commands.
    pub fn settled_energy(&self, length: f64) -> f64 {
        let thresholds = self.models.iter().map(|model| {
            let by_samples = (length * squares(&model.constant[..self.tested])).sqrt();
            match self.by_amplitude {
                true => by_samples.min(model.energy),
                false => model.energy,
            }
        });
        thresholds.fold(0.0, f64::max) + self.noise_energy
    }
}

impl Initial {
    /// ρ_e into `work.initial`; forgets the initial error once it is negligible.
    fn bound(&self, model: &ModelBounds, present: &mut ModelState, work: &mut Work) {
        work.initial.fill(0.0);
        if present.extinguished {
            return;
        }
        multiply(&present.s, &model.j, &mut work.from_start);
        let mut negligible = true;
        for (i, value) in work.initial.iter_mut().enumerate() {
            let row = work.from_start.row(i);
            *value = match self {
                Self::Box(bound) => absolute_dot(row, bound),
                Self::Ball(radius) => squares(row).sqrt() * radius,
            };
            negligible &= *value < (EXTINGUISHED * model.disturbance[i]).max(f64::MIN_POSITIVE);
        }
        if negligible {
            present.extinguished = true;
            present.s.fill(0.0);
        }
    }
}

impl BoundsState {
    /// Whether every number is finite.
    pub fn is_sound(&self) -> bool {
        let finite = crate::matrix::all_finite;
        finite(&self.gap)
            && finite(&self.rounding)
            && self.gap_window.sum().is_finite()
            && self.models.iter().all(|model| {
                finite(&model.x)
                    && model.all.sum().is_finite()
                    && model.initial.sum().is_finite()
                    && model.command.sum().is_finite()
            })
    }

    pub fn fits(&self, other: &Self) -> bool {
        self.gap.len() == other.gap.len()
            && self.rounding.len() == other.rounding.len()
            && self.gap_window.fits(&other.gap_window)
            && self.models.len() == other.models.len()
            && self.models.iter().zip(&other.models).all(|(model, other)| {
                model.s.has_room_of(&other.s)
                    && model.s.shape() == other.s.shape()
                    && model.s.iter_rows().all(crate::matrix::all_finite)
                    && model.x.len() == other.x.len()
                    && model.all.fits(&other.all)
                    && model.initial.fits(&other.initial)
                    && model.command.fits(&other.command)
            })
    }
}
