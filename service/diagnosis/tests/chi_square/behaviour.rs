//! Alarm rules, missing inputs, gaps, exclusion, restarts.

use crate::common::{
    assert_near, diagnoser, longitudinal, only, quarter_car, scalar, step, switched_quarter_car,
    without_calibration,
};
use residual_diagnosis::{
    chi_square::{
        ChiSquareDiagnoser, ChiSquareOptions, ExclusionCheck, OnIsolation, Schedule, SetModelError,
        StatisticKind, StepModel,
    },
    diagnoser::{Diagnoser, RestoreError, StepRecord, Verdict, flags},
};

/// The stable scalar example, the residual deciding at P_f = 0.005 per instant.
fn residual_only() -> ChiSquareOptions {
    only(without_calibration(scalar(0.8)), StatisticKind::Residual)
}

fn verdicts(options: &ChiSquareOptions, measurements: &[f64]) -> Vec<Verdict> {
    let mut diagnoser = diagnoser(options);
    measurements
        .iter()
        .map(|z| step(&mut diagnoser, &[*z], &[]).verdict())
        .collect()
}

fn skip(diagnoser: &mut ChiSquareDiagnoser) -> StepRecord {
    let mut record = StepRecord::new(diagnoser.description().channels.len());
    diagnoser.skip(&mut record);
    record
}

#[test]
fn a_fault_is_confirmed_by_consecutive_alarms_and_cleared_by_consecutive_silence() {
    use Verdict::{Fault, Nominal, NotEvaluated, Starting};
    let mut options = residual_only();
    (
        options.alarm.confirm_steps,
        options.alarm.clear_steps,
        options.alarm.warmup_steps,
    ) = (2, 3, 2);
    let nan = f64::NAN;
    // Alternating sign: every innovation is large while a value of 9 comes.
    let found = verdicts(&options, &[0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 9.0, -9.0, nan, 9.0]);
    assert_eq!(found[..2], [Starting, Starting]);
    assert_eq!(found[7..], [Fault, Fault, Fault]);
    let quiet = verdicts(
        &options,
        &[
            0.0, 0.0, nan, 0.0, 9.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        ],
    );
    assert_eq!(quiet[2], NotEvaluated);
    assert_eq!(*quiet.last().unwrap(), Nominal);
}

#[test]
fn an_instant_without_any_row_changes_no_counter() {
    let mut options = residual_only();
    options.alarm.confirm_steps = 2;
    let found = verdicts(&options, &[0.0, 9.0, f64::NAN, -9.0]);
    assert_eq!(
        found[1..],
        [Verdict::Nominal, Verdict::NotEvaluated, Verdict::Fault]
    );
}

#[test]
fn an_alarm_is_flagged_only_once_it_is_confirmed_and_the_channel_shows_it() {
    let mut options = residual_only();
    options.alarm.confirm_steps = 2;
    let mut diagnoser = diagnoser(&options);
    let alarms: Vec<bool> = [0.0, 9.0, -9.0]
        .into_iter()
        .map(|z| {
            let record = step(&mut diagnoser, &[z], &[]);
            let place = diagnoser
                .description()
                .channels
                .iter()
                .position(|channel| channel.name == "residual");
            let channel = record.channels()[place.unwrap()];
            assert_eq!(channel.ratio > 1.0, channel.residual > channel.upper);
            record.flags & flags::ALARM_NOW != 0
        })
        .collect();
    assert_eq!(alarms, [false, false, true]);
}

#[test]
fn the_first_complete_command_belongs_to_instant_zero_unless_one_is_configured() {
    let mut options = longitudinal();
    options.model.initial_input = None;
    let mut waiting = diagnoser(&options);
    let mut configured = options.clone();
    configured.model.initial_input = Some(vec![0.5]);
    let mut started = diagnoser(&configured);
    for u in [f64::NAN, 0.5] {
        assert_eq!(step(&mut waiting, &[9.0, 9.0], &[u]).verdict(), Verdict::Starting);
    }
    for k in 0..5 {
        let z = [0.1 * f64::from(k), 0.2];
        let (one, other) = (step(&mut waiting, &z, &[0.3]), step(&mut started, &z, &[0.3]));
        assert!(one.same_bits(&other));
    }
}

#[test]
fn a_missing_command_is_held_and_the_guarantee_lost_when_it_stays_away() {
    let mut options = longitudinal();
    options.alarm.input_max_hold_steps = 3;
    let (mut held, mut given) = (diagnoser(&options), diagnoser(&options));
    step(&mut held, &[0.0, 0.0], &[0.4]);
    step(&mut given, &[0.0, 0.0], &[0.4]);
    for _ in 0..3 {
        let (one, other) = (
            step(&mut held, &[0.1, 0.1], &[f64::NAN]),
            step(&mut given, &[0.1, 0.1], &[0.4]),
        );
        assert_eq!(one.flags & flags::INPUT_MISSING, flags::INPUT_MISSING);
        assert_eq!(one.verdict, other.verdict);
        assert_eq!(held.estimate(), given.estimate());
    }
    assert_eq!(
        step(&mut held, &[0.1, 0.1], &[f64::NAN]).verdict(),
        Verdict::GuaranteeLost
    );
    let before = held.covariance_factor().to_dense();
    let back = step(&mut held, &[0.1, 0.1], &[0.4]);
    assert_eq!(
        (back.verdict(), back.flags & flags::RESET),
        (Verdict::GuaranteeLost, flags::RESET)
    );
    // P grew by P_0.
    let (before, after) = (
        before.row(0).norm_squared(),
        held.covariance_factor().to_dense().row(0).norm_squared(),
    );
    assert!(after > before + 3.9 && after < before + 4.1, "{before} {after}");
    assert_eq!(step(&mut held, &[0.1, 0.1], &[0.4]).verdict(), Verdict::Nominal);
}

#[test]
fn a_number_that_names_no_model_is_a_missing_command() {
    let mut diagnoser = diagnoser(&switched_quarter_car());
    for (number, missing) in [
        (0.0, false),
        (2.0, false),
        (3.0, true),
        (-1.0, true),
        (0.5, true),
        (f64::NAN, true),
    ] {
        let record = step(&mut diagnoser, &[0.0, 0.0], &[0.0, number]);
        assert_eq!(record.flags & flags::INPUT_MISSING != 0, missing, "{number}");
    }
}

#[test]
fn a_long_gap_restarts_the_diagnoser() {
    let mut options = residual_only();
    options.alarm.max_gap_steps = 3;
    let (mut diagnoser, mut fresh) = (diagnoser(&options), diagnoser(&options));
    (0..10).for_each(|_| {
        step(&mut diagnoser, &[1.0], &[]);
    });
    for _ in 0..3 {
        assert_eq!(skip(&mut diagnoser).flags & flags::RESET, 0);
    }
    assert_ne!(skip(&mut diagnoser).flags & flags::RESET, 0);
    assert_eq!(skip(&mut diagnoser).flags & flags::RESET, 0);
    for _ in 0..5 {
        assert!(step(&mut diagnoser, &[0.1], &[]).same_bits(&step(&mut fresh, &[0.1], &[])));
    }
}

#[test]
fn a_short_gap_is_stepped_without_rows() {
    let options = residual_only();
    let (mut one, mut other) = (diagnoser(&options), diagnoser(&options));
    for k in 0..20 {
        if k % 3 == 2 {
            skip(&mut one);
            step(&mut other, &[f64::NAN], &[]);
        } else {
            assert!(step(&mut one, &[0.1], &[]).same_bits(&step(&mut other, &[0.1], &[])));
        }
    }
}

/// Runs a wheel fault of 1 m/s until the sensor is isolated.
fn isolate(options: &ChiSquareOptions) -> (ChiSquareDiagnoser, StepRecord) {
    let mut diagnoser = diagnoser(options);
    for k in 0..200 {
        let wheel = if k < 50 { 0.0 } else { 1.0 };
        let record = step(&mut diagnoser, &[0.0, wheel], &[0.0]);
        if record.verdict() == Verdict::Isolated {
            return (diagnoser, record);
        }
    }
    panic!("never isolated");
}

#[test]
fn an_isolated_sensor_is_named_with_the_size_of_its_fault() {
    let (mut diagnoser, record) = isolate(&longitudinal());
    assert_eq!((record.certainly_faulty, record.possibly_faulty), (2, 2));
    assert_eq!(diagnoser.excluded(), 0);
    assert_near(
        || "size".into(),
        record.fault_estimate,
        1.0,
        0.0,
        4.0 * record.fault_estimate_half_width,
    );
    // Latched until the alarm clears.
    assert_eq!(
        step(&mut diagnoser, &[0.0, 1.0], &[0.0]).verdict(),
        Verdict::Isolated
    );
}

#[test]
fn an_excluded_sensor_counts_as_missing_until_it_is_readmitted() {
    let mut options = longitudinal();
    options.alarm.on_isolation = OnIsolation::ExcludeAndCompensate;
    let (mut diagnoser, record) = isolate(&options);
    assert_eq!(
        (record.flags & flags::RESET, diagnoser.excluded()),
        (flags::RESET, 2)
    );
    for _ in 0..100 {
        let record = step(&mut diagnoser, &[0.0, 1e6], &[0.0]);
        assert_eq!(diagnoser.outcome().available_rows(), 1);
        assert_eq!(
            (record.verdict(), record.certainly_faulty),
            (Verdict::Isolated, 2)
        );
    }
    assert_near(|| "position".into(), diagnoser.estimate()[0], 0.0, 0.0, 0.1);
    diagnoser.readmit(1);
    assert_eq!(
        step(&mut diagnoser, &[0.0, 0.0], &[0.0]).verdict(),
        Verdict::Nominal
    );
    assert_eq!(diagnoser.outcome().available_rows(), 2);
}

#[test]
fn a_sensor_that_the_others_cannot_replace_is_reported_but_not_excluded() {
    let mut options = longitudinal();
    options.alarm.on_isolation = OnIsolation::Exclude;
    let isolated = |options: &ChiSquareOptions| {
        let mut diagnoser = diagnoser(options);
        (0..200).for_each(|k| {
            step(&mut diagnoser, &[if k < 50 { 0.0 } else { 30.0 }, 0.0], &[0.0]);
        });
        diagnoser
    };
    let kept = isolated(&options);
    assert_eq!(kept.design().report.indispensable_sensors, [0]);
    assert!(
        kept.design()
            .report
            .warnings
            .iter()
            .any(|warning| warning.contains("measurement_0"))
    );
    assert_eq!(kept.excluded(), 0);
    options.alarm.exclusion_check = ExclusionCheck::Warn;
    assert_eq!(isolated(&options).excluded(), 1);
}

#[test]
fn a_reset_readmits_every_sensor_and_starts_anew() {
    let mut options = longitudinal();
    options.alarm.on_isolation = OnIsolation::Exclude;
    let (mut used, _) = isolate(&options);
    let (mut fresh, mut states) = (diagnoser(&options), [Vec::new(), Vec::new()]);
    used.reset();
    used.save(&mut states[0]);
    fresh.save(&mut states[1]);
    assert!(states[0] == states[1]);
    assert!(step(&mut used, &[0.1, 0.1], &[0.0]).same_bits(&step(&mut fresh, &[0.1, 0.1], &[0.0])));
}

#[test]
fn a_saved_state_belongs_to_its_configuration() {
    let mut state = Vec::new();
    let mut other = longitudinal();
    diagnoser(&other).save(&mut state);
    other.cusum.reference = 0.3;
    assert_eq!(
        diagnoser(&other).restore(&state),
        Err(RestoreError::OtherConfiguration)
    );
}

#[test]
fn matrices_are_only_taken_with_the_external_schedule_and_their_shapes() {
    let mut options = quarter_car();
    let model = StepModel::new(&options.model.matrices(), "model").unwrap();
    assert_eq!(
        diagnoser(&options).set_model(&model),
        Err(SetModelError::NotExternal)
    );
    options.model.schedule = Schedule::External;
    let mut external = diagnoser(&options);
    assert_eq!(external.set_model(&model), Ok(()));
    let other = StepModel::new(&longitudinal().model.matrices(), "model").unwrap();
    assert_eq!(external.set_model(&other), Err(SetModelError::Shape));
}

#[test]
fn a_measurement_noise_that_is_not_positive_definite_loses_the_guarantee() {
    let mut options = quarter_car();
    options.model.schedule = Schedule::External;
    let mut external = diagnoser(&options);
    let mut model = StepModel::new(&options.model.matrices(), "model").unwrap();
    model.measurement_noise[(0, 0)] = -1.0;
    external.set_model(&model).unwrap();
    assert_eq!(
        step(&mut external, &[0.0, 0.0], &[0.0]).verdict(),
        Verdict::GuaranteeLost
    );
    model.measurement_noise[(0, 0)] = 4e-6;
    external.set_model(&model).unwrap();
    // u(0) is configured, so that the next step is instant 1 again.
    assert_eq!(
        step(&mut external, &[0.0, 0.0], &[0.0]).verdict(),
        Verdict::Nominal
    );
}

#[test]
fn statistics_outside_the_decision_are_published_but_never_alarm() {
    let mut options = longitudinal();
    options.statistics.decision = vec![StatisticKind::Glr];
    let mut diagnoser = diagnoser(&options);
    let names: Vec<String> = diagnoser
        .description()
        .channels
        .iter()
        .map(|channel| channel.name.clone())
        .collect();
    let mut beyond = 0;
    for k in 0..100 {
        let record = step(&mut diagnoser, &[0.0, if k < 50 { 0.0 } else { 1.0 }], &[0.0]);
        for (name, channel) in names.iter().zip(record.channels()) {
            let outside = channel.residual > channel.upper || channel.residual < channel.lower;
            beyond += usize::from(outside);
            assert!(
                name == "glr" || !channel.is_evaluated() || channel.ratio == 0.0,
                "{name}: {channel:?}"
            );
        }
    }
    assert!(beyond > 50);
}
