//! What the design found, for people and for tests.

use super::{
    achieved::Assembly,
    certificate::{Certificate, Time},
    checks::describe,
    constants::ThresholdConstants,
    filter::{ResidualFilter, Threshold},
    main_filter::MainFilter,
    observer::{Observer, ObserverState},
    options::{HinfFilterOptions, RealisationType, ThresholdType},
    problem::Problem,
};
use crate::achieved::Achieved;
use nalgebra::{DMatrix, DVector};

/// Length of the step response that shows how a command leaks into the residual, s.
const LEAK_TIME_S: f64 = 10.0;

/// Gain, certificate and thresholds of the main filter.
#[derive(Clone, Debug, PartialEq)]
pub struct Report {
    /// L, or Gy where the realisation holds the samples.
    pub gain: DMatrix<f64>,
    /// V.
    pub v: DMatrix<f64>,
    /// Poles and norms, recomputed.
    pub certificate: Certificate,
    /// Of the continuous gain whose average is in force.
    pub continuous: Option<Certificate>,
    /// √λ_max(Ω) of a Riccati design: the best possible weighted norm.
    pub optimum: Option<f64>,
    /// Constant parts of the thresholds for the nominal plant; `None` for a constant threshold.
    pub constants: Option<ThresholdConstants>,
    /// Smallest constant fault, per fault, that the peak test is sure to see; `None` if models are listed, which change
    /// the response and the thresholds.
    pub detectable: Option<Vec<f64>>,
    /// Largest residual that a unit step of a command causes without fault, where it does not cancel.
    pub command_leak: Option<f64>,
    /// ‖V T_blind‖∞ of each blind filter.
    pub blind_leaks: Vec<f64>,
    /// Why the thresholds hold no guarantee; `None` if they do.
    pub missing_guarantee: Option<String>,
    /// All of it in the words that all methods share.
    pub achieved: Achieved,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

/// What the thresholds are worth.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Guarantee {
    /// No alarm without a fault.
    Complete,
    /// None but with the small probability that noise leaves.
    Probable,
    /// None, and why.
    None(String),
}

impl Report {
    pub(super) fn new(
        assembly: &Assembly<'_>,
        filter: &ResidualFilter,
        constants: Option<ThresholdConstants>,
    ) -> Self {
        let Assembly {
            problem,
            options,
            main,
            ..
        } = *assembly;
        let held = options.filter.realisation != RealisationType::DiscreteObserver;
        let achieved = assembly.achieved();
        let mut report = Self {
            gain: main.gain.clone(),
            v: main.v.clone(),
            certificate: main.certificate.clone(),
            continuous: main.continuous.clone(),
            optimum: main.weighted.and_then(|(_, optimum)| optimum),
            detectable: detectable(problem, main, filter),
            constants,
            command_leak: held.then(|| command_leak(problem, &filter.observer)),
            blind_leaks: assembly.blind.iter().map(|checked| checked.leak).collect(),
            missing_guarantee: match assembly.guarantee {
                Guarantee::Complete => None,
                Guarantee::Probable => {
                    Some("noise has no bound: the thresholds hold with a probability only".to_owned())
                }
                Guarantee::None(reason) => Some(reason.clone()),
            },
            warnings: Vec::new(),
            achieved,
        };
        report.warnings = report.faults_out_of_sight(problem, options);
        let wanted = options.synthesis.design;
        if main.design != wanted {
            report.warnings.push(format!(
                "the filter runs on gains of the design \"{}\" instead of \"{}\"",
                main.design.name(),
                wanted.name()
            ));
        }
        if problem.window.is_none() && options.evaluation.threshold == ThresholdType::Guaranteed {
            report.warnings.push(
                "`evaluation.window` = \"cumulative\": the threshold of the energy grows with time, in the long run no \
                 fault exceeds it"
                    .to_owned(),
            );
        }
        report
    }

    /// Faults of which no size within the declared bound is sure to be seen.
    fn faults_out_of_sight(&self, problem: &Problem, options: &HinfFilterOptions) -> Vec<String> {
        if options.isolation.is_none() {
            return Vec::new();
        }
        let faults = self.achieved.faults.iter().zip(problem.faults.bound.iter());
        faults
            .filter_map(|(fault, bound)| {
                let size = fault.detectable.filter(|size| size > bound)?;
                Some(format!(
                    "the fault {} is sure to be seen from {size:.4e} on, which is above its declared bound {bound:.4e}",
                    fault.fault
                ))
            })
            .collect()
    }

    /// Names and values for people.
    pub fn notes(&self) -> Vec<(&'static str, String)> {
        let certificate = &self.certificate;
        let poles: Vec<_> = certificate.poles.iter().map(|pole| describe(*pole)).collect();
        let list = |values: &[f64]| {
            values
                .iter()
                .map(|value| format!("{value:.4e}"))
                .collect::<Vec<_>>()
                .join(", ")
        };
        let mut notes = vec![
            ("poles", poles.join(", ")),
            ("norm of the gain", format!("{:.6}", certificate.gain)),
            (
                "largest gain from disturbance to residual",
                format!(
                    "{:.9} (no gain reaches less than {:.9})",
                    certificate.disturbance, certificate.lower_bound
                ),
            ),
            (
                "the same after the post-filter",
                format!("{:.9}", certificate.weighted_disturbance),
            ),
            (
                "largest gain from fault to residual",
                format!("{:.6}", certificate.fault),
            ),
            (
                match certificate.time {
                    Time::Discrete => "smallest gain from fault to filtered residual",
                    Time::Continuous => "smallest gain from fault to filtered residual (continuous)",
                },
                format!(
                    "{:.6}; fault by fault {}",
                    certificate.fault_index,
                    list(&certificate.fault_indices)
                ),
            ),
        ];
        if let Some(constants) = &self.constants {
            notes.push((
                "bounds of the residuals under disturbance",
                list(constants.amplitude.as_slice()),
            ));
            notes.push((
                "threshold of the window energy under disturbance",
                format!("{:.4e}", constants.energy),
            ));
        }
        if let Some(detectable) = &self.detectable {
            notes.push((
                "constant faults sure to be seen for as long as they last",
                list(detectable),
            ));
        }
        if let Some(leak) = self.command_leak {
            notes.push((
                "largest residual after a unit step of a command",
                format!("{leak:.4e}"),
            ));
        }
        if !self.blind_leaks.is_empty() {
            notes.push(("what blind filters pass of their faults", list(&self.blind_leaks)));
        }
        notes.push((
            "guarantee",
            match &self.missing_guarantee {
                None => "no alarm without a fault, as long as the declared bounds hold".to_owned(),
                Some(reason) => format!("none: {reason}"),
            },
        ));
        notes
    }
}

/// f_min,j = 2 min_i ρ_i / |V T_rf(1)|_ij.
fn detectable(problem: &Problem, main: &MainFilter, filter: &ResidualFilter) -> Option<Vec<f64>> {
    let Threshold::Guaranteed(bounds) = &filter.threshold else {
        return None;
    };
    if !filter.peak_test || !problem.listed.is_empty() {
        return None;
    }
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let n = plant.a.nrows();
    let driven = &sampled.bfd - &main.gain * &plant.df;
    let state = (DMatrix::identity(n, n) - &main.closed).lu().solve(&driven)?;
    let gain = &main.v * (&plant.c * state + &plant.df);
    let bound = bounds.settled();
    let smallest = |j: usize| {
        (0..gain.nrows())
            .map(|i| 2.0 * bound[i] / gain[(i, j)].abs())
            .fold(f64::INFINITY, f64::min)
    };
    Some((0..gain.ncols()).map(smallest).collect())
}

/// sup |r| over the step responses of all commands, from rest.
fn command_leak(problem: &Problem, observer: &Observer) -> f64 {
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (n, p, q, _, _) = plant.dimensions();
    let mut observer = observer.clone();
    let mut largest = 0.0_f64;
    for input in 0..p {
        let u = DVector::from_fn(p, |i, _| f64::from(u8::from(i == input)));
        let mut x = DVector::zeros(n);
        let mut state = ObserverState::new(n);
        let mut r = vec![0.0; q];
        for _ in 0..=(LEAK_TIME_S / sampled.sample_time_s).ceil().min(1e6) as usize {
            let y = &plant.c * &x + &plant.d * &u;
            observer.begin(&mut state, Some(y.as_slice()));
            observer.residual(&state, y.as_slice(), u.as_slice(), &mut r);
            observer.advance(&mut state, Some((y.as_slice(), &r)), u.as_slice());
            largest = r.iter().fold(largest, |most, value| most.max(value.abs()));
            x = &sampled.ad * x + &sampled.bud * &u;
        }
    }
    largest
}

/// What the thresholds are worth.
pub(super) fn guarantee(options: &HinfFilterOptions, main: &MainFilter) -> Guarantee {
    if let Some((label, reason)) = main.uncertified() {
        return Guarantee::None(format!("the gain is {label}: {reason}"));
    }
    if options.evaluation.threshold == ThresholdType::Constant {
        return Guarantee::None("the threshold is a constant".to_owned());
    }
    if options.filter.realisation != RealisationType::DiscreteObserver {
        return Guarantee::None("this realisation leaks commands into the residual".to_owned());
    }
    match options.disturbance.noise_std.is_empty() {
        true => Guarantee::Complete,
        false => Guarantee::Probable,
    }
}
