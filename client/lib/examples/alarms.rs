//! Prints every alarm transition, sleeping in between, over restarts of the daemon.
//!
//! ```text
//! cargo run -p residual-client --example alarms -- INSTANCE [EPOCH.NUMBER]
//! ```
//!
//! With a number it goes on behind that transition: keep the last one that was printed, and none is missed.

use std::error::Error;
use std::time::Duration;

use residual_client::{AlarmEvent, AlarmListener, AlarmStart, Instance};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (instance, start) = match arguments.as_slice() {
        [instance] => (instance, AlarmStart::Oldest),
        [instance, number] => (instance, AlarmStart::After(number.parse()?)),
        _ => return Err("usage: alarms INSTANCE [EPOCH.NUMBER]".into()),
    };
    let instance = Instance::from_environment(instance.parse()?);
    let mut listener = AlarmListener::connect(&instance, start);
    loop {
        match listener.wait(Duration::from_secs(1)) {
            Some(AlarmEvent::Transition(alarm)) => {
                let diagnoser = alarm.diagnoser_name().unwrap_or("?");
                let faults: Vec<_> = alarm.certainly_faulty().collect();
                let transition = alarm.transition;
                println!(
                    "{}: {diagnoser} {} {faults:?}",
                    transition.number,
                    transition.state.name()
                );
            }
            Some(AlarmEvent::Gap { first, last }) => println!("transitions {first} to {last} are lost"),
            Some(AlarmEvent::NewNumbering { previous, .. }) => {
                println!("numbers begin anew; what came after {previous} is not known");
            }
            None => println!("nothing new; daemon: {:?}", listener.state()),
        }
    }
}
