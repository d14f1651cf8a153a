//! The scalar systems as a quick plant: three diagnosers whose design takes milliseconds, at 100 Hz.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};

use residual_shared::clock::sleep_until_monotonic;
use residual_shared::names::Instance;
use residual_shared::transport::{self, SamplePublisher};
use toml::Table;

use super::{PERIOD_NS, Stage};

const SCALAR: &str = include_str!("../../../../deploy/config/scalar.toml");

/// The diagnosers.
pub const SYSTEMS: [&str; 3] = ["stable_system", "unstable_system", "marginal_system"];
/// Their inputs, in order.
pub const SENSORS: [&str; 3] = ["stable_sensor", "unstable_sensor", "marginal_sensor"];

/// An instance with the scalar systems at 100 Hz that may catch up for a second: tests share a machine.
pub fn stage() -> Stage {
    let mut stage = Stage::new();
    let scalar: Table = SCALAR.parse().unwrap();
    for section in ["input", "diagnoser"] {
        stage.configuration[section] = scalar[section].clone();
    }
    for diagnoser in stage.diagnosers() {
        let diagnoser = diagnoser.as_table_mut().unwrap();
        diagnoser.insert("sample_time_s".into(), 0.01.into());
        diagnoser.insert("margin_s".into(), 0.005.into());
        // The other statistics have thresholds from simulations, which take seconds.
        let residual: Table = "enabled = ['residual']\ndecision = ['residual']\nwindow_steps = [1]"
            .parse()
            .unwrap();
        diagnoser.insert("statistics".into(), residual.into());
        let threshold: Table = "mode = 'per_instant'\nfalse_alarm_probability = 0.001"
            .parse()
            .unwrap();
        diagnoser.insert("threshold".into(), threshold.into());
    }
    stage.configuration.remove("replay");
    stage.set("daemon", "catch_up_limit", 100);
    stage
}

/// The measurement of step `k`: noise well within its bounds.
pub fn at_rest(k: u64) -> f64 {
    let scattered = k.wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
    0.05 * (scattered as f64 / (1 << 23) as f64 - 1.0)
}

/// A sensor of the stable system, in a thread of its own: at every instant the measurement that `value` says, until
/// it is dropped. It lives on while daemons come and go.
pub struct Sensor {
    end: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Sensor {
    /// Begins at the first instant after now of the daemon that runs.
    pub fn start(stage: &Stage, value: impl Fn(u64) -> f64 + Send + 'static) -> Self {
        let epoch_ns = stage.table().directory().spec.schedule_epoch_ns;
        let (instance, end) = (stage.instance.clone(), Arc::new(AtomicBool::new(false)));
        let told = Arc::clone(&end);
        let thread = thread::spawn(move || publish(&instance, epoch_ns, value, &told));
        Self {
            end,
            thread: Some(thread),
        }
    }
}

impl Drop for Sensor {
    fn drop(&mut self) {
        self.end.store(true, Ordering::Relaxed);
        let ended = self.thread.take().map(JoinHandle::join);
        assert!(
            thread::panicking() || matches!(ended, Some(Ok(()))),
            "the sensor failed"
        );
    }
}

fn publish(instance: &Instance, epoch_ns: u64, value: impl Fn(u64) -> f64, end: &AtomicBool) {
    let node = transport::open_node(instance).unwrap();
    let mut publisher = SamplePublisher::open(&node, instance, SENSORS[0]).unwrap();
    let now_ns = residual_shared::clock::monotonic_ns();
    for k in now_ns.saturating_sub(epoch_ns) / PERIOD_NS + 1.. {
        if end.load(Ordering::Relaxed) {
            break;
        }
        let instant_ns = epoch_ns + k * PERIOD_NS;
        // A little before its instant, so that it has come when the step is due.
        sleep_until_monotonic(instant_ns - PERIOD_NS / 5);
        publisher.send(instant_ns, &[value(k)]).unwrap();
    }
}
