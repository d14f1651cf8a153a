//! Two-stage syntheses on the paper's example (method sheet 8(a)).

use crate::{
    files::reference_of,
    plants::{Plant, largest, norm},
};
use residual_diagnosis::decomposition::eigenvalues;
use residual_synthesis::hinf_filter::lmi::{LmiGain, Region, Time, two_stage_continuous, two_stage_discrete};

const SLACK: f64 = 0.01;

fn infimum() -> f64 {
    reference_of("hinf_filter", "paper_facts.json")["infimum"]["sigma_max_Dd"]
        .as_f64()
        .unwrap()
}

fn assert_accepted(time: Time, plant: &Plant, found: &LmiGain) {
    let truth = norm(time, &plant.disturbance(&found.gain));
    assert!(truth <= 0.02857 && truth <= found.bound, "{truth}");
    assert!((found.bound / found.stage_one - 1.01 * 1.001).abs() < 1e-5);
    assert_eq!(found.runs.len(), 2);
}

#[test]
fn the_first_stage_finds_the_largest_singular_value_of_dd() {
    let (plant, infimum) = (Plant::paper(), infimum());
    assert!((largest(&plant.dd) - infimum).abs() < 1e-15);
    let found = two_stage_continuous(&plant.error(), &Region::default(), SLACK).unwrap();
    assert!((found.stage_one - infimum).abs() < 1e-6, "{}", found.stage_one);
}

#[test]
fn the_continuous_gain_is_small_and_keeps_its_bound() {
    let plant = Plant::paper();
    let found = two_stage_continuous(&plant.error(), &Region::default(), SLACK).unwrap();
    let size = largest(&found.gain);
    assert!((0.40..=0.55).contains(&size), "{size}");
    assert_accepted(Time::Continuous, &plant, &found);
}

#[test]
fn the_discrete_gain_is_small_and_keeps_its_bound() {
    let plant = Plant::paper().sampled(0.01);
    let found = two_stage_discrete(&plant.error(), &Region::default(), SLACK).unwrap();
    let size = largest(&found.gain);
    assert!(size <= 0.0055, "{size}");
    assert!((found.stage_one - infimum()).abs() < 1e-6, "{}", found.stage_one);
    assert_accepted(Time::Discrete, &plant, &found);
}

#[test]
fn poles_are_put_into_the_region_asked_for() {
    let plant = Plant::paper();
    let region = Region {
        decay: Some(5.0),
        radius: Some(20.0),
    };
    let found = two_stage_continuous(&plant.error(), &region, 0.5).unwrap();
    for pole in eigenvalues(&plant.disturbance(&found.gain).a).unwrap() {
        assert!(pole.re < -5.0 && pole.norm() < 20.0, "{pole}");
    }
    let sampled = plant.sampled(0.01);
    let region = Region {
        decay: None,
        radius: Some((-5.0_f64 * 0.01).exp()),
    };
    let found = two_stage_discrete(&sampled.error(), &region, 0.5).unwrap();
    for pole in eigenvalues(&sampled.disturbance(&found.gain).a).unwrap() {
        assert!(pole.norm() < (-0.05_f64).exp(), "{pole}");
    }
}
