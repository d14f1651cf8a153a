//! Observer matrices, gains and corrected sets (facts 1, 2, 4, 6).

use super::*;

#[test]
fn fact_1_the_observer_matrices_decouple_the_fault() {
    let design = parse(DESIGN);
    let plant = Plant::new(&model(DESIGN, 1.0, true), 50, false);
    let s = dense(&design["model"]["S"]);
    let c = plant.c.to_dense();
    let expected = [
        [0.004328863367, -0.062649775601, 0.011048778470, -0.050436774089],
        [0.005346583117, -0.004664865133, -0.040072672442, -0.044229815631],
    ];
    for (i, expected) in expected.iter().enumerate() {
        let observer = UnknownInputObserver::new(&plant, mode(i), Some(&s));
        let (t, n) = (observer.t.to_dense(), observer.n.to_dense());
        assert!((&t * plant.b.to_dense().column(i)).amax() < 1e-15);
        assert!((&t + &n * &c - DMatrix::identity(4, 4)).amax() < 1e-15);
        assert_eq!(t.rank(1e-9), 3);
        assert_near(
            (&c * &t * plant.b.to_dense().column(1 - i)).as_slice(),
            expected,
            1e-11,
        );
        assert!((t - dense(&design["modes"][i]["T"])).amax() < 1e-12);
        assert!((n - dense(&design["modes"][i]["N"])).amax() < 1e-12);
        assert!((observer.decoupling.gain.to_dense() - dense(&design["modes"][i]["L0"])).amax() < 1e-12);
        let projector = UnknownInputObserver::new(&plant, mode(i), None)
            .decoupling
            .test_rows;
        assert!((projector.to_dense() - dense(&design["modes"][i]["projector"])).amax() < 1e-12);
    }
    let observer = UnknownInputObserver::new(&plant, mode(0), Some(&s));
    let diagonal: Vec<f64> = (c * observer.n.to_dense()).diagonal().iter().copied().collect();
    assert_near(
        &diagonal,
        &[0.014583411155, 0.093862976484, 0.650758638255, 0.279812377961],
        1e-11,
    );
}

#[test]
fn fact_2_the_papers_residual_is_the_projected_innovation() {
    let plant = Plant::new(&model(DESIGN, 1.0, true), 50, false);
    let s = dense(&parse(DESIGN)["model"]["S"]);
    for i in 0..2 {
        let observer = UnknownInputObserver::new(&plant, mode(i), Some(&s));
        let rows = observer.decoupling.test_rows.to_dense();
        let filter = PaperFilter::new(&plant, observer, TestRule::Printed, 50);
        let mut rig = Rig::new(&plant, mode(i), Form::Paper, 50, &[1.0; 4]);
        for k in 0..30 {
            let y: Vec<f64> = (0..4).map(|j| (1.7 * k as f64 + j as f64).sin()).collect();
            rig.command.receive(&plant, &[(0.3 * k as f64).cos(), 0.5]);
            let predicted = plant.a0.to_dense() * DVector::from_column_slice(&rig.state.centre)
                + plant.b.to_dense() * DVector::from_column_slice(&rig.command.centre);
            let expected = &rows * (DVector::from_column_slice(&y) - plant.c.to_dense() * predicted);
            rig.paper_step(&plant, &filter, &y);
            let found: Vec<f64> = rig.outcome.outputs.iter().map(|row| row.residual).collect();
            assert_near(&found, expected.as_slice(), 1e-13);
        }
    }
}

#[test]
fn fact_4_the_gains_are_stationary_and_no_perturbation_is_better() {
    let unit = parse(UNIT);
    let case = &unit["coupled_gain"];
    let model = model(DESIGN, 1.0, true);
    let plant = Plant::new(&model, 50, false);
    let (c, v) = (plant.c.to_dense(), DMatrix::from_diagonal(model.v()));
    let generators = Matrix::from(&dense(&case["G"]));
    let g = generators.to_dense();
    let mut work = Workspace::new(&plant, 50, 1, Reduction::GirardScaled);
    work.prediction.generators.copy_from(&generators);
    let spread = Matrix::from(&(&c * &g));
    work.prediction.spread.copy_from(&spread);

    assert!(optimal_gain(&plant.noise, &mut work));
    let lambda = work.gain.to_dense();
    let r = &c * &g * g.transpose() * c.transpose() + &v * &v;
    assert!((&lambda * r - &g * g.transpose() * c.transpose()).amax() < 1e-12 * g.norm_squared());
    assert!((&lambda - dense(&unit["gain_equation_35"]["Lambda"])).amax() < 1e-11);

    let filter = coupled(&plant, mode(0), false, 50);
    work.choice.prepare(&filter.decoupling, &spread, &plant.noise);
    let candidates = super::super::gain::Candidates {
        strip: None,
        fixed: None,
        sweeps: 0,
    };
    work.choice.choose(
        &filter.decoupling,
        &generators,
        &spread,
        candidates,
        &mut work.gain,
    );
    let gain = work.gain.to_dense();
    assert!((&gain - dense(&case["L"])).amax() < 1e-11);
    let weight = DMatrix::from_diagonal(&DVector::from_vec(vec![3.0, 0.1, 1.0, 20.0]));
    let size = |gain: &DMatrix<f64>, weight: &DMatrix<f64>| {
        let left = weight * (&g - gain * &c * &g);
        (left.norm_squared() + (weight * gain * &v).norm_squared()).sqrt()
    };
    let identity = DMatrix::identity(4, 4);
    assert!((size(&gain, &identity) - case["frobenius_norm"].as_f64().unwrap()).abs() < 1e-12);
    let basis = filter.decoupling.null_basis.to_dense();
    for trial in 0..200 {
        let scale = 10.0_f64.powi(-(trial % 6));
        let change = DMatrix::from_fn(4, 3, |i, j| {
            scale * ((trial * 31 + i as i32 * 7 + j as i32) as f64).sin()
        });
        let other = &gain + change * &basis;
        for weight in [&identity, &weight] {
            assert!(size(&other, weight) >= size(&gain, weight));
        }
    }
}

#[test]
fn fact_6_the_corrected_set_contains_the_intersection_for_any_gain() {
    let unit = parse(UNIT);
    let case = &unit["correction_31_32"];
    let model = model(DESIGN, 1.0, true);
    let plant = Plant::new(&model, 50, false);
    let (h, c) = (dense(&case["H"]), plant.c.to_dense());
    let p = DVector::from_vec(vector(&case["p"]));
    let mut work = Workspace::new(&plant, 50, 1, Reduction::GirardScaled);
    work.prediction.generators.copy_from(&Matrix::from(&h));
    work.prediction.spread.copy_from(&Matrix::from(&(&c * &h)));
    let mut corrected = Matrix::with_capacity(4, 20);
    for trial in 0..100_i32 {
        let sample = |i: usize, scale: f64| scale * ((trial * 13 + i as i32) as f64 * 1.37).sin();
        let z = DVector::from_fn(7, |i, _| sample(i, 1.0));
        let noise = DVector::from_fn(4, |i, _| sample(i + 7, 1.0));
        let x = &p + &h * &z;
        let y = &c * &x + noise.component_mul(model.v());
        let gain = DMatrix::from_fn(4, 4, |i, j| sample(20 + 4 * i + j, 2.0));
        let gain_rows = Matrix::from(&gain);
        work.prediction.correct(&gain_rows, &plant.noise, &mut corrected);
        let centre = &p + &gain * (y - &c * &p);
        let coordinates =
            DVector::from_iterator(11, z.iter().copied().chain(noise.iter().map(|value| -value)));
        assert!((centre + corrected.to_dense() * coordinates - x).amax() < 1e-12);
    }
    assert!(optimal_gain(&plant.noise, &mut work));
    work.prediction.correct(&work.gain, &plant.noise, &mut corrected);
    assert!((corrected.to_dense() - dense(&case["generators"])).amax() < 1e-12);
    let centre = &p + work.gain.to_dense() * (DVector::from_vec(vector(&case["y"])) - &c * &p);
    assert_near(centre.as_slice(), &vector(&case["centre"]), 1e-11);
}
