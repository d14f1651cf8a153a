//! The view on a terminal: looks, keys and signals until the user ends it.

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};

use ratatui::crossterm::event::{self, Event};
use residual_client::{AlarmListener, Monitor};
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use super::WatchOptions;
use super::screen::Screen;
use super::state::ViewState;
use crate::error::Error;
use crate::snapshot::Snapshot;

/// Longest time without a look at signals and at the size of the terminal.
const SLICE: Duration = Duration::from_millis(50);

/// Alarm transitions that are taken in one look, so that keys are obeyed in the meantime.
const EVENTS: usize = 100_000;

/// Draws views until the count is reached or the user ends it.
pub fn run(monitor: &mut Monitor, mut alarms: AlarmListener, options: &WatchOptions) -> Result<u8, Error> {
    let end = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&end))?;
    }
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
            state.alarms.hear(event);
        }
        screen.draw(&state)?;
        left = left.map(|left| left - 1);
        if left == Some(0)
            || wait(
                Duration::from_millis(options.interval),
                &end,
                &mut screen,
                &mut state,
            )?
        {
            return Ok(0);
        }
    }
}

/// Waits for the interval, while keys and resizes are obeyed; tells whether the user ends the view.
fn wait(
    interval: Duration,
    end: &AtomicBool,
    screen: &mut Screen,
    state: &mut ViewState,
) -> io::Result<bool> {
    let deadline = Instant::now() + interval;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let has_event = has_event(left.min(SLICE))?;
        if end.load(Ordering::Relaxed) {
            return Ok(true);
        }
        if has_event {
            match event::read()? {
                Event::Key(key) if state.press(key) => return Ok(true),
                Event::Resize(..) => screen.forget(),
                _ => {}
            }
            screen.draw(state)?;
        } else if screen.is_resized() {
            screen.draw(state)?;
        }
        if left.is_zero() {
            return Ok(false);
        }
    }
}

/// Waits for an event; without a keyboard there is none.
fn has_event(timeout: Duration) -> io::Result<bool> {
    if !io::stdin().is_terminal() {
        sleep(timeout);
        return Ok(false);
    }
    match event::poll(timeout) {
        Err(error) if error.kind() == io::ErrorKind::Interrupted => Ok(false),
        outcome => outcome,
    }
}
