//! Time and certainty of the syntheses by matrix inequalities on random plants.
//!
//! `cargo bench -p residual-benches --bench synthesis` prints a table: order n of the plant, problem, median and
//! longest processor time over the plants, most iterations, least margin of the certificates (smallest eigenvalue of the
//! strict inequality with a unit diagonal; none where the synthesis returns no certificate), the solver's words. With
//! `--quick`: three plants of each order up to 6.
#![allow(missing_docs, clippy::unwrap_used)]

use nalgebra::DMatrix;
use nix::time::{ClockId, clock_gettime};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::{
    decomposition::eigenvalues,
    gains::SolverRun,
    hinf_filter::{bounded_real, plant::zoh},
    norms::System,
};
use residual_synthesis::hinf_filter::lmi::{
    ErrorPlant, LmiError, LmiGain, Normalisation, Region, Time, mixed, paper, two_stage_continuous,
    two_stage_discrete,
};
use std::{collections::BTreeSet, time::Duration};

const ORDERS: [usize; 5] = [2, 4, 6, 8, 12];
const SAMPLE_TIME_S: f64 = 0.1;
const SLACK: f64 = 0.01;

struct Plant {
    a: DMatrix<f64>,
    bd: DMatrix<f64>,
    c: DMatrix<f64>,
    dd: DMatrix<f64>,
    bf: DMatrix<f64>,
    df: DMatrix<f64>,
}

impl Plant {
    /// A stable plant with 1 + n/3 outputs, a disturbance for each of them and two more, and one fault.
    fn random(seed: u64, n: usize) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut entries = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..1.0))
        };
        let q = 1 + n.div_ceil(3);
        let a = entries(n, n) * (1.0 + 2.0 / (n as f64).sqrt());
        let rightmost = eigenvalues(&a)
            .unwrap()
            .iter()
            .map(|pole| pole.re)
            .fold(f64::NEG_INFINITY, f64::max);
        Self {
            a: a - DMatrix::identity(n, n) * (rightmost + 0.3),
            bd: entries(n, q + 2),
            c: entries(q, n),
            dd: entries(q, q + 2) * 0.5,
            bf: entries(n, 1),
            df: entries(q, 1),
        }
    }

    fn error(&self) -> ErrorPlant<'_> {
        ErrorPlant {
            a: &self.a,
            bd: &self.bd,
            c: &self.c,
            dd: &self.dd,
        }
    }

    fn sampled(self) -> Self {
        let (a, bd) = zoh(&self.a, &self.bd, SAMPLE_TIME_S);
        Self { a, bd, ..self }
    }
}

/// What one synthesis took, and its margin if it has a certificate.
type Outcome = Result<(Vec<SolverRun>, Option<f64>), LmiError>;

fn margin(time: Time, plant: &Plant, found: &LmiGain) -> f64 {
    let a = &plant.a - &found.gain * &plant.c;
    let b = &plant.bd - &found.gain * &plant.dd;
    let system = System::new(&a, &b, &plant.c, &plant.dd);
    bounded_real::margin(&system, time, &found.lyapunov, found.bound)
}

fn continuous(seed: u64, n: usize) -> Outcome {
    let plant = Plant::random(seed, n);
    let found = two_stage_continuous(&plant.error(), &Region::default(), SLACK)?;
    let margin = margin(Time::Continuous, &plant, &found);
    Ok((found.runs, Some(margin)))
}

fn discrete(seed: u64, n: usize) -> Outcome {
    let plant = Plant::random(seed, n).sampled();
    let found = two_stage_discrete(&plant.error(), &Region::default(), SLACK)?;
    let margin = margin(Time::Discrete, &plant, &found);
    Ok((found.runs, Some(margin)))
}

fn region(seed: u64, n: usize) -> Outcome {
    let plant = Plant::random(seed, n);
    let region = Region {
        decay: Some(0.5),
        radius: Some(40.0),
    };
    let found = two_stage_continuous(&plant.error(), &region, SLACK)?;
    let margin = margin(Time::Continuous, &plant, &found);
    Ok((found.runs, Some(margin)))
}

fn paper_conditions(seed: u64, n: usize) -> Outcome {
    let plant = Plant::random(seed, n);
    let found = paper(&plant.error(), &plant.bf, &plant.df, Normalisation::Lemma1)?;
    Ok((found.runs, None))
}

fn mixed_indices(seed: u64, n: usize) -> Outcome {
    let plant = Plant::random(seed, n);
    let found = mixed(&plant.error(), &plant.bf, &plant.df, &Region::default())?;
    Ok((found.runs, None))
}

/// What the thread has had of its processor, so that a busy machine does not matter.
fn processor_time() -> Duration {
    clock_gettime(ClockId::CLOCK_THREAD_CPUTIME_ID).unwrap().into()
}

fn main() {
    type Synthesis = fn(u64, usize) -> Outcome;
    let problems: [(&str, usize, Synthesis); 5] = [
        ("two-stage continuous", 12, continuous),
        ("two-stage discrete", 12, discrete),
        ("two-stage with region", 12, region),
        ("paper (13), Lemma 1", 8, paper_conditions),
        ("mixed, 13 + 20 values of θ", 4, mixed_indices),
    ];
    println!(
        "{:>3} {:27} {:>9} {:>9} {:>6} {:>9}  solver",
        "n", "problem", "p50", "max", "iter.", "margin"
    );
    let quick = std::env::args().any(|argument| argument == "--quick");
    for n in ORDERS.into_iter().filter(|&n| !quick || n <= 6) {
        let seeds = match n {
            _ if quick => 3,
            0..=4 => 9,
            5..=8 => 5,
            _ => 3,
        };
        for (name, _, synthesis) in problems.iter().filter(|problem| n <= problem.1) {
            let mut times: Vec<Duration> = Vec::new();
            let (mut iterations, mut least) = (0, f64::INFINITY);
            let mut words = BTreeSet::new();
            for seed in 0..seeds {
                let start = processor_time();
                let outcome = synthesis(seed, n);
                times.push(processor_time() - start);
                match outcome {
                    Ok((runs, margin)) => {
                        iterations = runs.iter().map(|run| run.iterations).fold(iterations, u32::max);
                        words.extend(runs.into_iter().map(|run| run.status));
                        least = least.min(margin.unwrap_or(f64::INFINITY));
                    }
                    Err(error) => {
                        words.insert(format!("refused ({error})"));
                    }
                }
            }
            times.sort();
            println!(
                "{n:>3} {name:27} {:>7.1} ms {:>6.1} ms {iterations:>6} {:>9}  {}",
                times[times.len() / 2].as_secs_f64() * 1e3,
                times[times.len() - 1].as_secs_f64() * 1e3,
                if least.is_finite() {
                    format!("{least:.1e}")
                } else {
                    "none".to_owned()
                },
                words.into_iter().collect::<Vec<_>>().join(", ")
            );
        }
    }
}
