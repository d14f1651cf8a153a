//! Properties over random plants, gains and runs (method sheet 8 (b)).

use crate::fixtures::{channel, other_plant, servo, step};
use crate::simulation::{Draw, Simulation, random_plant, rows};
use nalgebra::DMatrix;
use residual_diagnosis::{
    diagnoser::{Diagnoser, Verdict, flags},
    reduced_order_observer::{
        ReducedOrderObserver,
        design::Design,
        error::ConstructionError,
        observer_design::ObserverDesign,
        options::{Initialisation, ObserverM, ReducedOrderObserverOptions},
        plant::{Plant, completion},
    },
};

/// Options with a random M, order, start and tolerance to slow observers.
fn random_options(seed: u64) -> ReducedOrderObserverOptions {
    let mut options = ReducedOrderObserverOptions {
        model: random_plant(seed),
        ..ReducedOrderObserverOptions::default()
    };
    let (n, p) = (options.model.a.len(), options.model.c.len());
    options.design.spectral_radius_max = 0.99;
    options.bounds.generator_order = Some(n + (seed % 20) as usize);
    if seed % 2 == 1 {
        let m = DMatrix::from_fn(p, p, |i, j| {
            0.8 / p as f64 * ((seed as usize + 3 * i + 7 * j) as f64).sin()
        });
        options.design.observer_m = ObserverM::Matrix(rows(&m));
    }
    if seed % 5 == 4 {
        options.bounds.initialisation = Some(Initialisation::PriorBox);
    }
    options
}

/// The designs of many random plants; only an unlucky pencil of eigenvalues may be refused.
fn random_designs(count: u64) -> Vec<Design> {
    let found: Vec<Design> = (0..count)
        .filter_map(|seed| match Design::new(&random_options(seed)) {
            Ok(design) => Some(design),
            Err(ConstructionError::SynthesisRejected { .. }) => None,
            Err(error) => panic!("{seed}: {error}"),
        })
        .collect();
    assert!(
        found.len() as u64 * 10 > count * 9,
        "only {} of {count}",
        found.len()
    );
    found
}

#[test]
fn no_run_within_the_bounds_alarms_whatever_is_lost_and_the_state_stays_in_its_interval() {
    let (mut tested, mut intervals) = (0_usize, 0_usize);
    for (number, design) in random_designs(120).into_iter().enumerate() {
        let model = &design.options.model;
        let (lower, upper) = (
            model.input_lower.clone().unwrap(),
            model.input_upper.clone().unwrap(),
        );
        for (run, draw) in [Draw::Vertex, Draw::Uniform, Draw::Vertex]
            .into_iter()
            .enumerate()
        {
            let mut plant = Simulation::new(model, (10 * number + run) as u64, draw);
            let mut diagnoser = ReducedOrderObserver::new(&design).unwrap();
            for k in 0..60 {
                let x = plant.x.clone();
                let mut y = plant.measure();
                let u: Vec<f64> = (0..lower.len())
                    .map(|i| plant.between(lower[i], upper[i]))
                    .collect();
                let mut received = u.clone();
                if k > 0 && run > 0 {
                    let burst = (25..31).contains(&k);
                    y.iter_mut()
                        .for_each(|y| *y = if burst || plant.chance(0.2) { f64::NAN } else { *y });
                    received
                        .iter_mut()
                        .for_each(|u| *u = if plant.chance(0.1) { f64::NAN } else { *u });
                }
                let record = step(&mut diagnoser, &y, &received);
                for (channel, description) in record.channels().iter().zip(&diagnoser.description().channels)
                {
                    assert!(
                        channel.ratio.is_nan() || channel.ratio <= 1.0,
                        "plant {number} at {k}, {description:?}: {channel:?}"
                    );
                    tested += usize::from(channel.is_evaluated());
                }
                assert_eq!(record.flags & flags::ALARM_NOW, 0);
                if let Some((centre, radius)) = diagnoser.state_interval() {
                    intervals += 1;
                    for i in 0..x.len() {
                        let margin = 1e-9 * (1.0 + x[i].abs());
                        assert!(
                            (x[i] - centre[i]).abs() <= radius[i] + margin,
                            "plant {number} at {k}"
                        );
                    }
                }
                plant.advance(&u, &vec![0.0; u.len()]);
            }
        }
    }
    assert!(tested > 100_000 && intervals > 8_000, "{tested} {intervals}");
}

/// Half widths by the recursion of the joint set without any reduction.
fn unreduced(plant: &Plant, design: &ObserverDesign, steps: usize) -> Vec<Vec<f64>> {
    let observer = &design.observer;
    let p = plant.outputs();
    let noise = DMatrix::from_diagonal(&plant.noise_bound);
    let disturbance = &observer.d_e * DMatrix::from_diagonal(&plant.disturbance.radius);
    let new_noise = -observer.noise_input() * &noise;
    let mut h = DMatrix::<f64>::zeros(plant.states(), 0);
    let mut out = Vec::new();
    for _ in 0..steps {
        let image = &design.tests * h.rows(0, p);
        let widths = image.abs().column_sum() + (&design.tests * &noise).abs().column_sum();
        out.push(widths.as_slice().to_vec());
        let moved = &observer.a_e * &h;
        let columns = moved
            .column_iter()
            .chain(disturbance.column_iter())
            .chain(new_noise.column_iter());
        h = DMatrix::from_columns(&columns.map(|column| column.into_owned()).collect::<Vec<_>>());
    }
    out
}

#[test]
fn the_tables_equal_the_unreduced_recursion() {
    for design in random_designs(40) {
        let isolation = &design.isolation;
        for part in std::iter::once(&design.main)
            .chain(&isolation.members)
            .chain(&isolation.estimators)
        {
            let expected = unreduced(&design.plant, part, 40);
            let last = part.thresholds.nrows() - 1;
            let scale = part.steady().amax();
            for (j, expected) in expected.iter().enumerate() {
                let found = part.thresholds.row(j.min(last));
                for (found, expected) in found.iter().zip(expected) {
                    // The last row also bounds what is left out.
                    let most = if j < last { 1e-12 } else { 1e-9 };
                    assert!(
                        *found >= expected - 1e-12 * scale && *found <= expected + most * scale,
                        "{j}"
                    );
                }
            }
        }
    }
}

#[test]
fn thresholds_grow_with_the_age_and_shrink_with_the_bounds() {
    for seed in 0..40 {
        let Ok(design) = Design::new(&random_options(seed)) else {
            continue;
        };
        let table = &design.main.thresholds;
        for j in 1..table.nrows() {
            for w in 0..table.ncols() {
                assert!(table[(j, w)] >= table[(j - 1, w)]);
            }
        }
        let mut plant = design.plant.clone();
        plant.noise_bound *= 0.5;
        plant.disturbance.radius *= 0.7;
        let observer = design.main.observer.clone();
        let reach = residual_diagnosis::reduced_order_observer::reach::Reach::new(&plant, &observer).unwrap();
        let narrow = ObserverDesign::new(observer, reach, design.main.tests.clone(), None).steady();
        for (narrow, wide) in narrow.iter().zip(design.main.steady().iter()) {
            assert!(*narrow <= 0.7 * wide + 1e-12, "{narrow} {wide}");
        }
    }
}

/// What a diagnoser with this plant says to a run with losses: residuals, half widths, state intervals.
fn story(design: &Design, outputs: &[usize]) -> Vec<f64> {
    let mut diagnoser = ReducedOrderObserver::new(design).unwrap();
    let model = other_plant("six_state", 1e-3).model;
    let mut plant = Simulation::new(&model, 3, Draw::Uniform);
    let mut out = Vec::new();
    for k in 0..40 {
        let y = plant.measure();
        let mut sent: Vec<f64> = outputs.iter().map(|&i| y[i]).collect();
        if k % 9 == 5 {
            let lost = outputs.iter().position(|&i| i == 1).unwrap();
            sent[lost] = f64::NAN;
        }
        let u = [(k as f64).sin(), 0.3];
        let record = step(&mut diagnoser, &sent, &u);
        for output in 0..3 {
            let own = outputs.iter().position(|&i| i == output).unwrap();
            let channel = channel(&diagnoser, &record, &format!("output_{own}"));
            out.extend([channel.residual, channel.upper]);
        }
        if let Some((centre, radius)) = diagnoser.state_interval() {
            out.extend(centre.iter().chain(radius));
        }
        plant.advance(&u, &[0.0; 2]);
    }
    out
}

fn assert_same_story(one: &[f64], other: &[f64], tolerance: f64) {
    assert_eq!(one.len(), other.len());
    for (one, other) in one.iter().zip(other) {
        assert!(
            (one - other).abs() <= tolerance * (1.0 + one.abs()),
            "{one} {other}"
        );
    }
}

#[test]
fn another_completion_of_c_changes_nothing_but_the_gain() {
    let mut options = other_plant("six_state", 1e-3);
    options.bounds.tests = vec![residual_diagnosis::reduced_order_observer::options::Test::Hull];
    options.bounds.generator_order = Some(400);
    options.isolation.enabled = false;
    let design = Design::new(&options).unwrap();
    let c = DMatrix::from_fn(3, 6, |i, j| options.model.c[i][j]);
    let other_rows = completion(&c).unwrap();
    let mix = DMatrix::from_row_slice(3, 3, &[1.0, 0.4, 0.0, -0.3, 2.0, 0.1, 0.2, 0.0, 0.5]);
    let plant = Plant::with_completion(&options.model, &(&mix * other_rows)).unwrap();
    // z2 = K x1 + x2: with x2 mixed, K is mixed as well.
    let k = &mix * &design.main.observer.k;
    let (observer, reach) = crate::fixtures::observer(&plant, k, DMatrix::zeros(3, 3));
    let mut other = design.clone();
    other.plant = plant;
    other.main = ObserverDesign::new(observer, reach, design.main.tests.clone(), None);
    assert_same_story(&story(&design, &[0, 1, 2]), &story(&other, &[0, 1, 2]), 1e-9);
}

#[test]
fn the_order_of_the_outputs_does_not_matter() {
    let mut options = other_plant("six_state", 1e-3);
    options.bounds.tests = vec![residual_diagnosis::reduced_order_observer::options::Test::Hull];
    options.bounds.generator_order = Some(400);
    options.isolation.enabled = false;
    let design = Design::new(&options).unwrap();
    let order = [2, 0, 1];
    options.model.c = order.iter().map(|&i| options.model.c[i].clone()).collect();
    let other = Design::new(&options).unwrap();
    assert_same_story(&story(&design, &[0, 1, 2]), &story(&other, &order), 1e-8);
}

/// A run with the fault of one actuator and lost samples: shares of alarms of its own member, and of estimates.
fn own_fault(
    options: &ReducedOrderObserverOptions,
    actuator: usize,
    size: f64,
    loss: f64,
    seed: u64,
) -> (usize, usize) {
    let design = Design::new(options).unwrap();
    let mut diagnoser = ReducedOrderObserver::new(&design).unwrap();
    let mut plant = Simulation::new(&options.model, seed, Draw::Vertex);
    let m = options.model.b[0].len();
    let (mut alarms, mut estimates) = (0, 0);
    let mut previous = 0.0;
    for k in 0..150 {
        let mut y = plant.measure();
        if k > 0 {
            y.iter_mut()
                .for_each(|y| *y = if plant.chance(loss) { f64::NAN } else { *y });
        }
        let u: Vec<f64> = (0..m).map(|j| (0.3 * k as f64 + j as f64).sin()).collect();
        let record = step(&mut diagnoser, &y, &u);
        let channels = &diagnoser.description().channels;
        for (channel, description) in record.channels().iter().zip(channels) {
            if description.name.starts_with(&format!("member_{actuator}_")) {
                alarms += usize::from(channel.ratio > 1.0);
            }
            if description.name == format!("fault_estimate_{actuator}") && channel.is_evaluated() {
                estimates += 1;
                let margin = 1e-9 * (1.0 + size.abs());
                assert!(
                    channel.lower - margin <= previous && previous <= channel.upper + margin,
                    "{previous} not in {channel:?} at {k}"
                );
            }
        }
        assert_eq!(
            diagnoser.exonerated() & 1 << actuator,
            0,
            "the faulty actuator is exonerated at {k}"
        );
        let mut f = vec![0.0; m];
        if k >= 40 {
            f[actuator] = size * (0.5 + 0.5 * plant.between(-1.0, 1.0));
        }
        previous = f[actuator];
        plant.advance(&u, &f);
    }
    (alarms, estimates)
}

#[test]
fn members_never_react_to_their_own_fault_whatever_its_size() {
    for name in ["vehicle_lateral", "six_state"] {
        for actuator in 0..2 {
            for size in [1e-3, 1.0, 1e3] {
                let (alarms, estimates) = own_fault(&other_plant(name, 1e-3), actuator, size, 0.0, 5);
                assert_eq!(alarms, 0, "{name} {actuator} {size}");
                assert!(estimates > 100 || name == "vehicle_lateral");
            }
        }
    }
}

#[test]
fn with_a_fault_bound_members_and_estimates_stay_true_through_gaps() {
    for name in ["vehicle_lateral", "six_state"] {
        let mut options = other_plant(name, 1e-3);
        options.isolation.fault_bound = Some(vec![2.0, 2.0]);
        for (actuator, seed) in [(0, 7), (1, 8), (0, 9), (1, 10)] {
            for loss in [0.05, 0.2] {
                let (alarms, estimates) = own_fault(&options, actuator, 2.0, loss, seed);
                assert_eq!(alarms, 0, "{name} {actuator} {loss}");
                assert!(estimates > 10, "{name} {actuator} {loss}: {estimates}");
            }
        }
    }
}

#[test]
fn without_a_fault_bound_members_would_accuse_falsely_so_that_they_are_not_believed() {
    let options = other_plant("vehicle_lateral", 1e-3);
    let alarms: usize = (0..6)
        .map(|seed| own_fault(&options, 1, 100.0, 0.05, seed).0)
        .sum();
    assert!(alarms > 0, "the case shows nothing");
}

#[test]
fn a_lost_command_without_a_box_ends_the_guarantee_until_a_reset_or_a_restart_from_its_box() {
    let mut options = servo(0.01);
    let y = [0.0, 0.0];
    let mut diagnoser = ReducedOrderObserver::new(&Design::new(&options).unwrap()).unwrap();
    let verdicts = |diagnoser: &mut ReducedOrderObserver, commands: [f64; 4]| {
        commands.map(|u| {
            let record = step(diagnoser, &y, &[u]);
            (record.verdict(), record.flags & flags::RESET != 0)
        })
    };
    let lost = verdicts(&mut diagnoser, [0.0, f64::NAN, 0.0, 0.0]);
    assert_eq!(lost[0].0, Verdict::Starting);
    // The sample that came without its command was still tested.
    assert_ne!(lost[1].0, Verdict::GuaranteeLost);
    assert_eq!(lost[2..], [(Verdict::GuaranteeLost, false); 2]);
    diagnoser.reset();
    assert_eq!(verdicts(&mut diagnoser, [0.0; 4])[0].0, Verdict::Starting);
    options.missing.restart_state_lower = Some(vec![-2.0; 3]);
    options.missing.restart_state_upper = Some(vec![2.0; 3]);
    let mut diagnoser = ReducedOrderObserver::new(&Design::new(&options).unwrap()).unwrap();
    let found = verdicts(&mut diagnoser, [0.0, f64::NAN, 0.0, 0.0]);
    assert_eq!(found[2], (Verdict::NotEvaluated, true));
    assert!(!found[3].1 && found[3].0 != Verdict::GuaranteeLost, "{found:?}");
}

#[test]
fn a_restart_from_its_box_narrows_what_a_long_gap_has_widened() {
    let mut options = servo(0.01);
    options.missing.max_width_ratio = 3.0;
    // A slow plant: in the gap the prediction widens to far more than this box.
    options.missing.restart_state_lower = Some(vec![-3.0, -3.0, -1.0]);
    options.missing.restart_state_upper = Some(vec![3.0, 3.0, 1.0]);
    let mut diagnoser = ReducedOrderObserver::new(&Design::new(&options).unwrap()).unwrap();
    let mut widths = Vec::new();
    let mut resets = Vec::new();
    for k in 0..60 {
        let y = if (20..50).contains(&k) {
            [f64::NAN; 2]
        } else {
            [0.0; 2]
        };
        let record = step(&mut diagnoser, &y, &[0.0]);
        widths.push(channel(&diagnoser, &record, "output_1").upper);
        if record.flags & flags::RESET != 0 {
            resets.push(k);
        }
        if k == 50 {
            assert_eq!(record.verdict(), Verdict::NotEvaluated);
            assert_ne!(record.flags & flags::THRESHOLD_INERT, 0);
        }
    }
    assert_eq!(resets, [50]);
    assert!(widths[51] < widths[50] / 2.0, "{:?}", &widths[48..54]);
}
