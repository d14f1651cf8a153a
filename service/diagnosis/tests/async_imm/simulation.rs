//! The paper's example with random numbers of its own: a turning target, three position sensors with their own
//! periods and losses, an offset of 2 in actuator 2 from 16.5 s on.

use crate::fixture::{Slot, dense, design, file};
use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::async_imm::{
    design::{Form, ImmDesign, Mixing, ModeTransition},
    estimator::{ImmEstimator, Sample},
    exact::discretise,
    fusion::Fusion,
    inputs::InputHistory,
    plant::Plant,
};
use residual_diagnosis::covariance::semidefinite_factor;

/// Normal and uniform random numbers.
pub struct Draw(ChaCha8Rng);

impl Draw {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn uniform(&mut self) -> f64 {
        self.0.random()
    }

    pub fn below(&mut self, count: usize) -> usize {
        self.0.random_range(0..count)
    }

    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }

    pub fn normals(&mut self, count: usize) -> DVector<f64> {
        DVector::from_fn(count, |_, _| self.normal())
    }
}

/// The design of the paper's example.
pub fn paper_design(form: Form, mixing: Mixing, transition: ModeTransition) -> ImmDesign {
    ImmDesign {
        form,
        mixing,
        transition,
        ..design(&file("paper_seed20170.json"), "default")
    }
}

/// The same rate to each other mode, such that a mode stays with this probability over 1 s.
pub fn stay(probability: f64) -> ModeTransition {
    ModeTransition::Stay {
        probability,
        period_s: 1.0,
    }
}

/// Λ of the paper.
pub fn paper_transition() -> ModeTransition {
    let file = file("paper_seed20170.json");
    ModeTransition::PerStep(dense(&file["expected"]["paper"]["mode_transition_matrix"]))
}

/// Grid of the sampling instants, µs.
const GRID_US: i64 = 100_000;

/// One random run of plant and sensors.
pub struct Truth {
    /// x at the fusion instants 0, 1, … s.
    pub states: Vec<DVector<f64>>,
    pub slots: Vec<Slot>,
}

/// Simulates `steps` seconds with the channel amplitudes `fault` from `onset_us` on.
pub fn simulate(design: &ImmDesign, steps: usize, fault: [f64; 2], onset_us: i64, draw: &mut Draw) -> Truth {
    let Plant::Constant(plant) = &design.plant else {
        panic!()
    };
    let interval = discretise(plant, GRID_US as f64 * 1e-6);
    let (phi, gain) = (interval.phi.to_dense(), interval.gain.to_dense());
    let noise = semidefinite_factor(&interval.omega.to_dense()).unwrap();
    let roots: Vec<DMatrix<f64>> = design
        .sensors
        .iter()
        .map(|sensor| semidefinite_factor(&sensor.noise_covariance).unwrap())
        .collect();
    let spread = semidefinite_factor(&design.prior.state_covariance).unwrap();
    let mut x = DVector::from_column_slice(&design.prior.state) + spread * draw.normals(4);
    let mut truth = Truth {
        states: vec![x.clone()],
        slots: Vec::new(),
    };
    let mut next_sample = [200_000, 300_000, 400_000];
    for tick in 1..=10 * steps as i64 {
        let time_us = tick * GRID_US;
        let active = time_us > onset_us;
        let [f1, f2] = if active { fault } else { [0.0; 2] };
        let entering = DVector::from_column_slice(&[0.5, 0.5, f1, f2]);
        x = &phi * x + &gain * entering + &noise * draw.normals(4);
        for (s, sensor) in design.sensors.iter().enumerate() {
            if time_us != next_sample[s] {
                continue;
            }
            let z = &sensor.measurement_matrix * &x + &roots[s] * draw.normals(2);
            let received = draw.uniform() < sensor.arrival_probability;
            truth.slots.push(Slot {
                time_us,
                sensor: s,
                value: received.then(|| z.as_slice().to_vec()),
            });
            next_sample[s] += match s {
                2 => [800_000, 900_000, 1_000_000][draw.below(3)],
                _ => 600_000,
            };
        }
        if tick % 10 == 0 {
            truth.states.push(x.clone());
        }
    }
    truth
}

/// What is kept of one fusion instant.
pub struct Seen {
    pub probability: Vec<f64>,
    /// Squared error of the fused position, both axes together.
    pub position: f64,
    /// Squared error of the fused plant state, velocity.
    pub velocity: f64,
    /// Fused amplitude (79).
    pub fused_amplitude: f64,
    /// Amplitude and standard deviation of each mode.
    pub amplitude: Vec<(f64, f64)>,
    /// (x - x̂)'P⁻¹(x - x̂) of mode 0.
    pub normalised: f64,
}

/// Runs a design with the sensors `sensors` over a truth.
pub fn filter(
    estimator: &mut ImmEstimator,
    fusion: &mut Fusion,
    design: &ImmDesign,
    sensors: &[usize],
    truth: &Truth,
) -> Vec<Seen> {
    let commands = InputHistory::new(&[0.5, 0.5], 0);
    let mut posterior = estimator.start(0);
    let mut held = posterior.held.clone();
    let mut rest = truth.slots.as_slice();
    let mut seen = Vec::new();
    for (k, state) in truth.states.iter().enumerate().skip(1) {
        let end = k as i64 * 1_000_000;
        let (now, later) = rest.split_at(rest.partition_point(|slot| slot.time_us <= end));
        rest = later;
        let mut samples: Vec<(i64, usize, Vec<f64>)> = Vec::new();
        for slot in now {
            let Some(sensor) = sensors.iter().position(|sensor| *sensor == slot.sensor) else {
                continue;
            };
            match &slot.value {
                Some(value) => held[sensor].clone_from(value),
                None if design.form != Form::BatchUnobserved => continue,
                None => {}
            }
            samples.push((slot.time_us * 1000, sensor, held[sensor].clone()));
        }
        let samples = samples.iter().map(|(time_ns, sensor, values)| Sample {
            time_ns: *time_ns,
            sensor: *sensor,
            values,
            held_before: None,
        });
        estimator.advance(&mut posterior, end * 1000, samples, &commands);
        let probability = fusion.read_probability(&posterior).to_vec();
        let mean = fusion.fuse(&posterior).0;
        let squared = |i: usize| (mean[i] - state[i]).powi(2);
        let (position, velocity) = (squared(0) + squared(2), squared(1) + squared(3));
        let fused_amplitude = mean.get(4).copied().unwrap_or(0.0);
        let amplitude = posterior.modes.iter().map(|mode| {
            let variance = match design.form {
                Form::SequentialSquareRoot => panic!("not simulated"),
                _ if mode.mean.len() > 4 => mode.spread[(4, 4)],
                _ => 0.0,
            };
            (mode.mean.get(4).copied().unwrap_or(0.0), variance.sqrt())
        });
        let normal = &posterior.modes[0];
        let deviation = DVector::from_fn(4, |i, _| normal.mean[i] - state[i]);
        let covariance = normal.spread.to_dense().view((0, 0), (4, 4)).into_owned();
        seen.push(Seen {
            position,
            velocity,
            fused_amplitude,
            amplitude: amplitude.collect(),
            normalised: deviation.dot(&(covariance.try_inverse().unwrap() * &deviation)),
            probability,
        });
    }
    seen
}

/// Many runs of one design.
pub struct Ensemble {
    pub runs: Vec<Vec<Seen>>,
}

/// The number of runs, steps and the fault of an ensemble.
#[derive(Clone, Copy)]
pub struct Plan {
    pub runs: usize,
    pub steps: usize,
    pub fault: [f64; 2],
    pub onset_us: i64,
}

impl Plan {
    /// The paper's: 40 s, amplitude 2 in actuator 2 from 16.5 s on.
    pub fn paper(runs: usize) -> Self {
        Self {
            runs,
            steps: 40,
            fault: [0.0, 2.0],
            onset_us: 16_500_000,
        }
    }
}

impl Ensemble {
    /// Simulates and filters; `sensors` are the numbers of the sensors in use.
    pub fn new(design: &ImmDesign, sensors: &[usize], plan: Plan) -> Self {
        let all = file("paper_seed20170.json");
        let complete = ImmDesign {
            sensors: self::design(&all, "default").sensors,
            ..design.clone()
        };
        let mut own = design.clone();
        own.sensors = sensors
            .iter()
            .map(|&sensor| complete.sensors[sensor].clone())
            .collect();
        let mut estimator = ImmEstimator::new(&own, 16).unwrap();
        let mut fusion = Fusion::new(&own);
        let run = |seed: usize| {
            let mut draw = Draw::new(20_170 + seed as u64);
            let truth = simulate(&complete, plan.steps, plan.fault, plan.onset_us, &mut draw);
            filter(&mut estimator, &mut fusion, &own, sensors, &truth)
        };
        Self {
            runs: (0..plan.runs).map(run).collect(),
        }
    }

    /// Mean over the runs at step k (from 1).
    pub fn mean(&self, k: usize, of: impl Fn(&Seen) -> f64) -> f64 {
        self.runs.iter().map(|run| of(&run[k - 1])).sum::<f64>() / self.runs.len() as f64
    }

    /// Root of the mean over runs and steps.
    pub fn root_mean(&self, steps: std::ops::RangeInclusive<usize>, of: impl Fn(&Seen) -> f64) -> f64 {
        let count = steps.clone().count() as f64;
        (steps.map(|k| self.mean(k, &of)).sum::<f64>() / count).sqrt()
    }

    /// Largest root mean over the steps.
    pub fn peak(&self, steps: std::ops::RangeInclusive<usize>, of: impl Fn(&Seen) -> f64) -> f64 {
        steps.map(|k| self.mean(k, &of)).fold(0.0, f64::max).sqrt()
    }

    /// Mean time (s) from the fault at 16.5 s to the first declaration of `mode`, share of the runs with any
    /// declaration before, and runs that declare nothing afterwards.
    pub fn decisions(&self, mode: usize, threshold: f64, window_steps: u32) -> Decisions {
        use residual_diagnosis::async_imm::decision::{DecisionRule, DecisionState};
        let rule = DecisionRule {
            threshold,
            window_steps,
        };
        let mut out = Decisions::default();
        let mut delays = 0.0;
        for run in &self.runs {
            let mut state = DecisionState::default();
            let (mut false_alarm, mut found) = (false, None);
            for (place, seen) in run.iter().enumerate() {
                rule.update(&mut state, &seen.probability);
                let declared = rule.declared_mode(&state);
                false_alarm |= place < 16 && declared > 0;
                if place >= 16 && declared == mode && found.is_none() {
                    found = Some(place as f64 + 1.0 - 16.5);
                }
            }
            out.false_alarm_runs += f64::from(u8::from(false_alarm)) / self.runs.len() as f64;
            match found {
                Some(delay) => delays += delay,
                None => out.missed += 1,
            }
        }
        out.delay = delays / (self.runs.len() - out.missed).max(1) as f64;
        out
    }
}

/// How a decision rule did.
#[derive(Clone, Copy, Debug, Default)]
pub struct Decisions {
    pub delay: f64,
    pub false_alarm_runs: f64,
    pub missed: usize,
}
