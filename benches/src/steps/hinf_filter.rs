//! Cases of the H∞ filter.
//!
//! Half of the states are measured (two at least); a disturbance of the first state and one of each sensor; faults of
//! the actuator and of the first sensor.

use anyhow::Result;
use nalgebra::DMatrix;
use residual_diagnosis::hinf_filter::plant::zoh;
use residuald::configuration::method::MethodConfiguration;
use toml::{Table, Value};

use super::plant::{Draw, Drive, PERIOD, Plant, commands};
use super::recording::{Recording, list, rows};
use super::{Case, STATES, Watched};

const AMPLITUDE: f64 = 0.1;
const PERIOD_NS: u64 = 50_000_000;

/// All cases.
pub fn cases() -> Vec<Case> {
    let modes = [
        ("riccati", ""),
        ("cumulative", "[evaluation]\nwindow = \"cumulative\""),
        (
            "continuous",
            "[synthesis]\ntype = \"riccati_ct\"\n[evaluation]\ninclude_current = false",
        ),
        (
            "zero-order hold",
            "[synthesis]\ntype = \"riccati_ct\"\n[filter]\nrealisation = \"filter_zoh\"",
        ),
        (
            "bank of 3",
            "[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [1.0, 1.0]",
        ),
    ];
    let case = |(mode, options): (&'static str, &str), states, plant| Case {
        method: "hinf_filter",
        mode,
        states,
        generators: None,
        is_default: mode == "bank of 3",
        read: |tables| tables.try_into().map(MethodConfiguration::HinfFilter),
        plant,
        options: options.to_owned(),
    };
    let of_states = |states| {
        let alone = modes.map(|mode| case(mode, states, alone as _));
        alone
            .into_iter()
            .chain([case(("2 listed models", ""), states, listed)])
    };
    STATES.into_iter().flat_map(of_states).collect()
}

fn alone(n: usize) -> Result<Watched> {
    watched(n, &[])
}

/// Two further plants with other decay.
fn listed(n: usize) -> Result<Watched> {
    watched(n, &[1.05, 0.95])
}

fn watched(n: usize, factors: &[f64]) -> Result<Watched> {
    let outputs = n.div_ceil(2).max(2);
    let mut draw = Draw::new(n);
    // Its symmetric part is at most -2 1/s: stable, and a contraction over a period.
    let a = draw.of_norm(2.0, n) - DMatrix::identity(n, n) * 4.0;
    let b = draw.matrix(n, 1);
    let c = draw.matrix(outputs, n);
    let bd = DMatrix::from_fn(n, 1 + outputs, |i, j| f64::from(i == 0 && j == 0));
    let dd = DMatrix::from_fn(outputs, 1 + outputs, |i, j| f64::from(j == i + 1) * 0.1);
    let bf = b.clone().insert_column(1, 0.0);
    let df = DMatrix::from_fn(outputs, 2, |i, j| f64::from(i == 0 && j == 1));
    let sample_time_s = PERIOD_NS as f64 * 1e-9;
    let (ad, b_sampled) = zoh(&a, &b, sample_time_s);
    let plant = Plant {
        a: ad,
        b: b_sampled,
        c,
        feedthrough: DMatrix::zeros(outputs, 1),
        d: zoh(&a, &bd, sample_time_s).1,
    };
    let disturbance = draw.matrix(1 + outputs, PERIOD) * AMPLITUDE;
    let drive = Drive {
        commands: commands(1),
        noise: &dd * &disturbance,
        disturbance,
    };
    let run = plant.run(&drive);
    let mut model = Table::from_iter([
        ("A".to_owned(), rows(&a)),
        ("B".to_owned(), rows(&b)),
        ("C".to_owned(), rows(&plant.c)),
        ("Bd".to_owned(), rows(&bd)),
        ("Dd".to_owned(), rows(&dd)),
        ("Bf".to_owned(), rows(&bf)),
        ("Df".to_owned(), rows(&df)),
    ]);
    let others = factors
        .iter()
        .map(|&factor| Value::Table(Table::from_iter([("A".to_owned(), rows(&(&a * factor)))])));
    model.insert("listed_models".to_owned(), Value::Array(others.collect()));
    let disturbance = [("amplitude".to_owned(), list(vec![AMPLITUDE; 1 + outputs]))];
    let filter = [
        ("initial_state".to_owned(), list(run.start.iter().copied())),
        ("initial_error_bound".to_owned(), list(vec![1.0; n])),
    ];
    Ok(Watched {
        tables: Table::from_iter([
            ("model".to_owned(), Value::Table(model)),
            (
                "disturbance".to_owned(),
                Value::Table(Table::from_iter(disturbance)),
            ),
            ("filter".to_owned(), Value::Table(Table::from_iter(filter))),
        ]),
        recording: Recording::new(PERIOD_NS, &run.outputs, &drive.commands),
    })
}
