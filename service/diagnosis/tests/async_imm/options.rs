//! What the options beyond the paper are good for (method sheet 6).

use crate::servo::{Arrival, settings, step};
use crate::simulation::{Draw, Ensemble, Plan, paper_design, simulate, stay};
use nalgebra::DMatrix;
use residual_diagnosis::async_imm::{
    AsyncImm,
    decision::{DecisionRule, DecisionState, fault_probability},
    design::{Form, ImmDesign, Mixing, Mode},
    fusion::Fusion,
};
use residual_diagnosis::diagnoser::PacketSource;

const ALL: [usize; 3] = [0, 1, 2];

/// Both actuators fail at 16.5 s.
const BOTH: Plan = Plan {
    runs: 300,
    steps: 40,
    fault: [2.0, 2.0],
    onset_us: 16_500_000,
};

/// Modes none, 1, 2, both, with an amplitude slot of its own for each actuator.
fn simultaneous(probability: f64) -> ImmDesign {
    let mut design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(probability));
    design.modes = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
        .into_iter()
        .enumerate()
        .map(|(m, active)| Mode {
            name: format!("mode {m}"),
            direction: DMatrix::from_diagonal(&nalgebra::DVector::from_column_slice(&active)),
            random_walk_psd: vec![0.0; 2],
        })
        .collect();
    design.prior.amplitude = vec![0.0; 2];
    design.prior.amplitude_covariance = DMatrix::identity(2, 2) * 4.0;
    design.prior.mode_probability = vec![0.9, 0.04, 0.04, 0.02];
    design
}

#[test]
fn simultaneous_faults_are_isolated_and_the_position_stays_good() {
    let design = simultaneous(0.999);
    let ensemble = Ensemble::new(&design, &ALL, BOTH);
    let rule = DecisionRule {
        threshold: 0.9,
        window_steps: 2,
    };
    let declared = ensemble.runs.iter().filter(|run| {
        let mut state = DecisionState::default();
        run.iter()
            .for_each(|seen| rule.update(&mut state, &seen.probability));
        rule.declared_mode(&state) == 3
    });
    let share = declared.count() as f64 / BOTH.runs as f64;
    let amplitude = ensemble.root_mean(31..=40, |seen| (seen.amplitude[3].0 - 2.0).powi(2));
    let position = ensemble.root_mean(31..=40, |seen| seen.position);
    let single = paper_design(Form::Sequential, Mixing::SharedChannel, stay(0.999));
    let single = Ensemble::new(&single, &ALL, BOTH).root_mean(31..=40, |seen| seen.position);
    assert!((share - 0.993).abs() < 0.02, "{share}");
    assert!((amplitude - 0.056).abs() < 0.012, "{amplitude}");
    assert!((position - 2.51).abs() < 0.3, "{position}");
    assert!(single > 2.0 * position, "{single}");
}

#[test]
fn two_faults_outside_of_the_mode_set_are_seen_by_the_probability_of_any_fault() {
    let design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(0.99));
    let ensemble = Ensemble::new(&design, &ALL, BOTH);
    let rule = DecisionRule {
        threshold: 0.5,
        window_steps: 2,
    };
    let mut silent = [0.0; 2];
    for run in &ensemble.runs {
        let mut state = DecisionState::default();
        for (place, seen) in run.iter().enumerate() {
            rule.update(&mut state, &seen.probability);
            assert!(fault_probability(&seen.probability) >= seen.probability[1].max(seen.probability[2]));
            if (25..=40).contains(&(place + 1)) {
                silent[0] += f64::from(u8::from(rule.declared_mode(&state) == 0));
                silent[1] += f64::from(u8::from(!rule.fault_detected(&state)));
            }
        }
    }
    let [isolation, detection] = silent.map(|count| count / (16 * BOTH.runs) as f64);
    assert!(
        isolation > 0.2 && detection < 0.25 * isolation,
        "{isolation} {detection}"
    );
}

/// Position error over 10 to 40 s of runs whose packets are up to 2 s late.
fn with_late_packets(rollback_steps: usize, late: bool) -> f64 {
    let design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(0.99));
    let mut fusion = Fusion::new(&design);
    let (runs, steps) = (60, 40);
    let mut sum = 0.0;
    for seed in 0..runs {
        let mut draw = Draw::new(seed);
        let truth = simulate(&design, steps, [0.0; 2], 0, &mut draw);
        let slots = truth.slots.iter().enumerate();
        let mut arrivals: Vec<Arrival> = slots
            .filter_map(|(number, slot)| {
                let delay = (draw.uniform() * 2e6) as i64;
                Some(Arrival {
                    at_us: slot.time_us + if late { delay } else { 0 },
                    source: PacketSource::Sensor(slot.sensor),
                    sequence: number as u64,
                    time_us: slot.time_us,
                    values: slot.value.clone()?,
                })
            })
            .collect();
        arrivals.sort_by_key(|arrival| arrival.at_us);
        let mut settings = settings(&design, 1_000_000, rollback_steps);
        settings.initial_command = vec![0.5; 2];
        let mut diagnoser = AsyncImm::new(&design, settings).unwrap();
        for k in 1..=steps {
            let instant = k as i64 * 1_000_000;
            step(&mut diagnoser, &arrivals, instant - 1_000_000, instant);
            let mean = fusion.fuse(diagnoser.posterior()).0;
            if k >= 10 {
                sum += (mean[0] - truth.states[k][0]).powi(2) + (mean[2] - truth.states[k][2]).powi(2);
            }
        }
    }
    (sum / (runs as f64 * 31.0)).sqrt()
}

#[test]
fn going_back_to_late_packets_regains_most_of_what_dropping_them_loses() {
    let in_order = with_late_packets(0, false);
    let [dropped, one, three] = [0, 1, 3].map(|rollback_steps| with_late_packets(rollback_steps, true));
    assert!(in_order < three && three < one && one < dropped);
    assert!(
        (dropped - three) > 0.5 * (dropped - in_order),
        "{in_order} {three} {dropped}"
    );
}
