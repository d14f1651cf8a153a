//! What accepted gains achieve: norms, poles, conditions, thresholds (method sheet 3.6, 3.7).

use super::{
    achieved_faults::Faults,
    channels::test_channels,
    design::Design,
    isolation_design::SLOWEST,
    observer_design::{ObserverDesign, convergence_limit, largest_modulus},
    options::Mode,
};
use crate::{
    achieved::{Achieved, FalseAlarms, Inequality, Norm, NotStated, Poles, SizeOf, Threshold, TimeDomain},
    decomposition::{SingularDecomposition, eigenvalues},
};
use nalgebra::DMatrix;

/// Eigenvalues below this share of the matrix are zero: those of a nilpotent one are computed no better.
const ZERO_POLE: f64 = 1e-7;

/// What the gains of a design achieve with this period. The modes for comparison guarantee nothing; `baseline` is what
/// the half widths of their outputs settle at.
pub(super) fn achieved(design: &Design, baseline: &[f64], sample_time_s: f64) -> Achieved {
    let mut achieved = Achieved {
        norms: norms(design),
        poles: poles(design),
        inequalities: inequalities(design),
        ..Achieved::default()
    };
    if design.options.bounds.mode != Mode::Joint {
        let outputs = baseline.iter().enumerate().map(|(i, settled)| Threshold {
            channel: format!("output_{i}"),
            settled: *settled,
            never_fires: None,
            insensitive: None,
        });
        achieved.thresholds = outputs.collect();
        let not_stated = |size| NotStated {
            size,
            faults: Vec::new(),
            because: "`bounds.mode` is one for comparison, which guarantees nothing".to_owned(),
        };
        achieved.not_stated = [SizeOf::Detectable, SizeOf::Isolable].map(not_stated).to_vec();
        return achieved;
    }
    achieved.false_alarms = Some(FalseAlarms {
        probability_per_instant: Some(0.0),
        expected_per_hour: Some(0.0),
        provided_that:
            "the model is exact and the first state, disturbance and noise stay within their bounds"
                .to_owned(),
    });
    let faults = Faults::new(design);
    achieved.faults = faults.sensitivities(sample_time_s);
    achieved.isolability = faults.separations();
    achieved.thresholds = thresholds(design);
    achieved
}

/// All observers of a design with what their names end in.
pub(super) fn observers(design: &Design) -> Vec<(String, &ObserverDesign)> {
    let name = |kind: &str, found: &ObserverDesign| {
        found
            .actuator
            .map_or(String::new(), |actuator| format!(" of {kind} {actuator}"))
    };
    let members = design.isolation.members.iter();
    let estimators = design.isolation.estimators.iter();
    std::iter::once((String::new(), &design.main))
        .chain(members.map(|found| (name("member", found), found)))
        .chain(estimators.map(|found| (name("estimator", found), found)))
        .collect()
}

/// |K|, and the half widths with what no K and M can undercut: vbar_i + row sums of |D1| H_η.
fn norms(design: &Design) -> Vec<Norm> {
    let (plant, p) = (&design.plant, design.plant.outputs());
    let mut norms = vec![Norm {
        name: "K".to_owned(),
        value: SingularDecomposition::new(&design.main.observer.k).largest(),
        lower_bound: None,
    }];
    if design.options.bounds.mode == Mode::Joint {
        let least = &plant.noise_bound + plant.d.rows(0, p).abs() * &plant.disturbance.radius;
        let widths = design.main.hull();
        norms.extend((0..p).map(|i| Norm {
            name: format!("settled half width of output {i}"),
            value: widths[i],
            lower_bound: Some(least[i]),
        }));
    }
    norms
}

fn poles(design: &Design) -> Vec<Poles> {
    let poles = |name: String, matrix: &DMatrix<f64>| Poles {
        name,
        time: TimeDomain::Discrete,
        values: sorted_eigenvalues(matrix),
    };
    let mut all = vec![poles("M".to_owned(), &design.main.observer.m)];
    let observers = observers(design);
    all.extend(
        observers
            .iter()
            .map(|(of, found)| poles(format!("F{of}"), &found.observer.f)),
    );
    all.retain(|poles| !poles.values.is_empty());
    all
}

/// \[real part, imaginary part\] by falling modulus; empty without eigenvalues.
fn sorted_eigenvalues(matrix: &DMatrix<f64>) -> Vec<[f64; 2]> {
    let zero = ZERO_POLE * matrix.norm().max(1.0);
    let mut values = eigenvalues(matrix).unwrap_or_default();
    for value in values.iter_mut().filter(|value| value.norm() <= zero) {
        *value = nalgebra::Complex::new(0.0, 0.0);
    }
    values.sort_by(|one, other| {
        let modulus = other.norm().total_cmp(&one.norm());
        modulus
            .then(one.re.total_cmp(&other.re))
            .then(one.im.total_cmp(&other.im))
    });
    values.iter().map(|value| [value.re, value.im]).collect()
}

fn inequalities(design: &Design) -> Vec<Inequality> {
    let mut all = vec![Inequality {
        name: "M is Schur: |eig M| < 1".to_owned(),
        margin: 1.0 - largest_modulus(&design.main.observer.m),
    }];
    for (of, found) in observers(design) {
        let (limit, words) = match found.actuator {
            None => (convergence_limit(&design.options), "`design.spectral_radius_max`"),
            Some(_) => (SLOWEST, "1"),
        };
        all.push(Inequality {
            name: format!("the observer converges: |eig F{of}| below {words}"),
            margin: limit - largest_modulus(&found.observer.f),
        });
    }
    if let Some(certificate) = &design.certificate {
        all.push(Inequality {
            name: "P > 0, smallest eigenvalue".to_owned(),
            margin: certificate.smallest,
        });
        all.push(Inequality {
            name: "(A + L C)'P(A + L C) - P < 0, largest eigenvalue".to_owned(),
            margin: -certificate.decrease,
        });
    }
    all
}

fn thresholds(design: &Design) -> Vec<Threshold> {
    let bounds = design.options.isolation.fault_bound.as_deref();
    let tolerance = design.options.bounds.rounding_tolerance;
    let channels = test_channels(design).into_iter();
    channels
        .map(|channel| {
            let row = channel.design.tests.rows(channel.row, 1).into_owned();
            let half_width = channel.design.steady().rows(channel.row, 1).into_owned();
            let floors = super::floors::fault_floors(
                &channel.design.observer,
                &row,
                &half_width.add_scalar(tolerance),
            );
            let beyond = |(j, floor): (usize, &f64)| {
                bounds
                    .and_then(|bounds| bounds.get(j))
                    .is_some_and(|most| floor > most)
            };
            let blind = floors.iter().all(|floor| floor.is_infinite());
            let small = "no constant fault within `isolation.fault_bound` is certain to leave its bounds";
            Threshold {
                channel: channel.name,
                settled: half_width[0],
                never_fires: blind.then(|| "it sees no fault of any actuator".to_owned()),
                insensitive: (!blind && floors.iter().enumerate().all(beyond)).then(|| small.to_owned()),
            }
        })
        .collect()
}
