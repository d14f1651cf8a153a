//! What no discrete gain can undercut is undercut by none, and is no empty statement.

use nalgebra::{DMatrix, DVector, dmatrix};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::{
    decomposition::SingularDecomposition,
    hinf_filter::{
        HinfFilter,
        lower_bound::discrete_lower_bound,
        options::HinfFilterOptions,
        plant::Plant,
        synthesis::{Weighted, synth_riccati_dt},
    },
    norms::{System, h_infinity_discrete},
};

fn achieved_norm(ad: &DMatrix<f64>, bdd: &DMatrix<f64>, plant: &Plant, gain: &DMatrix<f64>) -> f64 {
    let system = System::new(
        &(ad - gain * &plant.c),
        &(bdd - gain * &plant.dd),
        &plant.c,
        &plant.dd,
    );
    h_infinity_discrete(&system).value
}

#[test]
fn a_weak_direct_disturbance_does_not_make_a_riccati_design_impossible() {
    // The disturbance reaches the output in two steps: noise of 1e-3 of it would dominate the problem.
    for direct in [1e-6, 1e-4] {
        let text = format!(
            "[model]\nA = [[-0.5, 1], [0, -1]]\nC = [[1, 0]]\nBd = [[0], [1]]\nDd = [[{direct}]]\nBf = [[0], [1]]\nDf = \
             [[0]]\n[disturbance]\namplitude = [1]\n[filter]\ninitial_error_bound = [1, 1]\n[synthesis]\ntype = \
             \"riccati_dt\"\n"
        );
        let options: HinfFilterOptions = toml::from_str(&text).unwrap();
        let filter = HinfFilter::new(&options, 0.01).unwrap();
        let certificate = &filter.report().certificate;
        assert!(
            certificate.lower_bound <= certificate.disturbance * (1.0 + 1e-9),
            "{direct}: {} {}",
            certificate.lower_bound,
            certificate.disturbance
        );
        assert!(
            certificate.lower_bound >= 0.99 * certificate.disturbance,
            "{direct}: {certificate:?}"
        );
    }
}

/// Plants of every dimension and size of the direct term; every 12 have other dimensions, every 41 other sizes.
fn no_gain_lies_below_the_bound(plants: usize) {
    let mut random = ChaCha8Rng::seed_from_u64(35);
    let (mut above_direct, mut close) = (0, 0);
    for round in 0..plants {
        let (n, m, q) = (2 + round % 4, 1 + round % 2, 1 + round % 3);
        let mut entries = |rows: usize, columns: usize| {
            DMatrix::from_fn(rows, columns, |_, _| random.random_range(-1.0..=1.0))
        };
        let (a, bd, c) = (entries(n, n), entries(n, m), entries(q, n));
        let size = 10_f64.powf(-1.0 - 4.0 * f64::from(round as u32 % 41) / 40.0);
        let plant = Plant {
            a,
            b: DMatrix::zeros(n, 0),
            d: DMatrix::zeros(q, 0),
            dd: entries(q, m) * size,
            bf: DMatrix::zeros(n, 0),
            df: DMatrix::zeros(q, 0),
            bd,
            c,
        };
        let sampled = plant.sample(0.05);
        let direct = SingularDecomposition::new(&plant.dd).largest();
        let bound = discrete_lower_bound(&sampled, &plant.c, &plant.dd);
        let mut least = f64::INFINITY;
        for part in [1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
            let weighted = Weighted::new(
                &sampled.bdd,
                &plant.dd,
                &DVector::from_element(m, 1.0),
                &DVector::from_element(q, part * direct),
            );
            let Ok(design) = synth_riccati_dt(&sampled.ad, &plant.c, &weighted, &sampled.bdd) else {
                continue;
            };
            for _ in 0..3 {
                let gain = &design.gain + design.gain.map(|entry| entry * random.random_range(-1e-3..1e-3));
                let norm = achieved_norm(&sampled.ad, &sampled.bdd, &plant, &gain);
                least = least.min(norm);
            }
            least = least.min(achieved_norm(&sampled.ad, &sampled.bdd, &plant, &design.gain));
        }
        assert!(least >= bound * (1.0 - 1e-9), "{round}: {least} {bound}");
        assert!(bound >= direct, "{round}");
        above_direct += usize::from(bound > 1.01 * direct);
        close += usize::from(bound >= 0.99 * least);
    }
    println!("{above_direct} above the direct term, {close} within 1 % of a gain");
    assert!(
        above_direct * 10 >= plants * 3 && close * 4 >= plants * 3,
        "{above_direct} {close}"
    );
}

#[test]
fn no_gain_of_a_random_plant_lies_below_the_bound() {
    no_gain_lies_below_the_bound(48);
}

#[test]
#[ignore = "four times as many; cargo test -p residual-diagnosis --test hinf_filter -- --ignored"]
fn no_gain_of_200_random_plants_lies_below_the_bound() {
    no_gain_lies_below_the_bound(200);
}

/// T = C Bdd / z with the gain that forgets the state at once.
#[test]
fn without_a_direct_disturbance_the_bound_is_what_arrives_after_one_step() {
    let plant = Plant {
        a: dmatrix![-1.0],
        b: DMatrix::zeros(1, 0),
        c: dmatrix![2.0],
        d: DMatrix::zeros(1, 0),
        bd: dmatrix![1.0],
        dd: dmatrix![0.0],
        bf: DMatrix::zeros(1, 0),
        df: DMatrix::zeros(1, 0),
    };
    let sampled = plant.sample(0.1);
    let bound = discrete_lower_bound(&sampled, &plant.c, &plant.dd);
    let infimum = 2.0 * sampled.bdd[(0, 0)];
    assert!(
        bound <= infimum && bound >= infimum * (1.0 - 1e-6),
        "{bound} {infimum}"
    );
}
