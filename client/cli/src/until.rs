//! How long something goes on.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use signal_hook::iterator::Signals;
use signal_hook::low_level;

/// The longest time that can be asked for: a year.
const LONGEST: Duration = Duration::from_secs(365 * 86_400);

/// Signals that come so soon after the first one belong to it: `timeout` signals its child, and then the child's whole
/// group.
const SAME: Duration = Duration::from_secs(1);

/// A flag that the first signal to end sets. A second SIGINT (Ctrl-C) ends the process at once, as does any signal
/// that comes more than a second after the first.
pub fn stop_flag() -> io::Result<Arc<AtomicBool>> {
    let stop = Arc::new(AtomicBool::new(false));
    let mut signals = Signals::new([SIGINT, SIGTERM, SIGHUP])?;
    let told = Arc::clone(&stop);
    thread::Builder::new().name("signals".into()).spawn(move || {
        let mut asked = Asked::default();
        for signal in signals.forever() {
            if asked.is_urgent(signal, Instant::now()) {
                low_level::exit(1);
            }
            told.store(true, Ordering::Relaxed);
        }
    })?;
    Ok(stop)
}

/// The signals there have been.
#[derive(Default)]
struct Asked {
    first: Option<Instant>,
    interrupted: bool,
}

impl Asked {
    /// Takes a signal; whether it must end the process at once.
    fn is_urgent(&mut self, signal: i32, now: Instant) -> bool {
        let is_interrupt = signal == SIGINT;
        let is_late = now.duration_since(*self.first.get_or_insert(now)) > SAME;
        let is_second_interrupt = is_interrupt && self.interrupted;
        self.interrupted |= is_interrupt;
        is_late || is_second_interrupt
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_interrupt_or_a_late_signal_is_urgent_and_an_echo_is_not() {
        let begin = Instant::now();
        let urgent = |signals: &[(i32, u64)]| -> Vec<bool> {
            let mut asked = Asked::default();
            signals
                .iter()
                .map(|(signal, ms)| asked.is_urgent(*signal, begin + Duration::from_millis(*ms)))
                .collect()
        };
        assert_eq!(urgent(&[(SIGTERM, 0), (SIGTERM, 1), (SIGHUP, 900)]), [false; 3]);
        assert_eq!(urgent(&[(SIGTERM, 0), (SIGTERM, 1001)]), [false, true]);
        assert_eq!(
            urgent(&[(SIGINT, 0), (SIGTERM, 1), (SIGINT, 2)]),
            [false, false, true]
        );
        assert_eq!(
            urgent(&[(SIGTERM, 0), (SIGINT, 1), (SIGINT, 2)]),
            [false, false, true]
        );
    }

    #[test]
    fn times_are_above_zero_and_at_most_a_year() {
        assert_eq!(seconds("0.5"), Ok(Duration::from_millis(500)));
        for wrong in ["0", "-1", "nan", "inf", "1e-30", "1e9", "x"] {
            assert!(seconds(wrong).is_err(), "{wrong}");
        }
    }
}
