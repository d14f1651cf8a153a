//! Gains on their way through a file: what was found runs again unchanged, what was altered is refused, and what they
//! are said to achieve holds in simulation.

use crate::fixtures::{design, other_plant, servo};
use crate::simulation::{Draw, Simulation, random_plant};
use nalgebra::DVector;
use residual_diagnosis::{
    achieved::Achieved,
    diagnoser::flags,
    gains::{
        error::GainsError,
        file::{Entry, hash_of_inputs},
    },
    method::{MethodOptions, Refusal},
    reduced_order_observer::{
        ReducedOrderObserver,
        design::Design,
        floors::step_response,
        gains::ReducedOrderObserverGains,
        options::{Gains, Mode, NamedM, ObserverM, ReducedOrderObserverOptions},
        source::Source,
    },
};

fn vehicle() -> ReducedOrderObserverOptions {
    let mut options = other_plant("vehicle_lateral", 1e-3);
    options.isolation.poles = vec![0.4, 0.5];
    options
}

fn found(options: &ReducedOrderObserverOptions) -> ReducedOrderObserverGains {
    options.find_gains(0.1).unwrap().gains
}

/// The gains after they were written and read.
fn read_back(gains: &ReducedOrderObserverGains) -> ReducedOrderObserverGains {
    toml::from_str(&toml::to_string(gains).unwrap()).unwrap()
}

/// The entry of a gains file.
fn entry(
    options: &ReducedOrderObserverOptions,
    gains: &ReducedOrderObserverGains,
    achieved: Achieved,
) -> Entry {
    Entry {
        name: "servo".to_owned(),
        method: ReducedOrderObserverOptions::METHOD.to_owned(),
        sample_time_s: 0.1,
        inputs: hash_of_inputs(options, 0.1).unwrap(),
        warnings: Vec::new(),
        solver: Vec::new(),
        gains: toml::Table::try_from(gains).unwrap(),
        achieved,
    }
}

fn achieved(options: &ReducedOrderObserverOptions) -> Achieved {
    options.with_gains(0.1, &found(options)).unwrap().achieved
}

#[test]
fn gains_that_were_written_and_read_give_the_same_design() {
    let mut plants: Vec<_> = (0..40)
        .map(|seed| ReducedOrderObserverOptions {
            model: random_plant(seed),
            ..ReducedOrderObserverOptions::default()
        })
        .collect();
    plants.extend([servo(0.01), servo(0.0), vehicle(), other_plant("six_state", 1e-3)]);
    let mut compared = 0;
    for options in &plants {
        let Ok(direct) = Design::new(options) else {
            continue;
        };
        let gains = found(options);
        let read = Design::with_gains(options, &read_back(&gains)).unwrap();
        assert_eq!((&read.main, &read.isolation), (&direct.main, &direct.isolation));
        assert_eq!(
            (&read.plant, &read.certificate),
            (&direct.plant, &direct.certificate)
        );
        // And through the entry of a gains file, with what they achieve.
        let designed = options.with_gains(0.1, &gains).unwrap();
        assert_eq!(designed.achieved.violated(), None);
        let entry = entry(options, &gains, designed.achieved);
        let entry: Entry = toml::from_str(&toml::to_string(&entry).unwrap()).unwrap();
        let gains = toml::Value::Table(entry.gains.clone()).try_into().unwrap();
        let again = options.with_gains(0.1, &gains).unwrap();
        entry.verify(&again.achieved, 1e-6).unwrap();
        compared += 1;
    }
    assert!(compared > 38, "{compared}");
}

#[test]
fn gains_of_the_modes_for_comparison_state_their_settled_half_widths_and_guarantee_nothing() {
    let printed = crate::fixtures::file("design.json");
    for (mode, expected) in [
        (Mode::Paper, "half_width_steady_noise_free"),
        (Mode::Tiom, "tiom_half_width_steady"),
    ] {
        let rows = crate::support::rows;
        let mut options = crate::fixtures::given(
            servo(0.0),
            &rows(&printed["printed"]["K"]),
            &rows(&printed["printed"]["M"]),
        );
        options.bounds.mode = mode;
        let achieved = achieved(&options);
        assert!(achieved.faults.is_empty() && achieved.false_alarms.is_none());
        let settled: Vec<f64> = achieved
            .thresholds
            .iter()
            .map(|threshold| threshold.settled)
            .collect();
        let expected = crate::support::numbers(&printed[expected]);
        crate::support::assert_close("settled", &settled, &expected, 1e-8);
    }
    // |M| with a spectral radius above 1: the interval observer diverges although M is Schur.
    let mut options = servo(0.0);
    options.bounds.mode = Mode::Tiom;
    options.design.observer_m = ObserverM::Matrix(vec![vec![0.6, 0.7], vec![-0.7, 0.6]]);
    let designed = options.with_gains(0.1, &found(&options)).unwrap();
    assert!(designed.achieved.thresholds.is_empty());
    assert!(
        designed.warnings[0].contains("grow without limit"),
        "{:?}",
        designed.warnings
    );
}

/// The refusal of gains after a change.
fn refusal(
    options: &ReducedOrderObserverOptions,
    change: impl Fn(&mut ReducedOrderObserverGains),
) -> Refusal {
    let mut gains = found(options);
    change(&mut gains);
    options.with_gains(0.1, &gains).expect_err("accepted")
}

type Change = fn(&mut ReducedOrderObserverGains);

#[test]
fn altered_gains_are_refused_with_the_condition_that_they_violate() {
    let cases: [(Change, &str, &str); 26] = [
        (
            |gains| gains.main.k[0][0] += 1e-6,
            "gains.main.K",
            "K U1 + U2 = 0",
        ),
        (|gains| gains.main.k[0].push(0.0), "gains.main.K", "entries"),
        (|gains| gains.main.k[0][0] = f64::NAN, "gains.main.K", "NaN"),
        (
            |gains| gains.main.k.iter_mut().flatten().for_each(|k| *k = 1e300),
            "gains.main.K",
            "K",
        ),
        (|gains| gains.main.m[0][0] = 1.0, "gains.main.M", "Schur"),
        (|gains| gains.main.m[1][1] = f64::INFINITY, "gains.main.M", "inf"),
        (|gains| gains.main.m.truncate(1), "gains.main.M", "1 x 2"),
        (
            |gains| gains.main.w[2][0] *= 1.0 + 1e-6,
            "gains.main.W",
            "row 2 must have length 1",
        ),
        (|gains| gains.main.w.swap(0, 1), "gains.main.W", "the unit matrix"),
        (
            |gains| gains.main.w.truncate(1),
            "gains.main.W",
            "the unit matrix",
        ),
        (|gains| gains.main.w[3].truncate(1), "gains.main.W.3", "1 entries"),
        (
            |gains| gains.main.w = vec![gains.main.w[2].clone(); 33],
            "gains.main.W",
            "unit matrix",
        ),
        (
            |gains| {
                let row = gains.main.w[2].clone();
                gains.main.w.resize(33, row);
            },
            "gains.main.W",
            "max_directions",
        ),
        (
            |gains| gains.main.w[2].iter_mut().for_each(|w| *w *= -1.0),
            "gains.main.W",
            "must be positive",
        ),
        (
            |gains| gains.members[0].w[0].iter_mut().for_each(|w| *w *= -1.0),
            "gains.members.0.W",
            "must be positive",
        ),
        (
            |gains| gains.main.source = Source::Poles(vec![0.123, 0.456]),
            "gains.main.source",
            "K is not closed form with poles [0.123, 0.456]",
        ),
        (
            |gains| *first_of_p(gains) *= -1.0,
            "gains.main.P",
            "positive definite",
        ),
        (
            |gains| gains.main.p = Some(unit(4)),
            "gains.main.P",
            "negative definite",
        ),
        (
            |gains| gains.main.p.as_mut().unwrap()[0][3] += 1.0,
            "gains.main.P",
            "symmetric",
        ),
        (
            |gains| gains.members[0].k[1][1] += 1e-6,
            "gains.members.0.K",
            "K U1 + U2 = 0",
        ),
        (
            |gains| gains.members[1].w[0] = vec![0.6, 0.8],
            "gains.members.1.W",
            "W U1 = 0",
        ),
        (
            |gains| gains.members[0].actuator = 1,
            "gains.members.1.actuator",
            "has one already",
        ),
        (
            |gains| gains.members[0].actuator = 7,
            "gains.members.0.actuator",
            "no actuator 7",
        ),
        (
            |gains| gains.members[0].decouples_disturbance ^= true,
            "gains.members.0",
            "",
        ),
        (
            |gains| gains.estimators[1].phi[0] *= 1.0 + 1e-9,
            "gains.estimators.1.phi",
            "[1 0 ... 0]",
        ),
        (
            |gains| gains.estimators[0].phi.push(1.0),
            "gains.estimators.0.phi",
            "length 3",
        ),
    ];
    for (index, (change, key, words)) in cases.into_iter().enumerate() {
        let found = refusal(&vehicle(), change);
        assert!(found.key.starts_with(key), "case {index}: {found}");
        assert!(found.message.contains(words), "case {index}: {found}");
        assert!(found.message.contains("; "), "case {index}, no advice: {found}");
    }
}

fn first_of_p(gains: &mut ReducedOrderObserverGains) -> &mut f64 {
    &mut gains.main.p.as_mut().unwrap()[0][0]
}

fn unit(n: usize) -> Vec<Vec<f64>> {
    (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect()
}

#[test]
fn a_certificate_that_belongs_to_other_gains_is_refused() {
    let options = servo(0.01);
    let mut other = options.clone();
    other.design.objective = residual_diagnosis::reduced_order_observer::options::Objective::Width;
    // P of K0 for F = 0.9: its D'P N_c is not that of the other gain, but vanishes all the same; the decrease differs.
    let p = found(&other).main.p;
    let refused = refusal(&options, |gains| gains.main.p.clone_from(&p));
    assert_eq!(refused.key, "gains.main.P");
    let refused = refusal(&options, |gains| gains.main.p = Some(unit(3)));
    assert!(refused.message.contains("D'P N_c must vanish"), "{refused}");
}

#[test]
fn a_certificate_may_be_missing_only_where_there_is_none() {
    let refused = refusal(&servo(0.01), |gains| gains.main.p = None);
    assert_eq!(refused.key, "gains.main.P");
    assert!(refused.message.contains("missing"), "{refused}");
    // M is nilpotent, but so large that rounding hides the decrease of every certificate.
    let mut options = servo(0.01);
    options.design.observer_m = ObserverM::Matrix(vec![vec![0.0, 1e9], vec![0.0, 0.0]]);
    let gains = found(&options);
    assert_eq!(gains.main.p, None);
    let warnings = options.with_gains(0.1, &gains).unwrap().warnings;
    assert!(warnings[0].contains("no Lyapunov certificate"), "{warnings:?}");
}

#[test]
fn a_member_or_an_estimator_that_there_is_and_that_is_asked_for_must_not_be_missing() {
    type Removal = fn(&mut ReducedOrderObserverGains);
    let cases: [(Removal, &str, &str); 4] = [
        (|gains| gains.members.clear(), "gains.members", "actuator 0"),
        (
            |gains| drop(gains.members.remove(1)),
            "gains.members",
            "actuator 1",
        ),
        (|gains| gains.estimators.clear(), "gains.estimators", "actuator 0"),
        (
            |gains| drop(gains.estimators.remove(1)),
            "gains.estimators",
            "actuator 1",
        ),
    ];
    for (removal, key, actuator) in cases {
        let refused = refusal(&vehicle(), removal);
        assert_eq!(refused.key, key);
        assert!(refused.message.contains(actuator), "{refused}");
    }
    let mut without = vehicle();
    without.isolation.fault_estimate = false;
    let gains = found(&without);
    assert!(gains.estimators.is_empty() && gains.members.len() == 2);
    without.with_gains(0.1, &gains).unwrap();
}

#[test]
fn the_source_of_a_gain_goes_through_its_words_and_others_are_refused() {
    for source in [
        Source::Given,
        Source::Particular,
        Source::Poles(vec![0.9, -0.125, 1e-9]),
        Source::Poles(Vec::new()),
        Source::NoiseAware,
        Source::Paper(0.2),
    ] {
        assert_eq!(Source::try_from(source.to_string()), Ok(source));
    }
    for text in ["", "K1", "closed form with poles [a]", "the best of all gains"] {
        let refusal = Source::try_from(text.to_owned()).unwrap_err();
        assert!(refusal.contains("no source"), "{refusal}");
    }
}

#[test]
fn a_fall_back_to_closed_forms_is_said_whenever_its_gains_are_used() {
    let gains = found(&servo(0.01));
    let warnings = |change: fn(&mut ReducedOrderObserverOptions)| {
        let mut options = servo(0.01);
        change(&mut options);
        options.with_gains(0.1, &gains).unwrap().warnings.join("; ")
    };
    assert_eq!(warnings(|_| ()), "");
    for change in [
        (|options| options.design.gains = Gains::H2) as fn(&mut ReducedOrderObserverOptions),
        |options| options.design.gains = Gains::Lmi,
    ] {
        assert!(
            warnings(change).contains("fell back to closed form"),
            "{}",
            warnings(change)
        );
    }
    let no_m = warnings(|options| options.design.observer_m = ObserverM::Named(NamedM::Lmi));
    assert!(no_m.contains("fell back to M = 0"), "{no_m}");
}

#[test]
fn gains_so_large_that_rounding_exceeds_its_tolerance_are_warned_of() {
    let mut options = servo(0.01);
    let designed = |options: &ReducedOrderObserverOptions| {
        options
            .with_gains(0.1, &found(options))
            .unwrap()
            .warnings
            .join("; ")
    };
    assert_eq!(designed(&options), "");
    options.bounds.rounding_tolerance = 1e-15;
    let warned = designed(&options);
    assert!(
        warned.contains("1e-15") && warned.contains("rounding_tolerance"),
        "{warned}"
    );
}

#[test]
fn members_where_none_are_asked_for_and_estimators_above_their_limit_are_refused() {
    let gains = found(&vehicle());
    let mut without = vehicle();
    without.isolation.enabled = false;
    let refused = without.with_gains(0.1, &gains).unwrap_err();
    assert_eq!(refused.key, "gains");
    let mut strict = vehicle();
    strict.isolation.fault_estimate_radius_max = Some(vec![1e3, 0.1]);
    let refused = strict.with_gains(0.1, &gains).unwrap_err();
    assert_eq!(refused.key, "gains.estimators.1.phi");
    let mut slow = vehicle();
    slow.design.spectral_radius_max = 0.3;
    let refused = slow.with_gains(0.1, &gains).unwrap_err();
    assert!(
        refused.key == "gains.main.K" && refused.message.contains("|eig F|"),
        "{refused}"
    );
}

#[test]
fn a_file_that_promises_more_than_its_gains_achieve_is_found_out() {
    let options = servo(0.01);
    let found = options.find_gains(0.1).unwrap();
    let mut promised = options.with_gains(0.1, &found.gains).unwrap().achieved;
    let honest = promised.clone();
    promised.faults[0].detectable = promised.faults[0].detectable.map(|size| 0.999 * size);
    let entry = entry(&options, &found.gains, promised);
    assert!(matches!(
        entry.verify(&honest, 1e-6),
        Err(GainsError::NotAchieved { .. })
    ));
}

#[test]
fn a_saved_state_does_not_belong_to_other_gains() {
    let options = servo(0.01);
    let gains = found(&options);
    let mut others = gains.clone();
    others.main.w.truncate(2);
    let [one, other] = [gains, others].map(|gains| options.with_gains(0.1, &gains).unwrap().diagnoser);
    let (mut saved, mut other) = (Vec::new(), other);
    one.save(&mut saved);
    assert!(other.restore(&saved).is_err() && one.boxed_clone().restore(&saved).is_ok());
}

#[test]
fn what_the_servo_achieves_is_what_the_method_sheet_states() {
    let achieved = achieved(&servo(0.01));
    let fault = &achieved.faults[0];
    assert!((fault.detectable.unwrap() - 0.0351).abs() < 1e-4, "{fault:?}");
    // One actuator: what is detected is isolated.
    assert_eq!(fault.isolable, fault.detectable);
    let last = fault.delays.last().unwrap().size;
    assert!((last / fault.detectable.unwrap() - 1.0).abs() < 2e-6);
    assert!(fault.delays.windows(2).all(|pair| pair[1].size < pair[0].size));
    assert!((fault.delays[0].within_s - 0.1).abs() < 1e-12);
    assert_eq!(achieved.poles[1].name, "F");
    assert!((achieved.poles[1].values[0][0] - 0.9).abs() < 1e-9);
    assert_eq!(achieved.false_alarms.unwrap().expected_per_hour, Some(0.0));
    for norm in achieved.norms.iter().skip(1) {
        assert!(norm.lower_bound.unwrap() < norm.value, "{norm:?}");
    }
    let channels: Vec<&str> = achieved.thresholds.iter().map(|it| it.channel.as_str()).collect();
    assert!(
        channels.contains(&"output_1") && channels.contains(&"estimator_0"),
        "{channels:?}"
    );
}

#[test]
fn the_vehicles_faults_are_isolated_from_the_sizes_of_the_method_sheet_on() {
    let achieved = achieved(&vehicle());
    let isolable: Vec<f64> = achieved
        .faults
        .iter()
        .map(|fault| fault.isolable.unwrap())
        .collect();
    crate::support::assert_close("isolable", &isolable, &[0.0765, 1.08], 1e-2);
    for separation in &achieved.isolability {
        assert!(
            separation.instants.is_some_and(|instants| instants <= 3),
            "{separation:?}"
        );
    }
    assert_eq!(achieved.isolability.len(), 2);
}

#[test]
fn a_fault_of_the_stated_size_alarms_within_the_stated_delay_whatever_disturbance_and_noise_do() {
    for (mut options, actuators) in [(servo(0.01), 1), (vehicle(), 2)] {
        for consecutive in [1, 3] {
            options.bounds.alarm_samples = consecutive;
            let achieved = achieved(&options);
            let design = design(&options);
            for (run, actuator) in (0..4_u64).flat_map(|run| (0..actuators).map(move |j| (run, j))) {
                for delay in &achieved.faults[actuator].delays {
                    let after = (delay.within_s / 0.1).round() as usize;
                    let sign = if run % 2 == 0 { 1.0 } else { -1.0 };
                    let found = first_alarm(&design, actuator, sign * 1.0001 * delay.size, run, after);
                    assert!(found.is_some_and(|k| k <= after), "{delay:?}: {found:?}");
                }
            }
        }
    }
}

/// Samples from the onset of a constant fault to its confirmed alarm, with vertices of disturbance and noise against it.
fn first_alarm(design: &Design, actuator: usize, size: f64, seed: u64, after: usize) -> Option<usize> {
    const SETTLED: usize = 250;
    let mut plant = Simulation::new(&design.options.model, seed, Draw::Vertex);
    let mut diagnoser = ReducedOrderObserver::new(design).unwrap();
    let actuators = design.plant.actuators();
    for k in 0..=SETTLED + after {
        let y = plant.measure();
        let u = vec![0.0; actuators];
        let record = crate::fixtures::step(&mut diagnoser, &y, &u);
        let alarm = record.flags & flags::ALARM_NOW != 0;
        assert!(k > SETTLED || !alarm);
        if alarm {
            return Some(k - SETTLED);
        }
        let mut f = DVector::zeros(actuators);
        f[actuator] = if k >= SETTLED { size } else { 0.0 };
        plant.advance(&u, f.as_slice());
    }
    None
}

#[test]
fn a_channel_that_sees_no_fault_and_one_whose_faults_are_too_small_are_named() {
    let mut options = servo(0.01);
    options.isolation.fault_bound = Some(vec![0.06]);
    let thresholds = achieved(&options).thresholds;
    let reason = |channel: &str| {
        let found = thresholds.iter().find(|it| it.channel == channel).unwrap();
        assert_eq!(found.never_fires, None, "{found:?}");
        found.insensitive.clone().unwrap_or_default()
    };
    assert!(reason("output_0").contains("fault_bound"), "{thresholds:?}");
    let seen = |it: &&residual_diagnosis::achieved::Threshold| it.insensitive.is_none();
    let seen = thresholds.iter().find(seen).unwrap();
    assert!(seen.channel.starts_with("direction_"), "{thresholds:?}");

    // The second output belongs to a part of the plant that the actuator does not reach.
    let mut apart = servo(0.01);
    apart.model.a = vec![vec![0.5, 0.0, 0.1], vec![0.0, 0.4, 0.0], vec![0.2, 0.0, 0.3]];
    apart.model.b = vec![vec![1.0], vec![0.0], vec![0.5]];
    apart.model.d = vec![vec![0.0], vec![1.0], vec![0.0]];
    let thresholds = achieved(&apart).thresholds;
    assert!(
        thresholds[1].never_fires.as_ref().unwrap().contains("no fault"),
        "{thresholds:?}"
    );
    assert_eq!(thresholds[0].never_fires, None);
}

#[test]
fn only_options_that_insist_on_a_solver_need_one() {
    let mut options = servo(0.01);
    assert_eq!(options.needs_solver(), None);
    for gains in [Gains::H2, Gains::Lmi] {
        options.design.gains = gains;
        let refusal = options.needs_solver().unwrap();
        assert_eq!(refusal.key, "design.gains");
        assert!(refusal.message.contains(gains.name()), "{refusal}");
    }
    options.design.gains = Gains::ClosedForm;
    options.design.observer_m = ObserverM::Named(NamedM::Lmi);
    assert_eq!(options.needs_solver().unwrap().key, "design.observer_M");
}

#[test]
fn the_response_to_a_slow_fault_is_the_steady_step_response() {
    let options = servo(0.01);
    let gains = found(&options);
    let responses = options.responses(0.1, &gains).unwrap();
    let names: Vec<_> = responses.iter().map(|response| response.name.as_str()).collect();
    assert_eq!(names[..2], ["disturbance", "measurement noise"]);
    assert!(names[2].starts_with("fault of "), "{names:?}");
    let design = Design::with_gains(&options, &gains).unwrap();
    let settled = step_response(&design.main.observer, 0).pop().unwrap();
    let (_, gain) = responses[2].singular_values(0.0).unwrap();
    assert!((gain / settled.norm() - 1.0).abs() < 1e-6, "{gain} {settled}");
}
