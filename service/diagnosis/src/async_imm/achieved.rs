//! What a bank of mode filters achieves, as far as it can be said without simulation (method sheet 3).

use super::{
    checks::CheckReport,
    design::{ImmDesign, Mode},
    exact::discretise,
    plant::{LinearPlant, Plant},
    settings::Settings,
};
use crate::{
    achieved::{
        Achieved, FalseAlarms, Inequality, Need, NotStated, Poles, Separation, SizeOf, Threshold, TimeDomain,
    },
    riccati::{Covariances, dare},
};
use nalgebra::DMatrix;

/// What a design with these settings achieves at this fusion period.
///
/// Probabilities of false alarms, delays and sizes of faults depend on the samples that arrive and on the data, through
/// the mixing; the method has no formula for them.
pub(super) fn achieved(
    design: &ImmDesign,
    settings: &Settings,
    report: &CheckReport,
    fusion_period_s: f64,
) -> Achieved {
    let rule = &settings.decision;
    let alarm = |channel: String| Threshold {
        channel,
        settled: rule.threshold,
        never_fires: None,
        insensitive: None,
    };
    let faulty = || design.modes.iter().enumerate().skip(1);
    let probabilities = faulty().map(|(_, mode)| alarm(format!("probability {}", mode.name)));
    Achieved {
        false_alarms: Some(FalseAlarms {
            probability_per_instant: None,
            expected_per_hour: None,
            provided_that: format!(
                "only a simulation of the sensors' schedule tells how often a probability exceeds {} for {} fusion \
                 instants in a row without a fault",
                rule.threshold, rule.window_steps
            ),
        }),
        poles: match &design.plant {
            Plant::Constant(plant) => steady_poles(design, plant, fusion_period_s),
            _ => Vec::new(),
        },
        inequalities: faulty()
            .zip(&report.amplitude_gaps)
            .map(|((_, mode), gap)| Inequality {
                name: format!(
                    "amplitude of the mode \"{}\" seen in the steady state (smallest singular value above 0)",
                    mode.name
                ),
                margin: *gap,
            })
            .collect(),
        isolability: faulty()
            .flat_map(|(i, mode)| {
                faulty()
                    .filter(move |(j, _)| *j != i)
                    .map(move |(j, from)| (i, mode, j, from))
            })
            .map(|(i, mode, j, from)| Separation {
                fault: mode.name.clone(),
                from: from.name.clone(),
                // The decision's confirmation; the mixing needs more, depending on the data.
                instants: Some(u64::from(rule.window_steps)),
                need: match report
                    .separable_by_transients_only
                    .contains(&(i.min(j), i.max(j)))
                {
                    true => Need::Transients,
                    false => Need::AtLeast,
                },
            })
            .collect(),
        not_stated: [SizeOf::Detectable, SizeOf::Isolable].map(not_stated).to_vec(),
        thresholds: std::iter::once(alarm("fault probability".to_owned()))
            .chain(probabilities)
            .collect(),
        ..Achieved::default()
    }
}

fn not_stated(size: SizeOf) -> NotStated {
    NotStated {
        size,
        faults: Vec::new(),
        because: "probabilities of modes depend on the samples that arrive and on the data, through the mixing; the method \
                  has no formula for them"
            .to_owned(),
    }
}

/// The error poles of the modes whose filter becomes steady when every sensor is sampled once, at the fusion instant:
/// the normal one, and those in which every amplitude at work walks.
fn steady_poles(design: &ImmDesign, plant: &LinearPlant, fusion_period_s: f64) -> Vec<Poles> {
    let modes = design.modes.iter().filter_map(|mode| {
        let (transition, noise) = steady_model(plant, mode, fusion_period_s)?;
        let n = transition.nrows();
        let rows: usize = design
            .sensors
            .iter()
            .map(|sensor| sensor.measurement_matrix.nrows())
            .sum();
        let (mut h, mut r) = (DMatrix::zeros(rows, n), DMatrix::zeros(rows, rows));
        let mut row = 0;
        for sensor in &design.sensors {
            let (d, nx) = sensor.measurement_matrix.shape();
            h.view_mut((row, 0), (d, nx))
                .copy_from(&sensor.measurement_matrix);
            r.view_mut((row, row), (d, d)).copy_from(&sensor.noise_covariance);
            row += d;
        }
        let covariances = Covariances {
            q: &noise,
            s: &DMatrix::zeros(n, rows),
            r: &r,
        };
        let solution = dare(&transition, &h, covariances).ok()?;
        let errors = &transition - &solution.gain * &h;
        let name = format!(
            "errors of the mode \"{}\", every sensor sampled once, at the fusion instant",
            mode.name
        );
        let poles = Poles::of(name, TimeDomain::Discrete, &errors)?;
        let [re, im] = *poles.values.first()?;
        (re.hypot(im) < 1.0).then_some(poles)
    });
    modes.collect()
}

/// Φ̄ and Ω̄ of a mode over a fusion period, without the amplitudes that are not at work; `None` if one of the others is
/// constant: its error then decays without end and no filter is steady.
fn steady_model(
    plant: &LinearPlant,
    mode: &Mode,
    fusion_period_s: f64,
) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let columns = mode
        .direction
        .column_iter()
        .zip(&mode.random_walk_psd)
        .enumerate();
    let at_work: Vec<(usize, f64)> = columns
        .filter(|(_, (column, _))| column.iter().any(|entry| *entry != 0.0))
        .map(|(slot, (_, density))| (slot, *density))
        .collect();
    if at_work.iter().any(|(_, density)| !(*density > 0.0)) {
        return None;
    }
    let slots: Vec<usize> = at_work.iter().map(|(slot, _)| *slot).collect();
    let densities: Vec<f64> = at_work.iter().map(|(_, density)| *density).collect();
    let augmented = plant.augmented(&mode.direction.select_columns(&slots), &densities);
    let interval = discretise(&augmented, fusion_period_s);
    Some((interval.phi.to_dense(), interval.omega.to_dense()))
}
