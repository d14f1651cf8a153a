//! Drawing: a pure function of the state.

mod alarms;
mod columns;
mod condition;
mod detail;
mod list;
mod plot;
mod ratio;
#[cfg(test)]
mod tests;
mod theme;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::{Line, Span};

use super::state::{Page, ViewState};
use crate::snapshot::{DiagnoserView, Snapshot};
use theme::{Theme, Tone};

/// Smallest size that is drawn on.
const SMALLEST: (u16, u16) = (20, 5);

/// Draws the view: a line about the daemon, the page, and a line about the keys.
pub fn draw(frame: &mut Frame, state: &ViewState) {
    let area = frame.area();
    if area.is_empty() {
        return;
    }
    if area.width < SMALLEST.0 || area.height < SMALLEST.1 {
        let (width, height) = SMALLEST;
        let message = format!("needs {width}x{height}; q quits");
        frame.render_widget(Line::raw(message), Rect { height: 1, ..area });
        return;
    }
    let theme = Theme::new(state.has_colour);
    let [head, body, foot] =
        Layout::vertical([Constraint::Length(1), Constraint::Fill(1), Constraint::Length(1)]).areas(area);
    frame.render_widget(footer(state, theme, foot.width), foot);
    let Some(snapshot) = &state.snapshot else {
        frame.render_widget(Line::raw("waiting for the daemon"), head);
        return;
    };
    frame.render_widget(header(snapshot, state, theme, head.width), head);
    match state.page {
        Page::List => list::draw(frame, body, snapshot, state, theme),
        Page::Detail => detail::draw(frame, body, snapshot, state, theme),
        Page::Alarms => alarms::draw(frame, body, state, theme),
    }
}

fn header(snapshot: &Snapshot, state: &ViewState, theme: Theme, width: u16) -> Line<'static> {
    let tone = match snapshot.daemon {
        "running" => Tone::Good,
        "hung" => Tone::Bad,
        _ => Tone::Dead,
    };
    let mut pieces = vec![
        Span::styled(snapshot.instance.clone(), theme.bold()),
        Span::styled(
            format!("{}{}", if width < 40 { "" } else { "daemon " }, snapshot.daemon),
            theme.style(tone),
        ),
    ];
    if let Some(failure) = &state.failure {
        pieces.push(Span::styled(failure.clone(), theme.style(Tone::Warn)));
    }
    let is_active = |diagnoser: &&DiagnoserView| diagnoser.alarm.state.is_active();
    match snapshot.diagnosers.iter().filter(is_active).count() {
        0 => {}
        1 => pieces.push(Span::styled("1 alarm", theme.style(Tone::Bad))),
        count => pieces.push(Span::styled(format!("{count} alarms"), theme.style(Tone::Bad))),
    }
    pieces.push(Span::raw(format!("process {}", snapshot.pid)));
    pieces.push(Span::raw(format!("epoch {}", snapshot.epoch)));
    joined(pieces, usize::from(width))
}

fn footer(state: &ViewState, theme: Theme, width: u16) -> Line<'static> {
    let keys: &[(&str, &str)] = match state.page {
        Page::List => &[
            ("q", "quit"),
            ("Enter", "detail"),
            ("a", "alarms"),
            ("↑↓", "select"),
        ],
        Page::Alarms => &[("Esc", "back"), ("↑↓", "scroll"), ("q", "quit")],
        Page::Detail => &[
            ("Esc", "back"),
            ("+-", "window"),
            ("Tab", "channel"),
            ("←→", "diagnoser"),
            ("a", "alarms"),
            ("q", "quit"),
        ],
    };
    let pieces = keys
        .iter()
        .map(|(key, what)| Span::styled(format!("{key} {what}"), theme.style(Tone::Quiet)))
        .collect();
    joined(pieces, usize::from(width))
}

/// As many of the pieces, with two spaces between them, as there is room for; the first one always.
fn joined(pieces: Vec<Span<'static>>, width: usize) -> Line<'static> {
    let mut line = Line::default();
    for piece in pieces.into_iter().filter(|piece| !piece.content.is_empty()) {
        if line.spans.is_empty() {
            line.push_span(piece);
        } else if line.width() + 2 + piece.width() <= width {
            line.push_span(Span::raw("  "));
            line.push_span(piece);
        }
    }
    line
}
