//! What must hold between two banks, or two runs of one.

use super::case::{Case, Command, Loss, Noise, Uncertainty};
use super::check::{build, options};
use super::plant::{Sample, sample};
use proptest::prelude::*;
use proptest::test_runner::{Config, RngSeed};
use residual_diagnosis::diagnoser::{Diagnoser, StepInput, StepRecord};
use residual_diagnosis::model::{LinearModel, ModelOptions};
use residual_diagnosis::unknown_input_filter::UnknownInputFilterBank;
use residual_diagnosis::unknown_input_filter::checks::check_modes;
use residual_diagnosis::unknown_input_filter::options::{
    Form, GainRule, Initialisation, Publish, TestRule, UnknownInputFilterOptions,
};

fn config(cases: u32) -> Config {
    Config {
        cases,
        rng_seed: RngSeed::Fixed(7),
        failure_persistence: None,
        ..Config::default()
    }
}

/// Cases that start from the initial box and lose nothing, so that the first test of two banks starts from the
/// same set.
fn regular_cases() -> impl Strategy<Value = Case> {
    super::case::cases().prop_map(|case| Case {
        loss: Loss::Nothing,
        initialisation: Initialisation::Prior,
        parity: false,
        pairs: false,
        paper: false,
        test: TestRule::Tight,
        gain: GainRule::RowWise,
        outward_rounding: false,
        ..case
    })
}

/// A plant of this case whose modes can all be tested.
fn testable(case: &Case) -> Option<(Sample, UnknownInputFilterOptions)> {
    (0..20).find_map(|attempt| {
        let sample = sample(case, attempt);
        let model = LinearModel::new(&sample.model, 0.1).unwrap();
        let mut options = options(case, &sample, &model);
        options.filter.publish = Publish::All;
        check_modes(&model, &options, &options.bank.modes(case.actuators)).ok()?;
        Some((sample, options))
    })
}

fn bank(model: &ModelOptions, options: &UnknownInputFilterOptions) -> UnknownInputFilterBank {
    UnknownInputFilterBank::new(LinearModel::new(model, 0.1).unwrap(), options).unwrap()
}

fn advance(bank: &mut UnknownInputFilterBank, sample: &Sample, instants: usize) -> StepRecord {
    let mut record = StepRecord::new(bank.description().channels.len());
    for k in 0..instants {
        record.flags = 0;
        let (measurements, commands) = (&sample.run.y[k], &sample.run.u[k]);
        bank.step(&StepInput::new(measurements, commands), &mut record);
    }
    record
}

/// Half widths of the evaluated projector rows.
fn output_half_widths(bank: &UnknownInputFilterBank, record: &StepRecord) -> Vec<(String, f64)> {
    let channels = bank.description().channels.iter().zip(record.channels());
    channels
        .filter(|(description, channel)| description.name.contains("_output_") && channel.is_evaluated())
        .map(|(description, channel)| (description.name.clone(), channel.upper))
        .collect()
}

fn first_half_widths(
    model: &ModelOptions,
    options: &UnknownInputFilterOptions,
    sample: &Sample,
) -> Vec<(String, f64)> {
    let mut bank = bank(model, options);
    let record = advance(&mut bank, sample, 2);
    output_half_widths(&bank, &record)
}

proptest! {
    #![proptest_config(config(200))]

    #[test]
    fn the_row_wise_set_is_never_wider_than_the_frobenius_set_in_the_same_step(case in regular_cases()) {
        let Some((sample, mut options)) = testable(&case) else { return Ok(()) };
        options.filter.outward_rounding = false;
        let mut row_wise = bank(&sample.model, &options);
        options.filter.gain = GainRule::Frobenius;
        options.filter.gain_sweeps = 0;
        let mut frobenius = bank(&sample.model, &options);
        let records = [advance(&mut row_wise, &sample, 2), advance(&mut frobenius, &sample, 2)];
        prop_assert!(records.iter().all(|record| record.certainly_faulty == 0));
        let mut compared = 0;
        for i in 0..row_wise.modes().len() {
            if let (Some((_, narrow)), Some((_, wide))) = (row_wise.state_set(i), frobenius.state_set(i)) {
                for (narrow, wide) in narrow.iter().zip(&wide) {
                    prop_assert!(*narrow <= wide * (1.0 + 1e-9) + 1e-12, "{narrow} above {wide}");
                    compared += 1;
                }
            }
        }
        prop_assert!(compared > 0);
    }

    #[test]
    fn the_coupled_test_is_never_wider_than_the_printed_one_in_the_same_step(case in regular_cases()) {
        let Some((sample, mut options)) = testable(&case) else { return Ok(()) };
        options.filter.outward_rounding = false;
        options.filter.gain_sweeps = 0;
        let coupled = first_half_widths(&sample.model, &options, &sample);
        options.filter.form = Form::Paper;
        options.filter.test = TestRule::Printed;
        let printed = first_half_widths(&sample.model, &options, &sample);
        prop_assert!(!coupled.is_empty());
        for (name, width) in &coupled {
            let (_, wide) = printed.iter().find(|(other, _)| other == name).unwrap();
            prop_assert!(*width <= wide * (1.0 + 1e-9) + 1e-12, "{name}: {width} above {wide}");
        }
    }

    #[test]
    fn half_widths_grow_with_every_bound(case in regular_cases(), which in 0..3_usize, factor in 1.01..3.0_f64) {
        let Some((sample, options)) = testable(&case) else { return Ok(()) };
        let mut wider = sample.model.clone();
        let bounds: Vec<&mut f64> = match which {
            0 => wider.disturbance_bound.iter_mut().collect(),
            1 => wider.measurement_noise_bound.iter_mut().collect(),
            _ => wider.a_uncertainty.iter_mut().flatten().collect(),
        };
        bounds.into_iter().for_each(|bound| *bound *= factor);
        let before = first_half_widths(&sample.model, &options, &sample);
        let after = first_half_widths(&wider, &options, &sample);
        prop_assert_eq!(before.len(), after.len());
        for ((name, narrow), (_, wide)) in before.iter().zip(&after) {
            prop_assert!(*narrow <= wide * (1.0 + 1e-12), "{name}: {narrow} above {wide}");
        }
    }

    #[test]
    fn scaling_the_paper_form_by_a_power_of_two_scales_its_bounds_bit_for_bit(
        case in regular_cases(),
        exponent in -6..6_i32,
    ) {
        let Some((sample, mut options)) = testable(&case) else { return Ok(()) };
        options.filter.form = Form::Paper;
        options.filter.gain_sweeps = 0;
        options.filter.reduction = None;
        let factor = 2.0_f64.powi(exponent);
        let scaled = |values: &[f64]| values.iter().map(|value| value * factor).collect::<Vec<f64>>();
        let mut model = sample.model.clone();
        model.disturbance_bound = scaled(&model.disturbance_bound);
        model.measurement_noise_bound = scaled(&model.measurement_noise_bound);
        model.initial_state_center = model.initial_state_center.as_deref().map(scaled);
        model.initial_state_radius = model.initial_state_radius.as_deref().map(scaled);
        for bound in [&mut model.state_box_lower, &mut model.state_box_upper] {
            *bound = bound.as_deref().map(scaled);
        }
        for bound in [&mut model.input_lower, &mut model.input_upper] {
            *bound = bound.as_deref().map(scaled);
        }
        let (mut original, mut other) = (bank(&sample.model, &options), bank(&model, &options));
        let mut records = [0; 2].map(|_| StepRecord::new(original.description().channels.len()));
        for k in 0..40 {
            let (y, u) = (&sample.run.y[k], &sample.run.u[k]);
            original.step(&StepInput::new(y, u), &mut records[0]);
            other.step(&StepInput::new(&scaled(y), &scaled(u)), &mut records[1]);
            let rows = original.description().channels.iter().zip(records[0].channels().iter().zip(records[1].channels()));
            for (description, (one, two)) in rows.filter(|(description, _)| description.name.contains("_output_")) {
                prop_assert_eq!((one.lower * factor).to_bits(), two.lower.to_bits(), "{} at {}", description.name, k);
                prop_assert_eq!((one.residual * factor).to_bits(), two.residual.to_bits());
                prop_assert_eq!((one.upper * factor).to_bits(), two.upper.to_bits());
            }
        }
    }
}

proptest! {
    #![proptest_config(config(60))]

    #[test]
    fn a_replay_is_identical_bit_for_bit(case in super::case::cases()) {
        let Some((sample, model, options)) = build(&case) else { return Ok(()) };
        let Ok(mut first) = UnknownInputFilterBank::new(model.clone(), &options) else { return Ok(()) };
        let mut second = UnknownInputFilterBank::new(model, &options).unwrap();
        advance(&mut second, &sample, 77);
        second.reset();
        let channels = first.description().channels.len();
        let mut records = [StepRecord::new(channels), StepRecord::new(channels)];
        for (y, u) in sample.run.y.iter().zip(&sample.run.u) {
            for (bank, record) in [&mut first, &mut second].into_iter().zip(&mut records) {
                record.flags = 0;
                bank.step(&StepInput::new(y, u), record);
            }
            prop_assert!(records[0].same_bits(&records[1]));
        }
    }
}

/// The kinds that the strategies above must be able to draw.
#[test]
fn the_strategy_draws_every_kind_of_case() {
    use proptest::strategy::ValueTree;
    let mut runner = proptest::test_runner::TestRunner::new(config(1));
    let drawn: Vec<Case> = (0..500)
        .map(|_| super::case::cases().new_tree(&mut runner).unwrap().current())
        .collect();
    let has = |test: &dyn Fn(&Case) -> bool| drawn.iter().any(test);
    assert!(has(&|c| c.paper) && has(&|c| !c.paper && c.parity && c.pairs && c.outward_rounding));
    assert!(has(&|c| matches!(c.noise, Noise::Vertex)) && has(&|c| matches!(c.noise, Noise::Square)));
    assert!(has(
        &|c| matches!(c.uncertainty, Uncertainty::Varying) && matches!(c.loss, Loss::Mixed)
    ));
    assert!(has(
        &|c| matches!(c.command, Command::Feedback) && c.gain == GainRule::Fixed
    ));
}
