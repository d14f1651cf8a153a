//! The paper's synthesis: its γ, its two gains, and which of them keeps the claim (method sheet 3.6, 8(a), 8(b)).

use crate::{
    files::reference_of,
    plants::{Plant, norm},
};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::norms::System;
use residual_synthesis::hinf_filter::lmi::{Normalisation, PaperSolution, Time, paper};

const BOTH: [Normalisation; 2] = [Normalisation::Printed, Normalisation::Lemma1];

fn solved(plant: &Plant, normalisation: Normalisation) -> PaperSolution {
    paper(&plant.error(), &plant.bf, &plant.df, normalisation).unwrap()
}

/// J = ‖\[-T_rd, W_F - T_rf\]‖∞ of a gain with the reference model that the paper recovers.
fn cost(plant: &Plant, gain: &DMatrix<f64>, reference: &System) -> f64 {
    let closed = plant.disturbance(gain);
    let fault = plant.fault(gain);
    let (n, q, m, l) = (
        closed.a.nrows(),
        closed.c.nrows(),
        closed.b.ncols(),
        fault.b.ncols(),
    );
    let mut joint = System {
        a: DMatrix::zeros(2 * n, 2 * n),
        b: DMatrix::zeros(2 * n, m + l),
        c: DMatrix::zeros(q, 2 * n),
        d: DMatrix::zeros(q, m + l),
    };
    joint.a.view_mut((0, 0), (n, n)).copy_from(&closed.a);
    joint.a.view_mut((n, n), (n, n)).copy_from(&reference.a);
    joint.b.view_mut((0, 0), (n, m)).copy_from(&closed.b);
    joint.b.view_mut((0, m), (n, l)).copy_from(&fault.b);
    joint.b.view_mut((n, m), (n, l)).copy_from(&reference.b);
    joint.c.view_mut((0, 0), (q, n)).copy_from(&-closed.c);
    joint.c.view_mut((0, n), (q, n)).copy_from(&reference.c);
    joint.d.view_mut((0, 0), (q, m)).copy_from(&-closed.d);
    joint
        .d
        .view_mut((0, m), (q, l))
        .copy_from(&(&reference.d - fault.d));
    norm(Time::Continuous, &joint)
}

#[test]
fn gamma_is_the_infimum_in_both_normalisations_and_the_sound_gain_keeps_the_claim() {
    let facts = &reference_of("hinf_filter", "paper_facts.json")["infimum"];
    let plant = Plant::paper();
    for (normalisation, key, tolerance) in [
        (Normalisation::Lemma1, "gamma_opt_lemma1_scaling", 1e-5),
        (Normalisation::Printed, "gamma_opt_printed_scaling", 3e-5),
    ] {
        let found = solved(&plant, normalisation);
        let expected = facts[key].as_f64().unwrap();
        assert!(
            (found.gamma - expected).abs() < tolerance,
            "{key}: {}",
            found.gamma
        );
        let sound = norm(Time::Continuous, &plant.disturbance(&found.sound_gain));
        assert!((sound - 0.028_284_271_2).abs() < 1e-8, "{sound}");
        assert!(
            sound <= found.claimed_bound * (1.0 + 1e-6),
            "{key}: {sound} {}",
            found.claimed_bound
        );
        let printed = cost(&plant, &found.printed_gain, &found.reference);
        assert!(printed > found.claimed_bound, "{key}: {printed}");
    }
}

/// J/γ of the gain as printed, of `count` plants the first third of which are unstable.
fn check_plants(count: usize, seed: u64) {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    for index in 0..count {
        let mut plant = Plant::random(&mut random, 2 + index % 2, 3 * index < count);
        plant.dd *= 0.1;
        for normalisation in BOTH {
            let found = solved(&plant, normalisation);
            let claim = found.claimed_bound;
            let sound = norm(Time::Continuous, &plant.disturbance(&found.sound_gain));
            assert!(
                sound <= claim * (1.0 + 1e-6),
                "{index} {normalisation:?}: {sound} {claim}"
            );
            let printed = cost(&plant, &found.printed_gain, &found.reference);
            assert!(printed > claim, "{index} {normalisation:?}: {printed} {claim}");
        }
    }
}

#[test]
fn on_random_plants_the_printed_gain_violates_the_claim_and_the_sound_one_keeps_it() {
    check_plants(12, 3);
}
