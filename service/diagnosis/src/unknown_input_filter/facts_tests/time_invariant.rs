//! The tables of time-invariant plants and the memoryless form (fact 16).

use super::*;

#[test]
fn fact_16_the_table_is_the_unreduced_set_of_the_fixed_gain() {
    let case = &parse(VARIANTS)["lti_table"];
    let model = model(BATTERY, 3.0, false);
    let plant = Plant::new(&model, 4000, false);
    let gain = Matrix::from(&dense(&case["fixed_gain"]));
    let filter = coupled(&plant, mode(1), false, 4000);
    let rows = filter.decoupling.test_rows.to_dense();
    let table =
        super::super::lti::half_widths(&model, &gain.to_dense(), &rows, &DVector::repeat(5, 3.0), 1000);
    let steady = super::super::lti::steady_half_widths(&model, &gain.to_dense(), &rows).unwrap();
    for (k, expected) in vector(&case["k"])
        .iter()
        .zip(case["half_width"].as_array().unwrap())
    {
        let found: Vec<f64> = table.row(*k as usize - 1).iter().copied().collect();
        assert_near(&found, &vector(expected), 1e-9);
    }
    for row in [0, 1, 3] {
        let excess = steady[row] / table[(999, row)] - 1.0;
        assert!((-1e-14..1e-9).contains(&excess), "{excess}");
    }
    // The filter itself, without reduction, gives the same half widths.
    let nominal = Nominal {
        radius: vec![3.0; 5],
        state: vec![0.0; 5],
        order: 30,
        reduction: Reduction::GirardScaled,
    };
    let fixed = FixedGain::check(&plant, &coupled(&plant, mode(1), false, 30), &gain, &nominal).unwrap();
    let filter = FixedFilter::new(&plant, filter, &fixed);
    let mut rig = Rig::new(&plant, mode(1), Form::Coupled, 4000, &[3.0; 5]);
    for k in 0..200 {
        rig.measured.receive(&plant, &[0.0; 4]);
        let Rig {
            state,
            work,
            outcome,
            command,
            measured,
        } = &mut rig;
        filter.step(&plant, command, measured, state, work, outcome);
        for (row, test) in rig
            .outcome
            .outputs
            .iter()
            .enumerate()
            .filter(|(_, test)| test.evaluated)
        {
            assert!((test.half_width - table[(k, row)]).abs() < 1e-12);
        }
    }
}

#[test]
fn fact_16_the_memoryless_form_is_the_filter_from_the_second_step_on() {
    let model = model(DESIGN, 1.0, true);
    let plant = Plant::new(&model, 30, false);
    let filter = coupled(&plant, mode(0), true, 30);
    let rows = filter.decoupling.test_rows.to_dense();
    let memoryless = super::super::lti::MemorylessFilter::new(&model, rows).unwrap();
    let mut rig = Rig::new(&plant, mode(0), Form::Coupled, 30, &[1.0; 4]);
    let mut previous = DVector::zeros(4);
    for k in 0..50 {
        let y = DVector::from_fn(4, |j, _| 0.2 * (0.1 * k as f64 + j as f64).sin());
        let u = [0.1 * (k as f64).cos(), 0.05];
        rig.command.receive(&plant, &u);
        rig.coupled_step(&plant, &filter, y.as_slice());
        if k > 0 {
            let (residual, half_width) = memoryless.test(&previous, &DVector::from_row_slice(&u), &y);
            let found: (Vec<f64>, Vec<f64>) = rig
                .outcome
                .outputs
                .iter()
                .map(|row| (row.residual, row.half_width))
                .unzip();
            assert_near(&found.0, residual.as_slice(), 1e-12);
            assert_near(&found.1, half_width.as_slice(), 1e-12);
        }
        previous = y;
    }
    let mut radius = vec![0.0; 4];
    row_sums(&rig.state.generators, &mut radius);
    assert_near(&radius, &[0.01, 0.01, 0.01, 0.03], 1e-12);
}
