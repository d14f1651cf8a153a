//! Cases of the interacting multiple models: three modes (normal, one for each of two actuators), three sensors with two
//! rows each, one packet of each sensor in every fusion period.

use anyhow::Result;
use nalgebra::DMatrix;
use residual_diagnosis::diagnoser::PacketSource;
use residual_diagnosis::hinf_filter::plant::zoh;
use residuald::configuration::method::MethodConfiguration;
use toml::{Table, Value};

use super::plant::{Draw, PERIOD, commands};
use super::recording::{Recording, SentPacket, list, rows};
use super::{Case, PlantOf, STATES, Watched};

const PERIOD_NS: u64 = 100_000_000;
const SENSORS: usize = 3;
const ROWS: usize = 2;

/// Standard deviations of the measurements.
const NOISE: f64 = 0.5;

/// All cases.
pub fn cases() -> Vec<Case> {
    let modes: [(&str, &str, PlantOf); 5] = [
        ("sequential", "", asynchronous),
        ("sequential, one instant", "", synchronous),
        ("square root", "form = \"sequential_square_root\"", asynchronous),
        ("roll-back of 2", "rollback_steps = 2", asynchronous),
        (
            "batch",
            "form = \"batch_unobserved\"\n[amplitude]\nmixing = \"all\"",
            asynchronous,
        ),
    ];
    let case = |(mode, options, plant): (&'static str, &str, PlantOf), states| Case {
        method: "async_imm",
        mode,
        states,
        generators: None,
        is_default: mode == "sequential",
        read: |tables| tables.try_into().map(MethodConfiguration::AsyncImm),
        plant,
        options: options.to_owned(),
    };
    let of_states = |states| modes.map(|mode| case(mode, states));
    STATES.into_iter().flat_map(of_states).collect()
}

/// Every sensor at a time of its own, the last one at the fusion instant.
fn asynchronous(n: usize) -> Result<Watched> {
    watched(n, [60, 30, 0])
}

/// All sensors at the fusion instant.
fn synchronous(n: usize) -> Result<Watched> {
    watched(n, [0; SENSORS])
}

/// `before_ms`: how long before the fusion instant each sensor samples, a multiple of 10 ms, never rising.
fn watched(n: usize, before_ms: [u64; SENSORS]) -> Result<Watched> {
    let mut draw = Draw::new(n);
    let a = draw.of_norm(2.0, n) - DMatrix::identity(n, n) * 4.0;
    let b = draw.matrix(n, 2);
    let sensors: Vec<DMatrix<f64>> = (0..SENSORS).map(|_| draw.matrix(ROWS, n)).collect();
    let recording = record(&mut draw, &a, &b, &sensors, before_ms);
    let plant = Table::from_iter([
        ("A".to_owned(), rows(&a)),
        ("B".to_owned(), rows(&b)),
        ("G".to_owned(), rows(&b)),
        ("F".to_owned(), rows(&b)),
        (
            "process_noise_psd".to_owned(),
            rows(&(DMatrix::identity(2, 2) * 0.01)),
        ),
    ]);
    let sensors = sensors.iter().enumerate().map(|(number, matrix)| {
        Value::Table(Table::from_iter([
            ("name".to_owned(), Value::String(format!("sensor {}", number + 1))),
            ("measurement_matrix".to_owned(), rows(matrix)),
            (
                "noise_covariance".to_owned(),
                rows(&(DMatrix::identity(ROWS, ROWS) * (NOISE * NOISE))),
            ),
        ]))
    });
    let modes = [
        ("normal", [0.0, 0.0]),
        ("actuator 1", [1.0, 0.0]),
        ("actuator 2", [0.0, 1.0]),
    ];
    let modes = modes.map(|(name, direction)| {
        Value::Table(Table::from_iter([
            ("name".to_owned(), Value::String(name.to_owned())),
            (
                "direction".to_owned(),
                rows(&DMatrix::from_column_slice(2, 1, &direction)),
            ),
        ]))
    });
    let mut tables: Table = "[amplitude]\nprior_standard_deviation = [2.0]\n\
        [transition]\nkind = \"stay\"\nstay_probability = 0.999\nstay_period_s = 1.0\n\
        [initial]\nmode_probability = [0.9, 0.05, 0.05]\n"
        .parse()?;
    let start = [
        ("state".to_owned(), list(vec![0.0; n])),
        ("state_covariance".to_owned(), rows(&DMatrix::identity(n, n))),
    ];
    if let Some(Value::Table(initial)) = tables.get_mut("initial") {
        initial.extend(start);
    }
    tables.insert("plant".to_owned(), Value::Table(plant));
    tables.insert("sensor".to_owned(), Value::Array(sensors.collect()));
    tables.insert("mode".to_owned(), Value::Array(modes.to_vec()));
    Ok(Watched { tables, recording })
}

/// The plant in ten parts of every fusion period, each with noise of its own; packets where the sensors sample.
fn record(
    draw: &mut Draw,
    a: &DMatrix<f64>,
    b: &DMatrix<f64>,
    sensors: &[DMatrix<f64>],
    before_ms: [u64; SENSORS],
) -> Recording {
    let n = a.nrows();
    let part_s = PERIOD_NS as f64 * 1e-10;
    let (ad, bd) = zoh(a, b, part_s);
    let command = commands(2);
    let spread = (0.01 * part_s).sqrt();
    let mut state = nalgebra::DVector::zeros(n);
    let noise = draw.normal_columns(2, 10 * PERIOD) * spread;
    let measured = draw.normal_columns(SENSORS * ROWS, PERIOD) * NOISE;
    let mut recording = Recording::new(PERIOD_NS, &measured, &command);
    // The command of instant k acts from there on: during the interval that ends at instant k, that of k - 1 acts.
    for k in (0..PERIOD).cycle().take(4 * PERIOD) {
        let acting = command.column((k + PERIOD - 1) % PERIOD);
        let mut packets = Vec::new();
        for part in 0..10 {
            let disturbance = noise.column(10 * k + part);
            state = &ad * &state + &bd * acting + b * disturbance;
            for (number, sensor) in sensors.iter().enumerate() {
                let before = before_ms[number];
                if 10 * (9 - part as u64) == before {
                    let values = sensor * &state + measured.view((number * ROWS, k), (ROWS, 1));
                    packets.push(SentPacket {
                        source: PacketSource::Sensor(number),
                        before_ns: before * 1_000_000,
                        values: values.iter().copied().collect(),
                    });
                }
            }
        }
        packets.push(SentPacket {
            source: PacketSource::Commands,
            before_ns: 0,
            values: command.column(k).iter().copied().collect(),
        });
        let sample = &mut recording.instants[k];
        sample.measurements = packets[..SENSORS]
            .iter()
            .flat_map(|packet| packet.values.clone())
            .collect();
        sample.packets = packets;
    }
    recording
}
