//! Cases of the reduced-order observer.
//!
//! Half of the states are measured, with one output more than disturbances. The disturbance acts on what is measured
//! only (D in the range of C'), so that K = 0 decouples it and the choice of gains is never empty.

use anyhow::Result;
use nalgebra::DMatrix;
use residuald::configuration::method::MethodConfiguration;
use toml::{Table, Value};

use super::plant::{Draw, Drive, PERIOD, Plant, commands};
use super::recording::{Recording, list, rows};
use super::{Case, STATES, Watched};

/// All cases.
pub fn cases() -> Vec<Case> {
    let modes = [
        (
            "joint with bank",
            "[isolation]\npoles = [0.5]\nfault_bound = [10.0]",
        ),
        ("joint", "[isolation]\nenabled = false\nfault_estimate = false"),
        (
            "joint from the prior box",
            "[bounds]\ninitialisation = \"prior_box\"\n[isolation]\nenabled = false\nfault_estimate = false",
        ),
        (
            "paper",
            "[bounds]\nmode = \"paper\"\n[isolation]\nenabled = false\nfault_estimate = false",
        ),
        (
            "interval",
            "[bounds]\nmode = \"tiom\"\n[isolation]\nenabled = false\nfault_estimate = false",
        ),
    ];
    let case = |(mode, options): (&'static str, &str), states| Case {
        method: "reduced_order_observer",
        mode,
        states,
        generators: None,
        is_default: mode == "joint with bank",
        read: |tables| tables.try_into().map(MethodConfiguration::ReducedOrderObserver),
        plant: watched,
        options: options.to_owned(),
    };
    let of_states = |states| modes.map(|mode| case(mode, states));
    STATES.into_iter().flat_map(of_states).collect()
}

fn watched(n: usize) -> Result<Watched> {
    let outputs = n.div_ceil(2).max(2).min(n - 1);
    let disturbances = (outputs / 2).max(1);
    let mut draw = Draw::new(n);
    let c = draw.matrix(outputs, n);
    let plant = Plant {
        a: draw.of_norm(0.8, n),
        b: draw.matrix(n, 1),
        feedthrough: DMatrix::zeros(outputs, 1),
        d: c.transpose() * draw.matrix(outputs, disturbances),
        c,
    };
    let drive = Drive {
        commands: commands(1),
        disturbance: draw.matrix(disturbances, PERIOD) * 0.1,
        noise: draw.matrix(outputs, PERIOD) * 0.01,
    };
    let run = plant.run(&drive);
    let around = |offset: f64| list(run.start.iter().map(|x| x + offset));
    let model = Table::from_iter([
        ("A".to_owned(), rows(&plant.a)),
        ("B".to_owned(), rows(&plant.b)),
        ("C".to_owned(), rows(&plant.c)),
        ("D".to_owned(), rows(&plant.d)),
        ("initial_state_lower".to_owned(), around(-1.0)),
        ("initial_state_upper".to_owned(), around(1.0)),
        ("disturbance_lower".to_owned(), list(vec![-0.1; disturbances])),
        ("disturbance_upper".to_owned(), list(vec![0.1; disturbances])),
        ("measurement_noise_bound".to_owned(), list(vec![0.01; outputs])),
        ("input_lower".to_owned(), list([-1.0])),
        ("input_upper".to_owned(), list([1.0])),
    ]);
    Ok(Watched {
        tables: Table::from_iter([("model".to_owned(), Value::Table(model))]),
        recording: Recording::new(20_000_000, &run.outputs, &drive.commands),
    })
}
