//! Plants and options that the tests share.

use crate::files::{list, reference_of};
use residual_diagnosis::{
    gains::FoundGains,
    method::MethodOptions,
    reduced_order_observer::{
        design::Design,
        gains::ReducedOrderObserverGains,
        options::{ModelOptions, ReducedOrderObserverOptions},
    },
};
use residual_synthesis::reduced_order_observer::find_gains;
use serde_json::Value;

/// What the sheet calls offline results.
pub fn reference() -> Value {
    reference_of("reduced_order_observer", "design.json")
}

/// A plant of the reference with |x(0)| <= 1, |η| <= `disturbance` and these bounds of the noise.
fn plant(matrices: &Value, disturbance: f64, noise: Vec<f64>) -> ReducedOrderObserverOptions {
    let a: Vec<Vec<f64>> = list(&matrices["A"]);
    let d: Vec<Vec<f64>> = list(&matrices["D"]);
    let (n, q) = (a.len(), d[0].len());
    ReducedOrderObserverOptions {
        model: ModelOptions {
            a,
            b: list(&matrices["B"]),
            c: list(&matrices["C"]),
            d,
            initial_state_lower: vec![-1.0; n],
            initial_state_upper: vec![1.0; n],
            disturbance_lower: vec![-disturbance; q],
            disturbance_upper: vec![disturbance; q],
            measurement_noise_bound: noise,
            ..ModelOptions::default()
        },
        ..ReducedOrderObserverOptions::default()
    }
}

/// The paper's plant.
pub fn servo(noise: [f64; 2]) -> ReducedOrderObserverOptions {
    plant(&reference()["plant"], 1.0, noise.to_vec())
}

/// Another plant of the reference, with the entry that it comes from.
pub fn other_plant(index: usize) -> (ReducedOrderObserverOptions, Value) {
    let entry = reference()["other_plants"][index].clone();
    let disturbance = entry["disturbance_abs"].as_f64().unwrap();
    let options = plant(&entry, disturbance, list(&entry["noise_bound"]));
    (options, entry)
}

/// Gains of options that are accepted.
pub fn found(options: &ReducedOrderObserverOptions) -> FoundGains<ReducedOrderObserverGains> {
    find_gains(options, 0.1, &mut |_| ()).unwrap()
}

/// The same, with the design that they give after they were written and read.
pub fn designed(options: &ReducedOrderObserverOptions) -> (FoundGains<ReducedOrderObserverGains>, Design) {
    let found = found(options);
    let text = toml::to_string(&found.gains).unwrap();
    let read: ReducedOrderObserverGains = toml::from_str(&text).unwrap();
    let achieved = options.with_gains(0.1, &read).unwrap().achieved;
    assert_eq!(achieved.violated(), None);
    let design = Design::with_gains(options, &read).unwrap();
    (found, design)
}
