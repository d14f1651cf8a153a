//! Lists the diagnosers of a daemon, describes each, and resets those that are named.
//!
//! ```text
//! cargo run -p residual-client --features transport --example control -- INSTANCE [DIAGNOSER…]
//! ```

use std::error::Error;

use residual_client::{Control, Instance};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let Some(instance) = arguments.next() else {
        return Err("usage: control INSTANCE [DIAGNOSER…]".into());
    };
    let control = Control::connect(&Instance::from_environment(instance.parse()?))?;
    let listing = control.list()?;
    println!(
        "process {}, {} requests answered",
        listing.pid, listing.requests.answered
    );
    for diagnoser in &listing.diagnosers {
        let description = control.describe(&diagnoser.name)?;
        println!(
            "{}: {}, gains {}",
            diagnoser.name, diagnoser.method, description.gains
        );
        for (name, value) in &description.certificate {
            println!("  {name}: {value}");
        }
    }
    for diagnoser in arguments {
        control.reset(&diagnoser)?;
        println!("{diagnoser} is reset");
    }
    Ok(())
}
