//! Sensor drivers.

use std::sync::atomic::Ordering;

use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use residual_shared::names::Instance;
use residual_shared::transport::{self, Node, SamplePublisher};

use super::helper::{instance, told_to_end};
use super::{INPUTS, PERIOD_NS};

/// Drivers of the aircraft's two inputs.
pub struct Drivers {
    /// Measurements.
    pub sensors: SamplePublisher,
    /// Commands.
    pub commands: SamplePublisher,
    _node: Node,
}

impl Drivers {
    /// Connects to the daemon of an instance.
    pub fn open(instance: &Instance) -> Self {
        let node = transport::open_node(instance).unwrap();
        let open = |input| SamplePublisher::open(&node, instance, input).unwrap();
        Self {
            sensors: open(INPUTS[0]),
            commands: open(INPUTS[1]),
            _node: node,
        }
    }

    /// Sends the measurement and command number `k` of the aircraft at rest.
    pub fn send(&mut self, k: u64, stamp_ns: u64) {
        self.sensors.send(stamp_ns, &at_rest(k)).unwrap();
        self.commands.send(stamp_ns, &[0.0, 0.0]).unwrap();
    }
}

/// A measurement of the aircraft at rest, with noise well within its bounds.
pub fn at_rest(k: u64) -> [f64; 4] {
    std::array::from_fn(|row| 0.004 * (k as f64 + row as f64).sin())
}

/// The body of a publisher process: the aircraft at rest at 100 Hz on the driver's own clock, until it is told to
/// end.
pub fn publish_until_told_to_end() {
    let Some(instance) = instance() else { return };
    let end = told_to_end();
    let mut drivers = Drivers::open(&instance);
    println!("publishing");
    let start_ns = monotonic_ns();
    for k in 0.. {
        if end.load(Ordering::Relaxed) {
            break;
        }
        let stamp_ns = start_ns + k * PERIOD_NS;
        sleep_until_monotonic(stamp_ns);
        drivers.send(k, stamp_ns);
    }
}
