//! What the tests achieve on a model, recomputed at construction (method sheet 3).

use super::{
    ChiSquareDiagnoser,
    calibration::targets,
    glr::GlrDesign,
    glr_modes::FaultProfile,
    model_options::Schedule,
    options::{ChiSquareOptions, StabilityGuard, StatisticKind, ThresholdMode},
    sensitivity::{ASSURANCE, Sensitivity, signature_products, signatures},
    steady::SteadyState,
    step_model::StepModel,
};
use crate::{
    achieved::{
        Achieved, Delay, FalseAlarms, FaultSensitivity, Inequality, Need, Norm, NotStated, Poles, Separation,
        SizeOf, Threshold, TimeDomain,
    },
    decomposition::SymmetricDecomposition,
    spectrum::spectral_radius,
};
use nalgebra::DMatrix;

/// How near to 1 the modulus of an eigenvalue counts as 1 (method sheet 3, stability guard).
const MARGIN: f64 = 1e-6;
/// 1 - c² from which on two signatures differ.
const DIFFERENT: f64 = 1e-6;
/// Instants after the onset that a delay curve shows.
const DELAYS: [usize; 8] = [1, 2, 5, 10, 20, 50, 100, 200];

impl ChiSquareDiagnoser {
    /// What this diagnoser achieves when it is stepped every `sample_time_s`.
    pub(super) fn achieved(&self, options: &ChiSquareOptions, sample_time_s: f64) -> Achieved {
        let mut achieved = Achieved {
            false_alarms: Some(false_alarms(options, sample_time_s)),
            inequalities: self.inequalities(options),
            ..Achieved::default()
        };
        let steady = self.design.report.steady_state.as_ref();
        let (Some(steady), Some(model), Schedule::Constant) =
            (steady, self.plant.models.first(), self.plant.schedule)
        else {
            let reason = "sizes are computed for a constant model whose filter becomes steady";
            achieved.not_stated = [SizeOf::Detectable, SizeOf::Isolable]
                .map(|size| not_stated(size, Vec::new(), reason))
                .to_vec();
            return achieved;
        };
        let [n, ..] = self.plant.counts();
        let observer = (DMatrix::identity(n, n) - &steady.gain * model.measurement.to_dense())
            * model.transition.to_dense();
        achieved.poles.extend(Poles::of(
            "errors of the steady Kalman filter".to_owned(),
            TimeDomain::Discrete,
            &observer,
        ));
        achieved.norms = norms(steady);
        achieved
            .norms
            .extend(spectral_radius(&observer).map(|value| Norm {
                name: "spectral radius of (I - KH)Φ".to_owned(),
                value,
                lower_bound: None,
            }));
        achieved.thresholds = self.settled_thresholds(options, steady);
        let sensitivity = Sensitivity {
            options,
            plant: &self.plant,
            design: &self.engine.design,
            steady,
            thresholds: &self.design.thresholds,
        };
        let glr = self.engine.design.glr.as_ref();
        let signatures = glr.and_then(|glr| signatures(&sensitivity, glr));
        achieved.faults = self.faults(&sensitivity.sizes(signatures.as_deref()), sample_time_s);
        if let Some((glr, signatures)) = glr.zip(signatures) {
            achieved.isolability = self.isolability(glr, &signature_products(&signatures, glr));
            let reason = "the margin between the likelihood ratios, f²E(1 - c²), is an upper bound: noise, and onsets at which \
                          another fault fits better, take from it by amounts that have no formula";
            achieved
                .not_stated
                .push(not_stated(SizeOf::Isolable, Vec::new(), reason));
        }
        let names = self.description.faults.iter().enumerate();
        let unknown: Vec<String> = names
            .filter(|(component, _)| !sensitivity.has_formula(*component))
            .map(|(_, fault)| fault.clone())
            .collect();
        if !unknown.is_empty() {
            let reason = "no test of `statistics.decision` has a formula for them: `cusum` has none, and `glr` has one for \
                          step signatures only";
            achieved
                .not_stated
                .push(not_stated(SizeOf::Detectable, unknown, reason));
        }
        achieved
    }

    fn inequalities(&self, options: &ChiSquareOptions) -> Vec<Inequality> {
        let selected = self.plant.schedule == Schedule::Selected;
        let models = self.plant.models.iter().enumerate();
        let mut all: Vec<Inequality> = models
            .map(|(number, model)| Inequality {
                name: match selected {
                    true => {
                        format!("R of model {number} positive definite (smallest eigenvalue, unit diagonal)")
                    }
                    false => "R positive definite (smallest eigenvalue, unit diagonal)".to_owned(),
                },
                margin: smallest_eigenvalue_of_noise(model),
            })
            .collect();
        let plain = options.statistics.enabled.contains(&StatisticKind::StatePlain);
        let refused = options.statistics.stability_guard == StabilityGuard::Refuse;
        if let (Some(stability), true) = (&self.design.report.stability, plain && refused) {
            all.push(Inequality {
                name: "excited and observable modes decay, for the plain state test".to_owned(),
                margin: 1.0 - MARGIN - stability.effective_spectral_radius,
            });
        }
        all
    }

    fn settled_thresholds(&self, options: &ChiSquareOptions, steady: &SteadyState) -> Vec<Threshold> {
        let (thresholds, design) = (&self.design.thresholds, &self.engine.design);
        let mut all: Vec<Threshold> = (0..design.measurements)
            .map(|i| Threshold {
                channel: format!("innovation_{i}"),
                settled: thresholds.deviations * steady.innovation_covariance[(i, i)].max(0.0).sqrt(),
                never_fires: Some("for information: innovations are judged together".to_owned()),
                insensitive: None,
            })
            .collect();
        for kind in &options.statistics.enabled {
            let silent = (!options.statistics.decision.contains(kind))
                .then(|| "for information: it is not in `statistics.decision`".to_owned());
            let mut add = |channel: String, settled: f64| {
                all.push(Threshold {
                    channel,
                    settled,
                    never_fires: silent.clone(),
                    insensitive: None,
                });
            };
            let of = |list: &[f64], degrees: usize| list.get(degrees).copied().unwrap_or(f64::INFINITY);
            match kind {
                StatisticKind::Residual => add(
                    kind.name().to_owned(),
                    of(&thresholds.residual, design.measurements),
                ),
                StatisticKind::StatePlain => {
                    add(kind.name().to_owned(), of(&thresholds.plain, design.states))
                }
                StatisticKind::StateTwoPropagator => {
                    add(kind.name().to_owned(), of(&thresholds.pair, design.states))
                }
                StatisticKind::StateWindow => {
                    for steps in &design.window_steps {
                        let degrees = design.states.min(steps.saturating_mul(design.measurements));
                        add(format!("state_window_{steps}"), of(&thresholds.window, degrees));
                    }
                }
                StatisticKind::Glr => add(kind.name().to_owned(), thresholds.glr),
                StatisticKind::Cusum => {
                    (0..design.measurements).for_each(|i| add(format!("cusum_{i}"), thresholds.cusum));
                }
            }
        }
        all
    }

    fn faults(&self, sizes: &[Vec<f64>], sample_time_s: f64) -> Vec<FaultSensitivity> {
        let named = self.description.faults.iter().zip(sizes);
        let of_component = named.enumerate().map(|(component, (fault, sizes))| {
            let delays = DELAYS.into_iter().filter_map(|k| {
                Some(Delay {
                    within_s: (k - 1) as f64 * sample_time_s,
                    size: *sizes.get(k - 1)?,
                })
            });
            let channel = self
                .description
                .channels
                .get(component)
                .filter(|_| component < self.engine.design.measurements);
            FaultSensitivity {
                fault: fault.clone(),
                unit: channel.map_or_else(String::new, |channel| channel.unit.clone()),
                assurance: ASSURANCE,
                provided_that: String::new(),
                detectable: sizes.last().copied().filter(|size| size.is_finite()),
                isolable: None,
                delays: Delay::worth_stating(delays),
            }
        });
        of_component.collect()
    }

    /// From which instant on the signature of a step differs from all signatures of another component.
    fn isolability(&self, glr: &GlrDesign, products: &[DMatrix<f64>]) -> Vec<Separation> {
        let modes = || glr.modes.iter().enumerate();
        let faults = &self.description.faults;
        let mut all = Vec::new();
        for (i, fault) in faults.iter().enumerate() {
            let own = modes().find(|(_, mode)| mode.component == i && mode.profile == FaultProfile::Step);
            let Some((own, _)) = own else { continue };
            for (j, from) in faults.iter().enumerate().filter(|(j, _)| *j != i) {
                let others: Vec<usize> = modes()
                    .filter(|(_, mode)| mode.component == j)
                    .map(|(b, _)| b)
                    .collect();
                let differs = |products: &DMatrix<f64>| {
                    others.iter().all(|&b| {
                        let energies = products[(own, own)] * products[(b, b)];
                        energies - products[(own, b)].powi(2) > DIFFERENT * energies
                    })
                };
                all.push(Separation {
                    fault: fault.clone(),
                    from: from.clone(),
                    instants: products.iter().position(differs).map(|age| age as u64 + 1),
                    need: Need::Instants,
                });
            }
        }
        all
    }
}

/// The rates of the thresholds in force. Per instant they are exact for each test and add up to a bound of all.
fn false_alarms(options: &ChiSquareOptions, sample_time_s: f64) -> FalseAlarms {
    let threshold = &options.threshold;
    let simulated: Vec<StatisticKind> = targets(options)
        .into_iter()
        .filter(|(_, decides)| *decides)
        .map(|(kind, _)| kind)
        .collect();
    let mut probability = 0.0;
    let mut unknown = Vec::new();
    for kind in options
        .statistics
        .decision
        .iter()
        .filter(|kind| !simulated.contains(kind))
    {
        let exact = threshold.mode == ThresholdMode::PerInstant
            && !matches!(kind, StatisticKind::Glr | StatisticKind::Cusum);
        match exact {
            true => probability += threshold.false_alarm_probability,
            false => unknown.push(format!("`{}`", kind.name())),
        }
    }
    if !simulated.is_empty() {
        let steps = threshold.run_steps.max(1) as f64;
        probability -= (-threshold.run_false_alarm_probability).ln_1p() / steps;
    }
    if !unknown.is_empty() {
        return FalseAlarms {
            probability_per_instant: None,
            expected_per_hour: None,
            provided_that: format!(
                "the threshold of {} is fixed by the configuration; leave it out to have it calibrated",
                unknown.join(", ")
            ),
        };
    }
    let probability = probability.min(1.0);
    let bursts = match simulated.is_empty() {
        true => "",
        false => {
            "; of calibrated tests runs of `threshold.run_steps` with an alarm count once, as if the runs were independent"
        }
    };
    FalseAlarms {
        probability_per_instant: Some(probability),
        expected_per_hour: Some(probability * 3600.0 / sample_time_s),
        provided_that: format!(
            "model, noise covariances and the start are right; the rates of several tests are added up, which is an upper \
             bound{bursts}"
        ),
    }
}

fn norms(steady: &SteadyState) -> Vec<Norm> {
    let deviations = |name: &str, covariance: &DMatrix<f64>| -> Vec<Norm> {
        let norm = |i: usize| Norm {
            name: format!("standard deviation of {name} {}", i + 1),
            value: covariance[(i, i)].max(0.0).sqrt(),
            lower_bound: None,
        };
        (0..covariance.nrows()).map(norm).collect()
    };
    let mut norms = deviations("the estimate of state", &steady.covariance);
    norms.extend(deviations("innovation", &steady.innovation_covariance));
    norms
}

fn not_stated(size: SizeOf, faults: Vec<String>, because: &str) -> NotStated {
    NotStated {
        size,
        faults,
        because: because.to_owned(),
    }
}

/// Smallest eigenvalue of R scaled to unit diagonal.
fn smallest_eigenvalue_of_noise(model: &StepModel) -> f64 {
    let r = model.measurement_noise.to_dense();
    let scaled = DMatrix::from_fn(r.nrows(), r.ncols(), |i, j| {
        r[(i, j)] / (r[(i, i)] * r[(j, j)]).sqrt()
    });
    SymmetricDecomposition::new(&scaled).smallest()
}
