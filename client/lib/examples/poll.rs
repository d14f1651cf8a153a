//! Polls one diagnoser ten times a second and prints what it says, over restarts of the daemon.
//!
//! ```text
//! cargo run -p residual-client --example poll -- INSTANCE DIAGNOSER
//! ```

use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

use residual_client::{Freshness, Instance, Monitor, StepRecord};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [instance, diagnoser] = arguments.as_slice() else {
        return Err("usage: poll INSTANCE DIAGNOSER".into());
    };
    let mut monitor = Monitor::connect(&Instance::from_environment(instance.parse()?));
    let diagnoser = monitor.follow(diagnoser)?;
    let mut record = StepRecord::new(0);
    loop {
        let reading = monitor.read_followed(diagnoser, &mut record)?;
        match reading.freshness {
            Freshness::Fresh => {
                let ratio = record.worst_channel().map_or(0.0, |(_, channel)| channel.ratio);
                println!(
                    "step {}: {}, worst ratio {ratio:.3}",
                    record.step,
                    record.verdict().name()
                );
            }
            Freshness::Stale { age } => println!("no new record for {age:?}"),
            Freshness::NotEvaluated => println!("step {}: not evaluated", record.step),
            Freshness::Starting => println!("starting"),
            Freshness::Dead => println!("no daemon: {:?}", monitor.state()),
        }
        sleep(Duration::from_millis(100));
    }
}
