//! The view on a terminal: looks, keys and signals until the user ends it.

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event};
use residual_client::{AlarmEvent, AlarmListener, Monitor};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
use time::OffsetDateTime;

use super::WatchOptions;
use super::alarm_log::Heard;
use super::screen::Screen;
use super::state::ViewState;
use crate::alarms::wall_clock;
use crate::error::Error;
use crate::snapshot::Snapshot;

/// Longest time without a look at signals and at the size of the terminal.
const SLICE: Duration = Duration::from_millis(50);

/// Exit code after a second signal.
const IMPATIENT: i32 = 1;

/// Alarm transitions that are taken in one look, so that keys are obeyed in the meantime.
const EVENTS: usize = 100_000;

/// Draws views until the count is reached or the user ends it.
pub fn run(monitor: &mut Monitor, mut alarms: AlarmListener, options: &WatchOptions) -> Result<u8, Error> {
    let end = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        // Whoever asks twice need not wait.
        signal_hook::flag::register_conditional_shutdown(signal, IMPATIENT, Arc::clone(&end))?;
        signal_hook::flag::register(signal, Arc::clone(&end))?;
    }
    let keyboard = Keyboard::of_standard_input();
    let mut state = ViewState::new(options.has_colour());
    let mut screen = Screen::take()?;
    let mut left = options.count;
    loop {
        match Snapshot::take(monitor) {
            Ok(mut snapshot) => {
                if let Some(snapshot) = &mut snapshot {
                    snapshot
                        .diagnosers
                        .retain(|diagnoser| options.is_watched(diagnoser));
                }
                state.look(snapshot);
            }
            // The daemon writes faster than can be read; the next look may succeed.
            Err(Error::Read(error)) => state.failed_look(&error),
            Err(error) => return Err(error),
        }
        let events = std::iter::from_fn(|| alarms.try_next()).take(EVENTS);
        for event in events.filter(|event| options.is_heard(event)) {
            let written = match &event {
                AlarmEvent::Transition(alarm) => wall_clock(alarm.transition.written_ns),
                _ => OffsetDateTime::UNIX_EPOCH,
            };
            state.alarms.hear(Heard { event, written });
        }
        screen.draw(&state)?;
        left = left.map(|left| left - 1);
        let interval = Duration::from_millis(options.interval);
        if left == Some(0) || wait(interval, &end, keyboard, &mut screen, &mut state)? {
            return Ok(0);
        }
    }
}

/// Waits for the interval, while keys and resizes are obeyed; tells whether the view ends.
fn wait(
    interval: Duration,
    end: &AtomicBool,
    keyboard: Keyboard,
    screen: &mut Screen,
    state: &mut ViewState,
) -> io::Result<bool> {
    let deadline = Instant::now() + interval;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let keyboard = keyboard.listen(left.min(SLICE));
        if end.load(Ordering::Relaxed) || keyboard == Keyboard::Gone {
            return Ok(true);
        }
        let mut has_changed = screen.is_resized();
        while keyboard == Keyboard::There && event::poll(Duration::ZERO)? {
            has_changed = true;
            match event::read()? {
                Event::Key(key) if state.press(key) => return Ok(true),
                Event::Resize(..) => screen.forget(),
                _ => {}
            }
        }
        if has_changed {
            screen.draw(state)?;
        }
        if left.is_zero() {
            return Ok(false);
        }
    }
}

/// What the keyboard of the terminal does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Keyboard {
    /// There may be keys to read.
    There,
    /// The standard input is no terminal.
    None,
    /// The terminal has hung up. Reading from it would never return: crossterm tries again and again.
    Gone,
}

impl Keyboard {
    fn of_standard_input() -> Self {
        if io::stdin().is_terminal() {
            Self::There
        } else {
            Self::None
        }
    }

    /// Waits for a key, a signal or the end of the time.
    fn listen(self, timeout: Duration) -> Self {
        if self != Self::There {
            sleep(timeout);
            return self;
        }
        let input = io::stdin();
        let mut ready = [PollFd::new(&input, PollFlags::IN)];
        // A signal that interrupts is seen by the caller.
        let _ = poll(&mut ready, Timespec::try_from(timeout).ok().as_ref());
        let [input] = ready;
        if input.revents().intersects(PollFlags::HUP | PollFlags::ERR) {
            Self::Gone
        } else {
            Self::There
        }
    }
}
