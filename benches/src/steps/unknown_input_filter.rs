//! Cases of the unknown-input filters.
//!
//! One filter: the plant has one actuator, whose fault the filter does not react to. Half of the states are measured
//! (two at least), so that the set does not collapse to one measurement and keeps all its generators; every state has
//! a disturbance of its own.

use anyhow::Result;
use nalgebra::DMatrix;
use residuald::configuration::method::MethodConfiguration;
use toml::{Table, Value};

use super::plant::{Draw, Drive, PERIOD, Plant, commands};
use super::recording::{Recording, list, rows};
use super::{Case, PlantOf, STATES, Watched};

/// Bounds of disturbance and noise.
const BOUND: f64 = 0.01;

/// How far below them the plant stays: only outward rounding bounds rounding errors.
const WITHIN: f64 = 1.0 - 1e-9;

/// Generator orders as multiples of the number of states; all modes with the second, as the aim has it.
const ORDERS: [usize; 4] = [5, 10, 15, 20];

/// All cases.
pub fn cases() -> Vec<Case> {
    let coupled =
        |gain, outward| format!("form = \"coupled\"\ngain = \"{gain}\"\noutward_rounding = {outward}");
    let modes = [
        ("row_wise", coupled("row_wise", true)),
        ("row_wise inward", coupled("row_wise", false)),
        (
            "row_wise 2 sweeps",
            format!("{}\ngain_sweeps = 2", coupled("row_wise", true)),
        ),
        ("fixed", coupled("fixed", true)),
        ("fixed inward", coupled("fixed", false)),
        ("frobenius", coupled("frobenius", true)),
        ("frobenius inward", coupled("frobenius", false)),
        ("paper", "form = \"paper\"".to_owned()),
    ];
    let mut cases = Vec::new();
    for n in STATES {
        for (mode, options) in &modes {
            let sweep = matches!(*mode, "row_wise" | "fixed" | "frobenius" | "paper");
            let orders = ORDERS.map(|order| order * n);
            for order in orders.into_iter().filter(|&order| sweep || order == 10 * n) {
                let filter = format!("[filter]\n{options}\ngenerator_order = {order}\n");
                let alone = "[bank]\nfault_free_mode = false\n[parity]\nlengths = []\n";
                cases.push(Case {
                    generators: Some(order),
                    ..case(mode, n, one_actuator, filter + alone)
                });
            }
        }
        let covariance = rows(&DMatrix::identity(n, n));
        let kalman = format!(
            "[filter]\nform = \"kalman_3sigma\"\nresidual_norm_threshold = 10.0\ninitial_covariance = {covariance}\n\
             [bank]\nfault_free_mode = false\n[parity]\nlengths = []\n"
        );
        cases.push(case("kalman_3sigma", n, one_actuator, kalman));
        cases.push(Case {
            is_default: true,
            ..case(
                "bank of 3",
                n,
                two_actuators,
                "[parity]\nlengths = []\n".to_owned(),
            )
        });
    }
    cases
}

fn case(mode: &'static str, states: usize, plant: PlantOf, options: String) -> Case {
    Case {
        method: "unknown_input_filter",
        mode,
        states,
        generators: None,
        is_default: false,
        read: |tables| tables.try_into().map(MethodConfiguration::UnknownInputFilter),
        plant,
        options,
    }
}

fn one_actuator(n: usize) -> Result<Watched> {
    watched(n, 1, n.div_ceil(2).max(2))
}

fn two_actuators(n: usize) -> Result<Watched> {
    watched(n, 2, n.div_ceil(2).max(2) + 1)
}

fn watched(n: usize, actuators: usize, outputs: usize) -> Result<Watched> {
    let mut draw = Draw::new(n);
    let plant = Plant {
        a: draw.of_norm(0.95, n),
        b: draw.matrix(n, actuators),
        c: draw.matrix(outputs, n),
        feedthrough: DMatrix::zeros(outputs, actuators),
        d: DMatrix::identity(n, n),
    };
    let drive = Drive {
        commands: commands(actuators),
        disturbance: draw.matrix(n, PERIOD) * (BOUND * WITHIN),
        noise: draw.matrix(outputs, PERIOD) * (BOUND * WITHIN),
    };
    let run = plant.run(&drive);
    let model = Table::from_iter([
        ("A".to_owned(), rows(&plant.a)),
        ("B".to_owned(), rows(&plant.b)),
        ("C".to_owned(), rows(&plant.c)),
        ("D".to_owned(), rows(&plant.d)),
        ("disturbance_bound".to_owned(), list(vec![BOUND; n])),
        ("measurement_noise_bound".to_owned(), list(vec![BOUND; outputs])),
        ("initial_state_center".to_owned(), list(run.start.iter().copied())),
        ("initial_state_radius".to_owned(), list(vec![1.0; n])),
    ]);
    let missing = Table::from_iter([("fault_bound".to_owned(), list(vec![10.0; actuators]))]);
    Ok(Watched {
        tables: Table::from_iter([
            ("model".to_owned(), Value::Table(model)),
            ("missing".to_owned(), Value::Table(missing)),
        ]),
        recording: Recording::new(10_000_000, &run.outputs, &drive.commands),
    })
}
