//! Cases of the chi-square tests.
//!
//! Half of the states are measured (one at least, three for n = 6), every state has process noise of its own. Thresholds
//! are given, so that no calibration is run: they do not change what a step costs as long as nothing alarms.

use anyhow::Result;
use nalgebra::DMatrix;
use residuald::configuration::method::MethodConfiguration;
use toml::{Table, Value};

use super::plant::{Draw, Drive, PERIOD, Plant, commands};
use super::recording::{Recording, rows};
use super::{Case, STATES, Watched};

const THRESHOLDS: &str = "[threshold]\nglr = 1e3\ncusum = 1e3\nbank = 1e3\n";

/// All cases.
pub fn cases() -> Vec<Case> {
    let modes: [(&str, &str); 5] = [
        ("all", ""),
        (
            "likelihood ratio M=40",
            "[statistics]\nenabled = [\"glr\", \"cusum\"]\n[glr]\nwindow_steps = 40",
        ),
        (
            "window bank",
            "[statistics]\nenabled = [\"state_window\"]\ndecision = [\"state_window\"]\n[threshold]\nmode = \"per_instant\"",
        ),
        (
            "two propagators",
            "[statistics]\nenabled = [\"state_two_propagator\"]\ndecision = [\"state_two_propagator\"]\n\
             [threshold]\nmode = \"per_instant\"",
        ),
        (
            "residual",
            "[statistics]\nenabled = [\"residual\"]\ndecision = [\"residual\"]\n[threshold]\nmode = \"per_instant\"",
        ),
    ];
    let case = |mode, states, plant, options: &str| Case {
        method: "chi_square",
        mode,
        states,
        generators: None,
        is_default: mode == "all",
        read: |tables| tables.try_into().map(MethodConfiguration::ChiSquare),
        plant,
        options: options.to_owned(),
    };
    let of_states = |states| {
        let constant = modes.map(|(mode, options)| case(mode, states, constant as _, options));
        // Two models in turn: nothing becomes steady, every step is the full recursion.
        let changing = [
            ("all, changing models", modes[0].1),
            ("likelihood ratio M=40, changing models", modes[1].1),
        ];
        let changing = changing.map(|(mode, options)| case(mode, states, selected as _, options));
        constant.into_iter().chain(changing)
    };
    STATES.into_iter().flat_map(of_states).collect()
}

struct Parts {
    matrices: Table,
    start: Table,
    recording: Recording,
}

fn parts(n: usize) -> Parts {
    let outputs = n.div_ceil(2);
    let mut draw = Draw::new(n);
    let plant = Plant {
        a: draw.of_norm(0.95, n),
        b: draw.matrix(n, 1),
        c: draw.matrix(outputs, n),
        feedthrough: DMatrix::zeros(outputs, 1),
        d: DMatrix::identity(n, n),
    };
    let drive = Drive {
        commands: commands(1),
        disturbance: draw.normal_columns(n, PERIOD) * 0.1,
        noise: draw.normal_columns(outputs, PERIOD) * 0.1,
    };
    let run = plant.run(&drive);
    let matrices = Table::from_iter([
        ("transition".to_owned(), rows(&plant.a)),
        ("input".to_owned(), rows(&plant.b)),
        ("process_noise_input".to_owned(), rows(&plant.d)),
        (
            "process_noise_covariance".to_owned(),
            rows(&(DMatrix::identity(n, n) * 0.01)),
        ),
        ("measurement".to_owned(), rows(&plant.c)),
        (
            "measurement_noise_covariance".to_owned(),
            rows(&(DMatrix::identity(outputs, outputs) * 0.01)),
        ),
    ]);
    let start = [("initial_covariance".to_owned(), rows(&DMatrix::identity(n, n)))];
    Parts {
        matrices,
        start: Table::from_iter(start),
        recording: Recording::new(100_000_000, &run.outputs, &drive.commands),
    }
}

fn constant(n: usize) -> Result<Watched> {
    let mut parts = parts(n);
    parts.matrices.extend(parts.start);
    let mut tables: Table = THRESHOLDS.parse()?;
    tables.insert("model".to_owned(), Value::Table(parts.matrices));
    Ok(Watched {
        tables,
        recording: parts.recording,
    })
}

/// The number of the model is the last command; both models are the true one.
fn selected(n: usize) -> Result<Watched> {
    let mut parts = parts(n);
    for (k, sample) in parts.recording.instants.iter_mut().enumerate() {
        sample.commands.push((k / 8 % 2) as f64);
    }
    parts
        .start
        .insert("schedule".to_owned(), Value::String("selected".to_owned()));
    let models = vec![Value::Table(parts.matrices.clone()), Value::Table(parts.matrices)];
    let mut tables: Table = THRESHOLDS.parse()?;
    tables.insert("model".to_owned(), Value::Table(parts.start));
    tables.insert("models".to_owned(), Value::Array(models));
    Ok(Watched {
        tables,
        recording: parts.recording,
    })
}
