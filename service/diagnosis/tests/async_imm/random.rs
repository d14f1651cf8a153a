//! Random plants, sensors, modes, schedules and losses.

use crate::simulation::Draw;
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    design::{Form, ImmDesign, Mixing, Mode, ModeTransition, Prior, Sensor},
    estimator::{ImmEstimator, IntervalReport, Sample},
    inputs::InputHistory,
    plant::{LinearPlant, Plant},
    state::Posterior,
};

/// A sample: time (ns), sensor, values.
pub type Taken = (i64, usize, Vec<f64>);

pub fn random_matrix(draw: &mut Draw, rows: usize, columns: usize) -> DMatrix<f64> {
    DMatrix::from_fn(rows, columns, |_, _| draw.normal())
}

/// A random positive definite matrix.
pub fn random_covariance(draw: &mut Draw, n: usize, size: f64) -> DMatrix<f64> {
    let root = random_matrix(draw, n, n);
    let spread = (&root * root.transpose() + DMatrix::identity(n, n) * 0.1) * size;
    (&spread + spread.transpose()) / 2.0
}

/// A random generator of mode changes.
pub fn random_rates(draw: &mut Draw, modes: usize) -> DMatrix<f64> {
    let mut gamma = DMatrix::from_fn(modes, modes, |_, _| 0.2 * draw.uniform());
    for i in 0..modes {
        gamma[(i, i)] = 0.0;
        gamma[(i, i)] = -gamma.row(i).sum();
    }
    gamma
}

/// A random design with n_x <= 6, M <= 6 and ‖A‖T <= 1 for T = 1 s that passes the checks.
pub fn random_design(draw: &mut Draw) -> ImmDesign {
    loop {
        let design = attempt(draw);
        if ImmEstimator::new(&design, 1).is_ok() {
            return design;
        }
    }
}

fn attempt(draw: &mut Draw) -> ImmDesign {
    let nx = 1 + draw.below(6);
    let channels = 1 + draw.below(nx.min(5));
    let simultaneous = channels <= 2 && draw.below(2) == 0;
    let a = random_matrix(draw, nx, nx);
    let a = &a / a.norm().max(1e-3) * draw.uniform();
    let sensors = (0..1 + draw.below(3)).map(|s| {
        let d = 1 + draw.below(2);
        Sensor {
            name: format!("sensor {s}"),
            measurement_matrix: random_matrix(draw, d, nx),
            noise_covariance: random_covariance(draw, d, 0.5),
            arrival_probability: 0.3 + 0.7 * draw.uniform(),
            initial_held_value: None,
        }
    });
    let sensors = sensors.collect();
    let directions = if simultaneous {
        let bits = 0..1_usize << channels;
        let diagonal = |bits: usize| {
            DMatrix::from_fn(channels, channels, |i, j| {
                f64::from(u8::from(i == j && bits >> i & 1 == 1))
            })
        };
        bits.map(diagonal).collect::<Vec<_>>()
    } else {
        let unit = |m: usize| DMatrix::from_fn(channels, 1, |i, _| f64::from(u8::from(i + 1 == m)));
        (0..=channels).map(unit).collect()
    };
    let (modes, slots) = (directions.len(), directions[0].ncols());
    let inputs = draw.below(3);
    let weights: Vec<f64> = (0..modes).map(|_| 0.1 + draw.uniform()).collect();
    let total: f64 = weights.iter().sum();
    let noises = 1 + draw.below(nx);
    let noise = random_matrix(draw, nx, noises) * 0.3;
    ImmDesign {
        plant: Plant::Constant(LinearPlant {
            a,
            b: random_matrix(draw, nx, inputs),
            f: random_matrix(draw, nx, channels),
            noise: &noise * noise.transpose(),
        }),
        sensors,
        modes: directions
            .into_iter()
            .enumerate()
            .map(|(m, direction)| Mode {
                name: format!("mode {m}"),
                direction,
                random_walk_psd: vec![0.0; slots],
            })
            .collect(),
        prior: Prior {
            state: (0..nx).map(|_| draw.normal()).collect(),
            state_covariance: random_covariance(draw, nx, 1.0),
            amplitude: (0..slots).map(|_| 0.3 * draw.normal()).collect(),
            amplitude_covariance: random_covariance(draw, slots, 1.0),
            mode_probability: weights.iter().map(|weight| weight / total).collect(),
        },
        transition: ModeTransition::Rate(random_rates(draw, modes)),
        form: Form::Sequential,
        mixing: if draw.below(2) == 0 {
            Mixing::All
        } else {
            Mixing::SharedChannel
        },
    }
}

/// Fusion instants of random spacing, about 1 s apart, ns.
pub fn random_instants(draw: &mut Draw, count: usize) -> Vec<i64> {
    let mut time = 0;
    let mut next = || {
        time += (1_000_000.0 * (0.2 + draw.uniform())) as i64 * 1000;
        time
    };
    (0..count).map(|_| next()).collect()
}

/// Samples at different random times up to `end_ns`, in order.
pub fn random_samples(draw: &mut Draw, design: &ImmDesign, count: usize, end_ns: i64) -> Vec<Taken> {
    let mut times: Vec<i64> = (0..count)
        .map(|_| 1000 * (1.0 + draw.uniform() * (end_ns / 1000 - 1) as f64) as i64)
        .collect();
    times.sort_unstable();
    times.dedup();
    let sample = |time_ns: i64| {
        let sensor = draw.below(design.sensors.len());
        let d = design.sensors[sensor].measurement_matrix.nrows();
        (time_ns, sensor, (0..d).map(|_| 2.0 * draw.normal()).collect())
    };
    times.into_iter().map(sample).collect()
}

/// Commands that change at random times.
pub fn random_commands(draw: &mut Draw, design: &ImmDesign, end_ns: i64) -> InputHistory {
    let inputs = design.plant.sizes().1;
    let mut value = || (0..inputs).map(|_| draw.normal()).collect::<Vec<_>>();
    let base = value();
    let changes: Vec<_> = (1..6).map(|i| (end_ns / 6 / 1000 * 1000 * i, value())).collect();
    InputHistory::with_changes(&base, &changes)
}

/// Runs an estimator; `see` sees every posterior and its log-likelihoods.
pub fn run(
    design: &ImmDesign,
    samples: &[Taken],
    instants: &[i64],
    commands: &InputHistory,
    mut see: impl FnMut(&Posterior, &[f64], IntervalReport),
) {
    let mut estimator = ImmEstimator::new(design, samples.len()).unwrap();
    let mut posterior = estimator.start(0);
    for &instant in instants {
        let begin = posterior.instant_ns;
        let own = samples
            .iter()
            .filter(|(time, ..)| begin < *time && *time <= instant);
        let own = own.map(|(time_ns, sensor, values)| Sample {
            time_ns: *time_ns,
            sensor: *sensor,
            values,
            held_before: None,
        });
        let report = estimator.advance(&mut posterior, instant, own, commands);
        see(&posterior, estimator.log_likelihood(), report);
    }
}

/// Means, covariances, probabilities and log-likelihoods of a whole run, mode by mode.
pub fn trace(
    design: &ImmDesign,
    samples: &[Taken],
    instants: &[i64],
    commands: &InputHistory,
) -> Vec<Vec<f64>> {
    let mut out = Vec::new();
    run(
        design,
        samples,
        instants,
        commands,
        |posterior, log_likelihood, report| {
            assert_eq!(report.update_rejected, 0);
            for (m, mode) in posterior.modes.iter().enumerate() {
                let spread = mode.spread.to_dense();
                let covariance = match design.form {
                    Form::SequentialSquareRoot => &spread * spread.transpose(),
                    _ => spread,
                };
                let tail = [posterior.log_probability[m].exp(), log_likelihood[m]];
                out.push([&mode.mean, covariance.as_slice(), &tail].concat());
            }
        },
    );
    out
}

/// Fails unless two traces agree to `tolerance` of the largest entry of each line.
pub fn assert_traces(what: &str, one: &[Vec<f64>], other: &[Vec<f64>], tolerance: f64) {
    assert_eq!(one.len(), other.len());
    for (line, (one, other)) in one.iter().zip(other).enumerate() {
        crate::support::assert_close(&format!("{what}, line {line}"), one, other, tolerance);
    }
}
