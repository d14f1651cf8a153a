//! What must hold for any plant, any sensors, any schedule and any losses (method sheet 8(b)).

use crate::random::{
    Taken, assert_traces, random_commands, random_design, random_instants, random_rates, random_samples, run,
    trace,
};
use crate::simulation::{Draw, paper_design, simulate, stay};
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    design::{Form, ImmDesign, Mixing, ModeTransition},
    estimator::{ImmEstimator, Sample},
    fusion::Fusion,
    inputs::InputHistory,
    plant::{LinearPlant, Plant},
    transition::TransitionTable,
};

const CASES: u64 = 40;
const STEPS: usize = 12;

struct Case {
    design: ImmDesign,
    instants: Vec<i64>,
    samples: Vec<Taken>,
    commands: InputHistory,
    draw: Draw,
}

fn case(seed: u64) -> Case {
    let mut draw = Draw::new(seed);
    let design = random_design(&mut draw);
    let instants = random_instants(&mut draw, STEPS);
    let end = instants[STEPS - 1];
    let count = 10 + draw.below(40);
    let samples = random_samples(&mut draw, &design, count, end);
    let commands = random_commands(&mut draw, &design, end);
    Case {
        design,
        instants,
        samples,
        commands,
        draw,
    }
}

impl Case {
    fn trace(&self, form: Form) -> Vec<Vec<f64>> {
        let design = ImmDesign {
            form,
            ..self.design.clone()
        };
        trace(&design, &self.samples, &self.instants, &self.commands)
    }

    fn linear_plant(&self) -> &LinearPlant {
        match &self.design.plant {
            Plant::Constant(plant) => plant,
            _ => panic!("not a constant plant"),
        }
    }
}

#[test]
fn probabilities_sum_to_one_and_covariances_are_symmetric_and_not_negative() {
    for seed in 0..CASES {
        let mut case = case(seed);
        for (form, walk) in [
            (Form::Sequential, 0.0),
            (Form::Sequential, 0.5),
            (Form::SequentialSquareRoot, 0.5),
            (Form::BatchUnobserved, 0.0),
        ] {
            case.design.form = form;
            for mode in case.design.modes.iter_mut().skip(1) {
                mode.random_walk_psd.fill(walk);
            }
            let mut fusion = Fusion::new(&case.design);
            run(
                &case.design,
                &case.samples,
                &case.instants,
                &case.commands,
                |posterior, _, _| {
                    let sum: f64 = fusion.read_probability(posterior).iter().sum();
                    assert!((sum - 1.0).abs() < 1e-12, "{seed} {form:?}: {sum}");
                    let fused = fusion.fuse(posterior).1.to_dense();
                    let modes = (0..case.design.modes.len())
                        .map(|m| fusion.mode_covariance(posterior, m).unwrap().to_dense());
                    for covariance in modes.chain([fused]) {
                        let trace = covariance.trace();
                        assert!((&covariance - covariance.transpose()).amax() <= 1e-14 * trace);
                        let least = covariance.symmetric_eigenvalues().min();
                        assert!(least >= -1e-12 * trace, "{seed} {form:?}: {least} of {trace}");
                    }
                },
            );
        }
    }
}

#[test]
fn repetition_gives_the_same_bits() {
    for seed in 0..CASES {
        let case = case(seed);
        for form in [
            Form::Sequential,
            Form::SequentialSquareRoot,
            Form::BatchUnobserved,
        ] {
            assert_eq!(case.trace(form), case.trace(form), "{seed} {form:?}");
        }
    }
}

#[test]
fn without_unknown_losses_all_forms_agree() {
    for seed in 0..CASES {
        let mut case = case(seed);
        // What is lost is absent, so that what is there arrived for certain.
        case.samples.retain(|_| case.draw.uniform() < 0.7);
        case.design
            .sensors
            .iter_mut()
            .for_each(|sensor| sensor.arrival_probability = 1.0);
        let sequential = case.trace(Form::Sequential);
        for form in [Form::SequentialSquareRoot, Form::BatchUnobserved] {
            assert_traces(&format!("{seed} {form:?}"), &case.trace(form), &sequential, 1e-9);
        }
    }
}

#[test]
fn the_square_root_form_agrees_with_a_random_walk_of_the_amplitude() {
    for seed in 0..CASES {
        let mut case = case(seed);
        for (m, mode) in case.design.modes.iter_mut().enumerate() {
            mode.random_walk_psd.fill(0.2 * (m % 3) as f64);
        }
        let sequential = case.trace(Form::Sequential);
        assert_traces(
            &format!("{seed}"),
            &case.trace(Form::SequentialSquareRoot),
            &sequential,
            1e-9,
        );
    }
}

#[test]
fn the_order_of_slots_does_not_matter_in_the_batch_form() {
    for seed in 0..CASES {
        let mut case = case(seed);
        case.design.form = Form::BatchUnobserved;
        let samples: Vec<_> = case
            .samples
            .iter()
            .filter(|(time, ..)| *time <= case.instants[0] * 3)
            .cloned()
            .collect();
        let previous: Vec<Vec<f64>> = samples
            .iter()
            .map(|(_, _, values)| values.iter().map(|_| case.draw.normal()).collect())
            .collect();
        let end = case.instants[0] * 3;
        let posterior = |order: &[usize]| {
            let mut estimator = ImmEstimator::new(&case.design, samples.len()).unwrap();
            let mut posterior = estimator.start(0);
            let sample = |&place: &usize| {
                let (time_ns, sensor, values) = &samples[place];
                Sample {
                    time_ns: *time_ns,
                    sensor: *sensor,
                    values,
                    held_before: Some(&previous[place]),
                }
            };
            estimator.advance(&mut posterior, end, order.iter().map(sample), &case.commands);
            let means = posterior
                .modes
                .iter()
                .map(|mode| mode.mean.clone())
                .collect::<Vec<_>>();
            [means, vec![estimator.log_likelihood().to_vec()]].concat()
        };
        let straight: Vec<usize> = (0..samples.len()).collect();
        let mut shuffled = straight.clone();
        for i in (1..shuffled.len()).rev() {
            shuffled.swap(i, case.draw.below(i + 1));
        }
        assert_traces(
            &format!("{seed}"),
            &posterior(&shuffled),
            &posterior(&straight),
            1e-10,
        );
    }
}

#[test]
fn the_order_of_equal_stamps_does_not_matter() {
    for seed in 0..CASES {
        let mut case = case(seed);
        let groups = case.samples.len() / 3;
        for group in 0..groups {
            let time = case.samples[3 * group].0;
            case.samples[3 * group..3 * group + 3]
                .iter_mut()
                .for_each(|sample| sample.0 = time);
        }
        for form in [Form::Sequential, Form::SequentialSquareRoot] {
            let straight = case.trace(form);
            let mut reversed = case.samples.clone();
            reversed[..3 * groups].chunks_mut(3).for_each(<[Taken]>::reverse);
            let design = ImmDesign {
                form,
                ..case.design.clone()
            };
            let reversed = trace(&design, &reversed, &case.instants, &case.commands);
            assert_traces(&format!("{seed} {form:?}"), &reversed, &straight, 1e-9);
        }
    }
}

#[test]
fn with_a_single_mode_more_fusion_instants_change_nothing() {
    for seed in 0..CASES {
        let mut case = case(seed);
        let design = &mut case.design;
        design.modes.truncate(1);
        design.prior.mode_probability = vec![1.0];
        design.transition = ModeTransition::PerStep(DMatrix::identity(1, 1));
        let coarse: Vec<i64> = case.instants.iter().copied().skip(2).step_by(3).collect();
        let states = |instants: &[i64]| {
            let mut out = Vec::new();
            run(
                &case.design,
                &case.samples,
                instants,
                &case.commands,
                |posterior, _, _| {
                    if coarse.contains(&posterior.instant_ns) {
                        let mode = &posterior.modes[0];
                        out.push([mode.mean.as_slice(), mode.spread.to_dense().as_slice()].concat());
                    }
                },
            );
            out
        };
        assert_traces(
            &format!("{seed}"),
            &states(&case.instants),
            &states(&coarse),
            1e-10,
        );
    }
}

#[test]
fn transition_matrices_form_a_semigroup() {
    let mut draw = Draw::new(1);
    for modes in 1..7 {
        let stay = ModeTransition::Stay {
            probability: 0.97,
            period_s: 0.7,
        };
        for transition in [ModeTransition::Rate(random_rates(&mut draw, modes)), stay] {
            let mut table = TransitionTable::new(&transition, modes);
            for _ in 0..20 {
                let [h1, h2] = [0, 1].map(|_| (draw.uniform() * 3e6) as i64);
                let product = table.over(h1).to_dense() * table.over(h2).to_dense();
                assert!((product - table.over(h1 + h2).to_dense()).amax() < 1e-12);
            }
            let forever = table.over(i64::MAX).to_dense();
            assert!(forever.iter().all(|entry| entry.is_finite() && *entry >= 0.0));
        }
    }
}

#[test]
fn probabilities_and_amplitudes_do_not_depend_on_the_units_of_the_states() {
    for seed in 0..CASES {
        let mut case = case(seed);
        let nx = case.design.plant.sizes().0;
        let units = DMatrix::from_fn(nx, nx, |i, j| {
            10_f64.powi((i % 3) as i32 - 1) * (f64::from(u8::from(i == j)) + 0.1 * case.draw.normal())
        });
        let Some(inverse) = units.clone().try_inverse() else {
            continue;
        };
        let plant = case.linear_plant().clone();
        let mut other = case.design.clone();
        let symmetric = |matrix: DMatrix<f64>| (&matrix + matrix.transpose()) / 2.0;
        other.plant = Plant::Constant(LinearPlant {
            a: &units * &plant.a * &inverse,
            b: &units * &plant.b,
            f: &units * &plant.f,
            noise: symmetric(&units * &plant.noise * units.transpose()),
        });
        for sensor in &mut other.sensors {
            sensor.measurement_matrix = &sensor.measurement_matrix * &inverse;
        }
        let state = nalgebra::DVector::from_column_slice(&other.prior.state);
        other.prior.state = (&units * state).as_slice().to_vec();
        other.prior.state_covariance = symmetric(&units * &other.prior.state_covariance * units.transpose());
        if ImmEstimator::new(&other, 1).is_err() {
            continue;
        }
        let told = |design: &ImmDesign| {
            let mut out = Vec::new();
            run(
                design,
                &case.samples,
                &case.instants,
                &case.commands,
                |posterior, _, _| {
                    out.push(posterior.log_probability.iter().map(|log| log.exp()).collect());
                    out.push(
                        posterior
                            .modes
                            .iter()
                            .flat_map(|mode| mode.mean[nx..].to_vec())
                            .collect(),
                    );
                },
            );
            out
        };
        assert_traces(&format!("{seed}"), &told(&other), &told(&case.design), 1e-9);
    }
}

#[test]
fn new_names_of_modes_and_sensors_only_permute() {
    for seed in 0..CASES {
        let mut case = case(seed);
        let modes = case.design.modes.len();
        let mut order: Vec<usize> = (0..modes).collect();
        for i in (2..modes).rev() {
            order.swap(i, 1 + case.draw.below(i));
        }
        let sensors = case.design.sensors.len();
        let mut other = case.design.clone();
        other.modes = order.iter().map(|&m| case.design.modes[m].clone()).collect();
        other.prior.mode_probability = order
            .iter()
            .map(|&m| case.design.prior.mode_probability[m])
            .collect();
        let ModeTransition::Rate(gamma) = &case.design.transition else {
            panic!()
        };
        other.transition =
            ModeTransition::Rate(DMatrix::from_fn(modes, modes, |i, j| gamma[(order[i], order[j])]));
        other.sensors.reverse();
        let renamed = |(time, sensor, values): &Taken| (*time, sensors - 1 - sensor, values.clone());
        let samples: Vec<_> = case.samples.iter().map(renamed).collect();
        let one = case.trace(Form::Sequential);
        let other = trace(&other, &samples, &case.instants, &case.commands);
        let permuted: Vec<Vec<f64>> = (0..one.len())
            .map(|line| one[line / modes * modes + order[line % modes]].clone())
            .collect();
        assert_traces(&format!("{seed}"), &other, &permuted, 1e-9);
    }
}

#[test]
fn a_pole_that_is_far_too_fast_for_the_batch_form_is_no_difficulty_one_by_one() {
    for form in [Form::Sequential, Form::SequentialSquareRoot] {
        let mut draw = Draw::new(3);
        let mut design = random_design(&mut draw);
        let (_, inputs, channels) = design.plant.sizes();
        design.form = form;
        design.plant = Plant::Constant(LinearPlant {
            a: DMatrix::from_row_slice(2, 2, &[-800.0, 1.0, 0.0, -0.1]),
            b: DMatrix::zeros(2, inputs),
            f: DMatrix::from_fn(2, channels, |i, j| if i == 1 { 1.0 + j as f64 } else { 0.5 }),
            noise: DMatrix::identity(2, 2),
        });
        design.prior.state = vec![0.0; 2];
        design.prior.state_covariance = DMatrix::identity(2, 2);
        design.sensors.truncate(1);
        design.sensors[0].measurement_matrix = DMatrix::identity(2, 2);
        design.sensors[0].noise_covariance = DMatrix::identity(2, 2);
        let instants: Vec<i64> = (1..30).map(|k| k * 1_000_000_000).collect();
        let samples = random_samples(&mut draw, &design, 60, instants[28]);
        let commands = random_commands(&mut draw, &design, instants[28]);
        run(&design, &samples, &instants, &commands, |posterior, _, report| {
            assert_eq!(report.update_rejected, 0);
            assert!(
                posterior
                    .modes
                    .iter()
                    .all(|mode| mode.mean.iter().all(|x| x.abs() < 100.0))
            );
        });
    }
}

#[test]
fn small_noise_after_a_wide_prior_keeps_both_forms_together() {
    // Without symmetric updates the covariance becomes indefinite here.
    let steps = 2000;
    let mut design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(0.99));
    design.prior.state_covariance = DMatrix::identity(4, 4) * 1e4;
    for sensor in &mut design.sensors {
        sensor.noise_covariance = DMatrix::identity(2, 2) * 0.01;
    }
    let truth = simulate(&design, steps, [0.0; 2], 0, &mut Draw::new(5));
    let received = truth.slots.into_iter();
    let samples: Vec<Taken> = received
        .filter_map(|slot| Some((slot.time_us * 1000, slot.sensor, slot.value?)))
        .collect();
    let instants: Vec<i64> = (1..=steps as i64).map(|k| k * 1_000_000_000).collect();
    let commands = InputHistory::new(&[0.5, 0.5], 0);
    let of = |form: Form| {
        let design = ImmDesign {
            form,
            ..design.clone()
        };
        trace(&design, &samples, &instants, &commands)
    };
    assert_traces(
        "wide prior",
        &of(Form::SequentialSquareRoot),
        &of(Form::Sequential),
        1e-9,
    );
}
