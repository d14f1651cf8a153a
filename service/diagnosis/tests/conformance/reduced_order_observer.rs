//! The reduced-order observer on the paper's plant and on a vehicle, in each of its modes.

use crate::case::{Case, Promise, design};
use crate::conforms;
use crate::plant::{Draw, LinearPlant, Noise, Plant};
use nalgebra::DMatrix;
use residual_diagnosis::reduced_order_observer::options::ReducedOrderObserverOptions;
use std::sync::OnceLock;

const SERVO: &str = r#"
[model]
A = [[0.49, 0.10, 0.06], [-0.32, 0.95, -0.23], [-0.25, -0.06, 0.63]]
B = [[0.4], [0.4], [0.5]]
C = [[1, 0, 0], [0, 1, 0]]
D = [[-0.1], [0.2], [-0.1]]
initial_state_lower = [-20, -80, -40]
initial_state_upper = [20, 80, 40]
disturbance_lower = [-1]
disturbance_upper = [1]
measurement_noise_bound = [0.01, 0.01]
input_lower = [-2]
input_upper = [2]
"#;

/// Noise and disturbance reach their bounds. The first complete sample may come late: the box of its state is wide.
fn servo(seed: u64) -> Box<dyn Plant> {
    let mut draw = Draw::new(seed, Noise::Bounded);
    Box::new(LinearPlant {
        a: DMatrix::from_row_slice(3, 3, &[0.49, 0.1, 0.06, -0.32, 0.95, -0.23, -0.25, -0.06, 0.63]),
        b: DMatrix::from_row_slice(3, 1, &[0.4, 0.4, 0.5]),
        c: DMatrix::identity(2, 3),
        feedthrough: DMatrix::zeros(2, 1),
        d: DMatrix::from_row_slice(3, 1, &[-0.1, 0.2, -0.1]),
        disturbance: vec![1.0],
        noise: vec![0.01; 2],
        command: vec![2.0],
        actuator_fault: vec![1.0],
        sensor_fault: vec![0.0; 2],
        state: draw.vector(&[1.0; 3]),
        draw,
        loss: 0.02,
        k: 0,
    })
}

const VEHICLE: &str = r#"
[model]
A = [[0.89, -0.33, 0.85, 0.0077], [0.014, 0.88, 0.71, 0.0061], [0, 0, 0.93, 0.015], [0, 0, -5.96, 0.52]]
B = [[0.022, -0.0014], [0.017, 0.0075], [0.066, 0], [5.96, 0]]
C = [[0, 1, 0, 0], [1, 0.5, 0, 0]]
D = [[0.012], [0.0031], [0], [0]]
initial_state_lower = [-1, -1, -1, -1]
initial_state_upper = [1, 1, 1, 1]
disturbance_lower = [-0.5]
disturbance_upper = [0.5]
measurement_noise_bound = [0.001, 0.001]
input_lower = [-0.1, -1]
input_upper = [0.1, 1]
[isolation]
poles = [0.4, 0.5]
fault_bound = [0.3, 4]
"#;

fn vehicle(seed: u64) -> Box<dyn Plant> {
    let mut draw = Draw::new(seed, Noise::Bounded);
    let a = [
        0.89, -0.33, 0.85, 0.0077, 0.014, 0.88, 0.71, 0.0061, 0.0, 0.0, 0.93, 0.015, 0.0, 0.0, -5.96, 0.52,
    ];
    Box::new(LinearPlant {
        a: DMatrix::from_row_slice(4, 4, &a),
        b: DMatrix::from_row_slice(4, 2, &[0.022, -0.0014, 0.017, 0.0075, 0.066, 0.0, 5.96, 0.0]),
        c: DMatrix::from_row_slice(2, 4, &[0.0, 1.0, 0.0, 0.0, 1.0, 0.5, 0.0, 0.0]),
        feedthrough: DMatrix::zeros(2, 2),
        d: DMatrix::from_row_slice(4, 1, &[0.012, 0.0031, 0.0, 0.0]),
        disturbance: vec![0.5],
        noise: vec![0.001; 2],
        command: vec![0.02, 0.3],
        actuator_fault: vec![0.2, 0.0],
        sensor_fault: vec![0.0; 2],
        state: draw.vector(&[0.2, 0.05, 0.02, 0.1]),
        draw,
        loss: 0.02,
        k: 0,
    })
}

const PRINTED: &str = "[design]\ngains = \"given\"\nK = [[8.3461, 4.6730]]\n\
                       observer_M = [[0.0498, 0.0249], [-0.0109, -0.0056]]\n";

fn case(options: &str) -> Case {
    Case {
        tables: format!("{SERVO}{options}"),
        design: design::<ReducedOrderObserverOptions>,
        period_ns: 100_000_000,
        plant: servo,
        promise: Promise::NoFalseAlarm,
        designed: OnceLock::new(),
    }
}

fn vehicle_case(options: &str) -> Case {
    Case {
        tables: format!("{VEHICLE}{options}"),
        period_ns: 20_000_000,
        plant: vehicle,
        ..case("")
    }
}

conforms! {
    joint => case("[isolation]\nfault_bound = [10]");
    joint_without_fault_bound => case("[bounds]\nalarm_samples = 2");
    joint_with_printed_gains => case(PRINTED);
    joint_from_the_prior_box => case("[bounds]\ninitialisation = \"prior_box\"");
    joint_with_restart => case("[design]\nspectral_radius_max = 0.6\n[missing]\nmax_width_ratio = 3\nrestart_state_lower = [-20, -80, -40]\nrestart_state_upper = [20, 80, 40]");
    bank => vehicle_case("");
    paper => Case {
        promise: Promise::NoClaim("Theorem 2 neglects part of the error and all noise"),
        ..case(&format!("{PRINTED}[bounds]\nmode = \"paper\""))
    };
    interval => Case {
        promise: Promise::NoClaim("the traditional interval observer neglects the same"),
        ..case(&format!("{PRINTED}[bounds]\nmode = \"tiom\""))
    };
}
