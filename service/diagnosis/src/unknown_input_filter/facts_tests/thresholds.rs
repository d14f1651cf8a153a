//! How tight the thresholds are and what they see (facts 11 and 14, method sheet 4.8).

use super::*;

#[test]
fn fact_11_adjoint_noise_reaches_the_bound_of_every_row() {
    let model = model(DESIGN, 1.0, false);
    let plant = Plant::new(&model, 400, false);
    let (a, c) = (model.a0(), model.c());
    let instants = 25;
    for i in 0..2 {
        let filter = coupled(&plant, mode(i), false, 400);
        // Widths and gains do not depend on data when A⁺ = 0: record the gains on zero data.
        let mut rig = Rig::new(&plant, mode(i), Form::Coupled, 400, &[1.0; 4]);
        let gains: Vec<DMatrix<f64>> = (0..instants)
            .map(|_| {
                rig.coupled_step(&plant, &filter, &[0.0; 4]);
                rig.work.gain.to_dense()
            })
            .collect();
        for row in 0..4 {
            let w = filter.decoupling.test_rows.to_dense().row(row).into_owned();
            let sign = |q: &nalgebra::RowDVector<f64>| q.map(f64::signum).transpose();
            let mut noise = vec![DVector::zeros(4); instants + 1];
            let mut disturbance = vec![DVector::zeros(4); instants];
            noise[instants] = sign(&w);
            let mut q = &w * c;
            disturbance[instants - 1] = sign(&q);
            q *= a;
            for k in (0..instants - 1).rev() {
                let gain = &gains[k];
                noise[k + 1] = sign(&(-(&q * gain)));
                q -= &q * gain * c;
                disturbance[k] = sign(&q);
                q *= a;
            }
            let mut x = sign(&q);
            let mut rig = Rig::new(&plant, mode(i), Form::Coupled, 400, &[1.0; 4]);
            for k in 0..instants {
                x = a * x + model.d() * disturbance[k].component_mul(model.w());
                let y = c * &x + noise[k + 1].component_mul(model.v());
                rig.coupled_step(&plant, &filter, y.as_slice());
            }
            let test = rig.outcome.outputs[row];
            assert!((test.residual / test.half_width - 1.0).abs() < 1e-9, "{test:?}");
        }
    }
}

#[test]
fn fact_14_the_set_after_the_first_step_is_the_strip() {
    for uncertain in [true, false] {
        let plant = Plant::new(&model(DESIGN, 1.0, uncertain), 30, false);
        for i in 0..2 {
            let filter = coupled(&plant, mode(i), true, 30);
            let mut rig = Rig::new(&plant, mode(i), Form::Coupled, 30, &[1.0; 4]);
            rig.coupled_step(&plant, &filter, &[0.0; 4]);
            assert_near(&rig.state.radius, &[0.01, 0.01, 0.01, 0.03], 1e-8);
        }
    }
}

#[test]
fn floors_grow_with_the_state_as_listed() {
    let design = parse(DESIGN);
    let plant = Plant::new(&model(DESIGN, 1.0, true), 50, false);
    let s = dense(&design["model"]["S"]);
    for case in design["inert_threshold"].as_array().unwrap() {
        let magnitude = case["state_magnitude"].as_f64().unwrap();
        for fault in 0..2 {
            let other = mode(1 - fault);
            let observer = UnknownInputObserver::new(&plant, other, Some(&s));
            let paper = PaperFilter::new(&plant, observer, TestRule::Printed, 50);
            let filter = coupled(&plant, other, true, 50);
            let mut rigs =
                [Form::Paper, Form::Coupled].map(|form| Rig::new(&plant, other, form, 50, &[1.0; 4]));
            for _ in 0..300 {
                for rig in &mut rigs {
                    rig.state.centre.fill(magnitude);
                }
                rigs[0].paper_step(&plant, &paper, &[0.0; 4]);
                rigs[1].coupled_step(&plant, &filter, &[0.0; 4]);
            }
            let [paper, row_wise] = rigs.each_ref().map(|rig| rig.outcome.floors[fault]);
            let relative = |found: f64, field: &str| found / case[field][fault].as_f64().unwrap() - 1.0;
            assert!(relative(row_wise, "floor_row_wise").abs() < 1e-9);
            // The reduced sets of the paper's form do not settle but cycle, by less than one per cent.
            assert!(relative(paper, "floor_paper").abs() < 1e-2);
        }
    }
}

#[test]
fn the_alarm_rule_is_that_of_the_reference() {
    let cases = parse(UNIT)["alarm"]["cases"].as_array().unwrap().clone();
    assert_eq!(cases.len(), 6);
    for case in cases {
        let [lower, upper] = ["lo", "up"].map(|bound| case[bound].as_f64().unwrap());
        let row = super::super::outcome::TestRow {
            residual: -(lower + upper) / 2.0,
            half_width: (upper - lower) / 2.0,
            evaluated: true,
        };
        assert_eq!(row.alarm(), case["alarm"].as_bool().unwrap(), "{case}");
    }
    let undefined = super::super::outcome::TestRow {
        residual: f64::NAN,
        half_width: 1.0,
        evaluated: true,
    };
    assert!(undefined.alarm());
}
