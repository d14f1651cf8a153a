//! Prints every step record of every diagnoser, and how many were lost.
//!
//! ```text
//! cargo run -p residual-client --features transport --example records -- INSTANCE
//! ```

use std::error::Error;
use std::thread::sleep;
use std::time::Duration;

use residual_client::{Instance, StepRecords};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [instance] = arguments.as_slice() else {
        return Err("usage: records INSTANCE".into());
    };
    let mut records = StepRecords::open(&Instance::from_environment(instance.parse()?))?;
    let mut lost = 0;
    loop {
        records.receive(|header, record| {
            let verdict = record.verdict().name();
            let (epoch, slot, step) = (header.epoch, header.slot, record.step);
            println!("epoch {epoch}, diagnoser {slot}, step {step}: {verdict}");
        });
        if records.counts().lost > lost {
            println!("{} records lost", records.counts().lost - lost);
            lost = records.counts().lost;
        }
        sleep(Duration::from_millis(10));
    }
}
