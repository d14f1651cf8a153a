//! Random plants and what happens to them: truth, commands, faults, losses.

use super::case::{Case, Command, Loss, Noise, Uncertainty};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_diagnosis::unknown_input_filter::options::Initialisation;

/// Instants of one run.
pub const INSTANTS: usize = 140;

/// Signals of one run; entry k of `u` and `f` acts from instant k until instant k + 1.
pub struct Run {
    pub x: Vec<DVector<f64>>,
    pub f: Vec<DVector<f64>>,
    /// What arrives: NaN where it is lost.
    pub y: Vec<Vec<f64>>,
    pub u: Vec<Vec<f64>>,
}

/// A plant with a run of it.
pub struct Sample {
    pub model: ModelOptions,
    pub run: Run,
    pub fault_bound: Vec<f64>,
}

struct Source {
    rng: ChaCha8Rng,
    /// Share of every bound that is used: a little less than 1 where the filter does not bound rounding errors.
    share: f64,
}

impl Source {
    fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.rng.random_range(low..high)
    }

    fn chance(&mut self, probability: f64) -> bool {
        self.rng.random_bool(probability)
    }

    fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    fn magnitude(&mut self, low: f64, high: f64) -> f64 {
        10_f64.powf(self.uniform(low, high))
    }

    fn matrix(&mut self, rows: usize, columns: usize, density: f64) -> DMatrix<f64> {
        DMatrix::from_fn(rows, columns, |_, _| {
            if self.chance(density) {
                self.uniform(-1.0, 1.0)
            } else {
                0.0
            }
        })
    }

    /// A vector within `bound` of the given shape; `constant` is the direction that a constant one keeps.
    fn within(
        &mut self,
        bound: &DVector<f64>,
        noise: Noise,
        constant: &DVector<f64>,
        k: usize,
    ) -> DVector<f64> {
        let share = self.share;
        DVector::from_fn(bound.len(), |i, _| {
            let unit = match noise {
                Noise::Uniform => self.uniform(-1.0, 1.0),
                Noise::Vertex => self.sign(),
                Noise::Constant => constant[i],
                Noise::Square => constant[i] * if (k / 7).is_multiple_of(2) { 1.0 } else { -1.0 },
            };
            bound[i] * unit * share
        })
    }

    fn signs(&mut self, length: usize) -> DVector<f64> {
        DVector::from_fn(length, |_, _| self.sign())
    }
}

/// Builds the plant and the run of a case; `attempt` varies both.
pub fn sample(case: &Case, attempt: u64) -> Sample {
    let share = if case.outward_rounding { 1.0 } else { 1.0 - 1e-6 };
    let rng = ChaCha8Rng::seed_from_u64(
        case.seed
            .wrapping_add(attempt.wrapping_mul(0x9e37_79b9_7f4a_7c15)),
    );
    let mut source = Source { rng, share };
    let mut model = model(case, &mut source);
    let (run, fault_bound) = run(case, &model, &mut source);
    if case.input_box {
        let bound = |pick: fn(f64, f64) -> f64, start: f64| {
            (0..case.actuators)
                .map(|j| run.1.iter().fold(start, |most, u| pick(most, u[j])))
                .collect()
        };
        model.input_lower = Some(bound(f64::min, 0.0));
        model.input_upper = Some(bound(f64::max, 0.0));
    }
    if case.state_box {
        let bound = |pick: fn(f64, f64) -> f64| {
            (0..case.states)
                .map(|i| run.0.x.iter().fold(0.0, |most, x| pick(most, 1.1 * x[i])))
                .collect()
        };
        model.state_box_lower = Some(bound(f64::min));
        model.state_box_upper = Some(bound(f64::max));
    }
    Sample {
        model,
        run: run.0,
        fault_bound,
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().copied().collect())
        .collect()
}

fn matrix(rows: &[Vec<f64>], columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows.len(), columns, |i, j| rows[i][j])
}

fn model(case: &Case, source: &mut Source) -> ModelOptions {
    let (nx, ny, nu, nd) = (case.states, case.outputs, case.actuators, case.disturbances);
    let mut a = source.matrix(nx, nx, 0.7);
    if source.chance(0.3) {
        (0..nx).for_each(|i| a[(i, i)] = source.uniform(2.0, 6.0));
    }
    let norm = (0..nx).map(|i| a.row(i).abs().sum()).fold(1e-3, f64::max);
    a *= source.uniform(0.3, 1.02) / norm;
    let c = match source.rng.random_range(0..3) {
        0 => DMatrix::from_fn(ny, nx, |i, j| if i == j { 1.0 } else { 0.0 }),
        1 => source.matrix(ny, nx, 0.6),
        _ => source.matrix(ny, nx, 1.0),
    };
    let d = match source.rng.random_range(0..3) {
        0 if nd > 0 => DMatrix::from_diagonal(&DVector::from_fn(nx, |_, _| source.uniform(0.0, 1.0))),
        1 if nd > 0 => source.matrix(nx, nd, 0.5),
        _ => source.matrix(nx, nd, 1.0),
    };
    let mut bounds = |length: usize| -> Vec<f64> {
        let scale = source.magnitude(-3.0, 0.0);
        let zero = case.outward_rounding && source.chance(0.1);
        (0..length)
            .map(|_| {
                if zero {
                    0.0
                } else {
                    scale * source.uniform(0.1, 1.0)
                }
            })
            .collect()
    };
    let (w, v) = (bounds(d.ncols()), bounds(ny));
    let uncertain = !matches!(case.uncertainty, Uncertainty::None);
    let size = if uncertain {
        source.magnitude(-4.0, -1.5)
    } else {
        0.0
    };
    let a_plus = source.matrix(nx, nx, 0.6).abs() * size;
    ModelOptions {
        a: rows(&a),
        b: rows(&source.matrix(nx, nu, 0.8)),
        c: rows(&c),
        d: if d.ncols() == 0 { Vec::new() } else { rows(&d) },
        a_uncertainty: rows(&a_plus),
        disturbance_bound: w,
        measurement_noise_bound: v,
        initial_state_center: Some((0..nx).map(|_| source.uniform(-1.0, 1.0)).collect()),
        initial_state_radius: Some((0..nx).map(|_| source.magnitude(-2.0, 0.5)).collect()),
        ..ModelOptions::default()
    }
}

/// The faulty actuators of the two phases, and the faults themselves.
fn faults(case: &Case, source: &mut Source) -> Vec<DVector<f64>> {
    let nu = case.actuators;
    let mut f = vec![DVector::zeros(nu); INSTANTS];
    let order = if case.pairs { 2 } else { 1 };
    let phases = if case.two_faults {
        vec![(15, 50), (100, INSTANTS)]
    } else {
        vec![(15, INSTANTS)]
    };
    for (first, end) in phases {
        for _ in 0..source.rng.random_range(0..=order) {
            let (j, shape) = (source.rng.random_range(0..nu), source.rng.random_range(0..4));
            let size = source.sign() * source.magnitude(-2.0, 300_f64.log10());
            for (k, f) in f.iter_mut().enumerate().take(end).skip(first) {
                f[j] = match shape {
                    0 => size,
                    1 => size * source.uniform(-1.0, 1.0),
                    2 => size * (k - first) as f64 / INSTANTS as f64,
                    _ => size * if (k / 9).is_multiple_of(2) { 1.0 } else { 0.0 },
                };
            }
        }
    }
    f
}

/// Whether the bank starts from the initial box, which holds at instant 0: then that instant must arrive.
fn starts_from_box(case: &Case, model: &ModelOptions) -> bool {
    let strip = LinearModel::new(model, 0.1).unwrap().strip_gain().is_some();
    case.initialisation == Initialisation::Prior || !strip
}

type Signals = (Run, Vec<DVector<f64>>);

fn run(case: &Case, model: &ModelOptions, source: &mut Source) -> (Signals, Vec<f64>) {
    let (nx, nu, nd) = (case.states, case.actuators, model.disturbance_bound.len());
    let (a, b, c) = (matrix(&model.a, nx), matrix(&model.b, nu), matrix(&model.c, nx));
    let d = if nd == 0 {
        DMatrix::zeros(nx, 0)
    } else {
        matrix(&model.d, nd)
    };
    let a_plus = matrix(&model.a_uncertainty, nx);
    let w = DVector::from_column_slice(&model.disturbance_bound);
    let v = DVector::from_column_slice(&model.measurement_noise_bound);
    let f = faults(case, source);
    let radius = DVector::from_vec(model.initial_state_radius.clone().unwrap());
    let start = source.signs(nx);
    let mut x = vec![
        DVector::from_vec(model.initial_state_center.clone().unwrap())
            + source.within(&radius, case.noise, &start, 0),
    ];
    let (steady_w, steady_v) = (source.signs(nd), source.signs(v.len()));
    let feedback = source.matrix(nu, v.len(), 1.0) * 0.3;
    let level = DVector::from_fn(nu, |_, _| source.sign() * source.magnitude(-2.0, 0.5));
    let fixed_error = source.matrix(nx, nx, 1.0);
    let (mut measured, mut commands) = (Vec::new(), Vec::new());
    for k in 0..INSTANTS {
        let y = &c * &x[k] + source.within(&v, case.noise, &steady_v, k);
        let u = match case.command {
            Command::Constant => level.clone(),
            Command::Switching => &level * if (k / 11).is_multiple_of(2) { 1.0 } else { -1.0 },
            Command::Feedback => (-&feedback * &y).map(|u| u.clamp(-50.0, 50.0)),
        };
        let error = a_plus.map_with_location(|i, j, bound| {
            let unit = match case.uncertainty {
                Uncertainty::None => 0.0,
                Uncertainty::Constant => fixed_error[(i, j)],
                Uncertainty::Vertex => fixed_error[(i, j)].signum(),
                Uncertainty::Varying => source.sign(),
            };
            bound * unit * source.share
        });
        let disturbance = source.within(&w, case.noise, &steady_w, k);
        x.push((&a + error) * &x[k] + &b * (&u + &f[k]) + &d * disturbance);
        measured.push(y);
        commands.push(u);
    }
    let lossy = case.loss;
    let rate = source.uniform(0.05, 0.4);
    let received = |source: &mut Source, values: &DVector<f64>, whole: bool, single: bool| -> Vec<f64> {
        let all_lost = whole && source.chance(rate);
        values
            .iter()
            .map(|&value| {
                if all_lost || single && source.chance(rate) {
                    f64::NAN
                } else {
                    value
                }
            })
            .collect()
    };
    let packets = matches!(lossy, Loss::Packets | Loss::Mixed);
    let sensors = matches!(lossy, Loss::Sensors | Loss::Mixed);
    let lost_commands = matches!(lossy, Loss::Commands | Loss::Mixed);
    let mut y: Vec<Vec<f64>> = measured
        .iter()
        .map(|y| received(source, y, packets, sensors))
        .collect();
    let mut u: Vec<Vec<f64>> = commands
        .iter()
        .map(|u| received(source, u, lost_commands, false))
        .collect();
    if starts_from_box(case, model) {
        (y[0], u[0]) = (measured[0].as_slice().to_vec(), commands[0].as_slice().to_vec());
    }
    let fault_bound = (0..nu)
        .map(|j| f.iter().fold(0.0, |most: f64, f| most.max(f[j].abs())))
        .collect();
    ((Run { x, f, y, u }, commands), fault_bound)
}
