//! What a long time without fault does to the amplitudes.

use crate::simulation::{Draw, filter, paper_design, paper_transition, simulate, stay};
use residual_diagnosis::async_imm::{
    design::{Form, ImmDesign, Mixing},
    estimator::ImmEstimator,
    fusion::Fusion,
};

/// Mean σ of the fault modes and mean μ⁰ over the steps, and σ over earlier ones.
struct Worn {
    early: f64,
    late: f64,
    normal: f64,
}

fn wear(design: &ImmDesign, runs: u64, steps: usize) -> Worn {
    let mut estimator = ImmEstimator::new(design, 16).unwrap();
    let mut fusion = Fusion::new(design);
    let mut worn = Worn {
        early: 0.0,
        late: 0.0,
        normal: 0.0,
    };
    for seed in 0..runs {
        let truth = simulate(design, steps, [0.0; 2], 0, &mut Draw::new(seed));
        let seen = filter(&mut estimator, &mut fusion, design, &[0, 1, 2], &truth);
        let sigma = |range: std::ops::Range<usize>| {
            let count = range.len() as f64;
            let own = |place: usize| (seen[place].amplitude[1].1 + seen[place].amplitude[2].1) / 2.0;
            range.map(own).sum::<f64>() / count / runs as f64
        };
        worn.early += sigma(200..500);
        worn.late += sigma(steps - 300..steps);
        let last = &seen[steps - 300..];
        worn.normal += last.iter().map(|seen| seen.probability[0]).sum::<f64>() / 300.0 / runs as f64;
    }
    worn
}

#[test]
fn amplitudes_carried_along_shared_channels_stay_open_for_an_hour_without_fault() {
    let design = paper_design(Form::Sequential, Mixing::SharedChannel, stay(0.99));
    let worn = wear(&design, 8, 3600);
    assert!(worn.late >= 0.9 * worn.early, "{} {}", worn.late, worn.early);
    assert!(worn.normal >= 0.94, "{}", worn.normal);
}

#[test]
fn amplitudes_mixed_among_all_modes_collapse_within_an_hour_with_the_papers_transition() {
    let design = paper_design(Form::Sequential, Mixing::All, paper_transition());
    let worn = wear(&design, 2, 3600);
    assert!(
        worn.late < 0.01 && worn.early < 0.1,
        "{} {}",
        worn.late,
        worn.early
    );
    assert!((worn.normal - 0.334).abs() < 0.01, "{}", worn.normal);
}
