//! Discrete stage 1 against the closed-form optimum √λ_max(Ω) of problems with full measurement noise
//! (method sheet 8(b)).

use crate::plants::Plant;
use nalgebra::DVector;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::hinf_filter::synthesis::{Weighted, synth_riccati_dt};
use residual_synthesis::hinf_filter::lmi::{Region, two_stage_discrete};

/// The largest relative difference over `count` random plants, and the most iterations of stage 1.
fn compare(count: usize) {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    for index in 0..count {
        let n = 2 + index % 3;
        let plant = Plant::random(&mut random, n, index % 3 == 0).sampled(0.1);
        let noise = random.random_range(0.02..0.3);
        let (m, q) = (plant.bd.ncols(), plant.c.nrows());
        let weighted = Weighted::new(
            &plant.bd,
            &plant.dd,
            &DVector::from_element(m, 1.0),
            &DVector::from_element(q, noise),
        );
        let optimum = synth_riccati_dt(&plant.a, &plant.c, &weighted, &plant.bd)
            .unwrap()
            .optimum;
        let mut noisy = plant;
        (noisy.bd, noisy.dd) = (weighted.b, weighted.d);
        let found = two_stage_discrete(&noisy.error(), &Region::default(), 0.01).unwrap();
        let difference = found.stage_one / optimum - 1.0;
        let iterations = found.runs[0].iterations;
        assert!(
            difference.abs() < 1e-6,
            "{index}: {difference:e}, {iterations} iterations"
        );
        assert!(iterations <= 25, "{index}: {iterations} iterations");
    }
}

#[test]
fn the_first_stage_agrees_with_the_riccati_optimum() {
    compare(30);
}
