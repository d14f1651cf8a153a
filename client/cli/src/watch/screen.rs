//! A view that is drawn anew, for terminals.

use std::io::{self, Stdout, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use crossterm::event::{self, Event, KeyCode, KeyModifiers};
use crossterm::style::{Stylize, style};
use crossterm::{cursor, execute, queue, terminal};
use residual_client::Monitor;
use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};

use crate::arguments::WatchOptions;
use crate::error::Error;
use crate::number::Number;
use crate::snapshot::{ChannelView, Snapshot};
use crate::status::faults;

/// Characters of a full ratio bar.
const BAR: usize = 20;

/// Longest time without a look at signals.
const SLICE: Duration = Duration::from_millis(50);

/// Draws views until the count is reached or the user ends it.
pub fn run(monitor: &mut Monitor, options: &WatchOptions) -> Result<u8, Error> {
    let end = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM, SIGHUP] {
        signal_hook::flag::register(signal, Arc::clone(&end))?;
    }
    let mut screen = Screen::take()?;
    let mut left = options.count;
    loop {
        let snapshot = Snapshot::take(monitor)?;
        screen.draw(&text(snapshot.as_ref(), options))?;
        left = left.map(|left| left - 1);
        if left == Some(0) || wait(Duration::from_millis(options.interval), &end)? {
            return Ok(0);
        }
    }
}

/// The terminal in the state for drawing; restored when dropped, by an error or a panic too.
struct Screen(Stdout);

impl Screen {
    fn take() -> io::Result<Self> {
        terminal::enable_raw_mode()?;
        let mut screen = Self(io::stdout());
        execute!(
            screen.0,
            terminal::EnterAlternateScreen,
            terminal::DisableLineWrap,
            cursor::Hide
        )?;
        Ok(screen)
    }

    /// Draws the first lines of `text`, as many as there is room for.
    fn draw(&mut self, text: &str) -> io::Result<()> {
        // Some terminals do not know their size and say 0.
        let rows = terminal::size().map_or(0, |(_, rows)| usize::from(rows));
        let rows = if rows == 0 { 24 } else { rows };
        queue!(self.0, cursor::MoveTo(0, 0))?;
        for (row, line) in text.lines().take(rows).enumerate() {
            queue!(self.0, cursor::MoveTo(0, row as u16))?;
            write!(self.0, "{line}")?;
            queue!(self.0, terminal::Clear(terminal::ClearType::UntilNewLine))?;
        }
        if text.lines().count() < rows {
            queue!(
                self.0,
                cursor::MoveToNextLine(1),
                terminal::Clear(terminal::ClearType::FromCursorDown)
            )?;
        }
        self.0.flush()
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        // A terminal that has gone away cannot be restored.
        let _ = execute!(
            self.0,
            cursor::Show,
            terminal::EnableLineWrap,
            terminal::LeaveAlternateScreen
        );
        let _ = terminal::disable_raw_mode();
    }
}

/// Waits for the interval; tells whether the user ends the view, by a key or a signal.
fn wait(interval: Duration, end: &AtomicBool) -> io::Result<bool> {
    let deadline = Instant::now() + interval;
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let has_event = match event::poll(left.min(SLICE)) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => false,
            outcome => outcome?,
        };
        if end.load(Ordering::Relaxed) || (has_event && is_end(&event::read()?)) {
            return Ok(true);
        }
        if left.is_zero() {
            return Ok(false);
        }
    }
}

fn is_end(event: &Event) -> bool {
    event.as_key_press_event().is_some_and(|key| match key.code {
        KeyCode::Char('q') | KeyCode::Esc => true,
        KeyCode::Char('c') => key.modifiers.contains(KeyModifiers::CONTROL),
        _ => false,
    })
}

fn text(snapshot: Option<&Snapshot>, options: &WatchOptions) -> String {
    let Some(snapshot) = snapshot else {
        return "waiting for the daemon".into();
    };
    let mut lines = vec![format!(
        "instance {}: daemon {}   (q ends)",
        snapshot.instance, snapshot.daemon
    )];
    for diagnoser in options.watched(snapshot) {
        lines.push(String::new());
        let faults = faults(diagnoser);
        let title = format!(
            "{} ({}): {}, {}{}{faults}, step {}",
            diagnoser.name,
            diagnoser.method,
            diagnoser.freshness,
            diagnoser.verdict,
            if faults.is_empty() { "" } else { ": " },
            diagnoser.step,
        );
        lines.push(style(title).bold().to_string());
        lines.push(format!(
            "  {:20} {:>11} {:>11} {:>11} {:8} {:>11}",
            "channel", "lower", "residual", "upper", "unit", "ratio"
        ));
        lines.extend(diagnoser.channels.iter().map(channel_line));
    }
    lines.join("\n")
}

fn channel_line(channel: &ChannelView) -> String {
    let [lower, residual, upper, ratio] =
        [channel.lower, channel.residual, channel.upper, channel.ratio].map(Number::short);
    format!(
        "  {:20} {lower:>11} {residual:>11} {upper:>11} {:8} {ratio:>11} {}",
        channel.name,
        channel.unit,
        bar(channel.ratio.0),
    )
}

/// A bar that is full at the bound; green below 0.7, yellow near the bound, red beyond it.
fn bar(ratio: f64) -> String {
    // A ratio of NaN gives no bar.
    let filled = (ratio.clamp(0.0, 1.0) * BAR as f64).round() as usize;
    let bar = format!("{}{}", "█".repeat(filled), "·".repeat(BAR - filled));
    let coloured = match ratio {
        ratio if ratio > 1.0 => style(bar).red(),
        ratio if ratio > 0.7 => style(bar).yellow(),
        _ => style(bar).green(),
    };
    coloured.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_is_full_at_the_bound_and_empty_without_a_ratio() {
        let cells = |ratio| bar(ratio).matches('█').count();
        assert_eq!(
            [0.0, 0.5, 1.0, f64::INFINITY, f64::NAN].map(cells),
            [0, 10, 20, 20, 0]
        );
    }
}
