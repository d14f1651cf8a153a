//! What cannot be designed is refused with the condition that fails.

use crate::plants::{Plant, norm};
use nalgebra::{DMatrix, dmatrix, dvector};
use residual_synthesis::hinf_filter::lmi::{
    LmiError, Normalisation, Region, Time, mixed, paper, two_stage_continuous, two_stage_discrete,
};

fn region(decay: f64, radius: f64) -> Region {
    Region {
        decay: Some(decay),
        radius: Some(radius),
    }
}

#[test]
fn a_region_without_room_for_poles_is_refused_in_its_symbols() {
    let plant = Plant::paper();
    let error = two_stage_continuous(&plant.error(), &region(5.0, 4.0), 0.01).unwrap_err();
    assert_eq!(
        error.to_string(),
        "no pole can lie in the region Re λ < -5 and |λ| < 4; enlarge it"
    );
    assert!(matches!(
        mixed(&plant.error(), &plant.bf, &plant.df, &region(-1.0, 4.0)),
        Err(LmiError::EmptyRegion { .. })
    ));
}

#[test]
fn a_mode_that_no_gain_moves_must_lie_in_the_region() {
    let mut plant = Plant::paper();
    plant.a = dmatrix![0.3, 0.0; 0.0, -1.0];
    plant.c = dmatrix![0.0, 1.0; 0.0, 2.0];
    for error in [
        two_stage_continuous(&plant.error(), &Region::default(), 0.01).unwrap_err(),
        paper(&plant.error(), &plant.bf, &plant.df, Normalisation::Lemma1).unwrap_err(),
    ] {
        let message = error.to_string();
        assert!(
            message.starts_with("the pole 0.3 cannot be moved") && message.contains("Re λ < 0"),
            "{message}"
        );
    }
    plant.a = dmatrix![-0.5, 0.0; 0.0, -1.0];
    assert!(two_stage_continuous(&plant.error(), &Region::default(), 0.01).is_ok());
    let error = two_stage_continuous(&plant.error(), &region(0.6, 9.0), 0.01).unwrap_err();
    assert!(matches!(error, LmiError::FixedPole { .. }), "{error}");
}

#[test]
fn a_region_out_of_the_solvers_reach_is_refused_with_its_symbols() {
    // The pole at -3 is moved by a gain of the size 1e7 only.
    let mut plant = Plant::paper();
    plant.a = dmatrix![-3.0, 0.0; 0.0, -1.0];
    plant.c = dmatrix![1e-7, 1.0];
    plant.dd = dmatrix![0.02];
    let error = two_stage_continuous(&plant.error(), &region(2.0, 2.5), 0.01).unwrap_err();
    assert!(error.to_string().contains("Re λ < -2 and |λ| < 2.5"), "{error}");
}

#[test]
fn a_problem_without_measurement_noise_needs_a_radius() {
    let mut plant = Plant::paper();
    plant.dd = DMatrix::zeros(2, 1);
    let decay = Region {
        decay: Some(4.0),
        radius: None,
    };
    for region in [Region::default(), decay] {
        let error = two_stage_continuous(&plant.error(), &region, 0.01).unwrap_err();
        assert_eq!(error, LmiError::Unbounded);
    }
    assert!(two_stage_continuous(&plant.error(), &region(4.0, 50.0), 0.01).is_ok());
    assert!(two_stage_discrete(&plant.sampled(0.01).error(), &Region::default(), 0.01).is_ok());
    plant.bd = DMatrix::zeros(2, 1);
    let error = two_stage_continuous(&plant.error(), &Region::default(), 0.01).unwrap_err();
    assert_eq!(error, LmiError::NoDisturbance);
}

#[test]
fn shapes_and_infinite_entries_are_named() {
    let mut plant = Plant::paper();
    plant.c[(0, 1)] = f64::INFINITY;
    let error = two_stage_continuous(&plant.error(), &Region::default(), 0.01).unwrap_err();
    assert_eq!(error, LmiError::NotFinite { matrix: "C" });
    plant.c = DMatrix::identity(3, 2);
    let error = two_stage_discrete(&plant.error(), &Region::default(), 0.01).unwrap_err();
    assert_eq!(
        error.to_string(),
        "Dd has the wrong shape 2 x 1; make it fit A and C"
    );
}

#[test]
fn the_units_of_the_states_do_not_matter_within_twelve_decades() {
    let plain = Plant::paper();
    for exponent in [2, 4, 6, 8, 10] {
        let size = 10_f64.powi(exponent);
        let units = DMatrix::from_diagonal(&dvector![size, 1.0 / size]);
        let inverse = DMatrix::from_diagonal(&dvector![1.0 / size, size]);
        let plant = Plant {
            a: &inverse * &plain.a * &units,
            bd: &inverse * &plain.bd,
            c: &plain.c * &units,
            ..plain.clone()
        };
        match two_stage_continuous(&plant.error(), &Region::default(), 0.01) {
            Ok(found) => {
                let truth = norm(Time::Continuous, &plant.disturbance(&found.gain));
                assert!(truth <= found.bound, "{exponent}: {truth} {}", found.bound);
                let error = found.stage_one - 0.028_284_271_2;
                assert!(
                    error > -1e-8 && (error < 1e-6 || exponent > 6),
                    "{exponent}: {error:e}"
                );
            }
            Err(error) => {
                let named = ["condition", "level", "region", "solver stopped"];
                let message = error.to_string();
                assert!(
                    exponent > 6 && named.iter().any(|word| message.contains(word)),
                    "{message}"
                );
            }
        }
    }
}
