//! The alarm log: the newest transitions first, gaps as gaps.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use residual_client::{Alarm, AlarmEvent, AlarmState};
use time::OffsetDateTime;
use time::format_description::BorrowedFormatItem;
use time::macros::format_description;

use super::columns::{self, Column};
use super::list::draw_lines;
use super::ratio;
use super::theme::{Theme, Tone};
use crate::snapshot::AlarmView;
use crate::watch::state::ViewState;

const COLUMNS: [Column; 9] = [
    Column::left("time (UTC)", 0, 3),
    Column::right("number", 0, 1),
    Column::right("at [s]", 0, 5),
    Column::left("diagnoser", 0, 0),
    Column::left("state", 8, 0),
    Column::left("faults", 0, 2),
    Column::left("channel", 0, 6),
    Column::right("ratio", 6, 4),
    Column::right("occurrence", 0, 7),
];

const TIME: &[BorrowedFormatItem<'static>] = format_description!("[month]-[day] [hour]:[minute]:[second]");

/// Draws the log.
pub fn draw(frame: &mut Frame, area: Rect, state: &ViewState, theme: Theme) {
    let log = &state.alarms;
    if log.count() == 0 {
        let message = Line::styled("no alarm since the machine's boot", theme.style(Tone::Quiet));
        draw_lines(frame, area, [message]);
        return;
    }
    let room = usize::from(area.height).saturating_sub(1);
    let events: Vec<_> = log.in_sight().take(room).collect();
    let rows: Vec<_> = events
        .iter()
        .filter_map(|heard| match &heard.event {
            AlarmEvent::Transition(alarm) => Some(row(alarm, heard.written, theme)),
            _ => None,
        })
        .collect();
    let (heading, lines) = columns::lines(&COLUMNS, &rows, area.width, theme);
    let mut transitions = lines.into_iter();
    let lines = events.iter().filter_map(|heard| match &heard.event {
        AlarmEvent::Transition(_) => transitions.next(),
        AlarmEvent::Gap { first, last } => {
            let text = format!(
                "{first} … {last}: {} missed",
                last.saturating_sub(*first).saturating_add(1)
            );
            Some(Line::styled(text, theme.style(Tone::Warn)))
        }
        AlarmEvent::NewNumbering { .. } => {
            let text = "the numbers began anew; how many were missed is unknown";
            Some(Line::styled(text, theme.style(Tone::Warn)))
        }
    });
    draw_lines(frame, area, [heading].into_iter().chain(lines));
}

fn row(alarm: &Alarm, written: OffsetDateTime, theme: Theme) -> Vec<Span<'static>> {
    let transition = &alarm.transition;
    let style = theme.style(tone(transition.state));
    let certain: Vec<_> = alarm.certainly_faulty().map(str::to_owned).collect();
    let faults = match certain.is_empty() {
        false => certain,
        true => alarm.possibly_faulty().map(|name| format!("{name}?")).collect(),
    };
    let is_active = transition.state.is_active();
    vec![
        // Month and day always have a form.
        Span::raw(written.format(TIME).unwrap_or_default()),
        Span::raw(transition.number.number.to_string()),
        Span::raw(format!("{:.3}", transition.instant_ns as f64 * 1e-9)),
        Span::raw(alarm.diagnoser_name().unwrap_or("unknown").to_owned()),
        Span::styled(
            format!("{} {}", mark(transition.state), transition.state.name()),
            style,
        ),
        Span::styled(
            if is_active {
                faults.join(", ")
            } else {
                String::new()
            },
            style,
        ),
        Span::raw(
            alarm
                .channel()
                .map_or_else(|| "-".into(), |channel| channel.name.clone()),
        ),
        Span::styled(
            ratio::text(transition.ratio),
            ratio::style(transition.ratio, theme),
        ),
        Span::raw(transition.occurrence.to_string()),
    ]
}

/// Where the alarm of a diagnoser stands, in a word; nothing if there has not been any.
pub fn status(alarm: &AlarmView, theme: Theme) -> Span<'static> {
    if alarm.occurrences == 0 && alarm.state == AlarmState::Cleared {
        return Span::styled("-", theme.style(Tone::Quiet));
    }
    let text = match alarm.occurrences {
        0 | 1 => alarm.state.name().to_owned(),
        more => format!("{} ×{more}", alarm.state.name()),
    };
    Span::styled(text, theme.style(tone(alarm.state)))
}

fn tone(state: AlarmState) -> Tone {
    match state {
        AlarmState::Cleared => Tone::Good,
        AlarmState::Pending => Tone::Warn,
        AlarmState::Raised | AlarmState::Isolated => Tone::Bad,
    }
}

fn mark(state: AlarmState) -> &'static str {
    match state {
        AlarmState::Cleared => "●",
        AlarmState::Pending => "△",
        AlarmState::Raised => "▲",
        AlarmState::Isolated => "◆",
    }
}
