//! How long something goes on.

use std::io;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::flag;

/// The longest time that can be asked for: a year.
const LONGEST: Duration = Duration::from_secs(365 * 86_400);

/// A flag that the first signal to end sets; the second one ends the process at once.
pub fn stop_flag() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        flag::register_conditional_shutdown(signal, 1, Arc::clone(&stop))?;
        flag::register(signal, Arc::clone(&stop))?;
    }
    Ok(stop)
}

/// Seconds as a time above 0, at most a year.
pub fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "it is not a number".to_owned())?;
    let duration = Duration::try_from_secs_f64(seconds).unwrap_or_default();
    if duration.is_zero() || duration > LONGEST {
        return Err(format!("use a number above 0, at most {}", LONGEST.as_secs()));
    }
    Ok(duration)
}
