//! One row for each diagnoser, and below one for each input.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::columns::{self, Column};
use super::theme::{Theme, Tone};
use super::{alarms, condition, ratio};
use crate::snapshot::{DiagnoserView, InputView, Snapshot};
use crate::status::faults;
use crate::watch::state::ViewState;

/// The columns; the bar's heading is its scale.
const fn columns(scale: &'static str) -> [Column; 12] {
    [
        Column::left("diagnoser", 0, 0),
        Column::left("state", 7, 0),
        Column::left("alarm", 0, 4),
        Column::left("faults", 0, 8),
        Column::left("worst", 0, 3),
        Column::left(scale, 0, 2),
        Column::right("ratio", 6, 1),
        Column::right("step", 6, 6),
        Column::right("age", 6, 5),
        Column::right("skipped", 0, 7),
        Column::right("overruns", 0, 9),
        Column::right("dropped", 0, 10),
    ]
}

/// Counters of inputs: heading, name of the counter, rank.
const INPUT_COUNTERS: [(&str, &str, u8); 9] = [
    ("accepted", "accepted", 3),
    ("lost", "lost", 1),
    ("late", "late", 2),
    ("not finite", "non_finite", 4),
    ("length", "wrong_length", 6),
    ("duplicate", "duplicate", 5),
    ("backward", "backward", 7),
    ("ahead", "too_far_ahead", 8),
    ("overwritten", "overwritten", 9),
];

/// Draws the list.
pub fn draw(frame: &mut Frame, area: Rect, snapshot: &Snapshot, state: &ViewState, theme: Theme) {
    let diagnosers = &snapshot.diagnosers;
    let room = usize::from(area.height);
    let wanted = (diagnosers.len() + 1, snapshot.inputs.len() + 2);
    // The inputs get what the diagnosers leave, and a third of a crowded screen that is not too small.
    let input_rows = if snapshot.inputs.is_empty() {
        0
    } else {
        let left = room.saturating_sub(wanted.0);
        let least = if room >= 9 { room / 3 } else { 0 };
        wanted.1.min(left.max(least))
    };
    // A gap, a heading and one row.
    let input_rows = if input_rows < 3 { 0 } else { input_rows };
    let upper = Rect {
        height: (room - input_rows) as u16,
        ..area
    };
    draw_diagnosers(frame, upper, snapshot, state, theme);
    if input_rows > 0 {
        let lower = Rect {
            y: upper.bottom() + 1,
            height: (input_rows - 1) as u16,
            ..area
        };
        draw_inputs(frame, lower, &snapshot.inputs, theme);
    }
}

fn draw_diagnosers(frame: &mut Frame, area: Rect, snapshot: &Snapshot, state: &ViewState, theme: Theme) {
    let diagnosers = &snapshot.diagnosers;
    let (cells, scale) = ratio::scale(area.width);
    let room = usize::from(area.height).saturating_sub(1);
    let first = columns::first_row(state.selected, diagnosers.len(), room);
    let rows: Vec<_> = diagnosers
        .iter()
        .map(|diagnoser| diagnoser_row(diagnoser, snapshot.now_ns, cells, theme))
        .collect();
    let (heading, lines) = columns::lines(&columns(scale), &rows, area.width, theme);
    let lines = [heading].into_iter().chain(lines.into_iter().skip(first));
    draw_lines(frame, area, lines);
    let selected = (state.selected - first.min(state.selected) + 1) as u16;
    if !diagnosers.is_empty() && selected < area.height {
        let row = Rect {
            y: area.y + selected,
            height: 1,
            ..area
        };
        frame.buffer_mut().set_style(row, theme.selected());
    }
}

fn diagnoser_row(diagnoser: &DiagnoserView, now_ns: u64, cells: usize, theme: Theme) -> Vec<Span<'static>> {
    let (mark, tone) = condition::mark(diagnoser);
    let state = theme.style(tone);
    let count = |name| {
        let count = diagnoser.counters.get(name).copied().unwrap_or_default();
        count_span(count, Tone::Warn, theme)
    };
    let worst = diagnoser.worst_channel.as_ref();
    let worst_ratio = worst.map_or(f64::NAN, |channel| channel.ratio.0);
    let ratio_style = ratio::style(worst_ratio, theme);
    let step = if diagnoser.record == 0 {
        "-".into()
    } else {
        diagnoser.step.to_string()
    };
    vec![
        Span::styled(format!("{mark} {}", diagnoser.name), state),
        Span::styled(condition::word(diagnoser), state),
        alarms::status(&diagnoser.alarm, theme),
        Span::styled(faults(diagnoser), state),
        Span::raw(worst.map_or_else(|| "-".into(), |channel| channel.name.clone())),
        Span::styled(ratio::bar(worst_ratio, cells), ratio_style),
        Span::styled(ratio::text(worst_ratio), ratio_style),
        Span::raw(step),
        Span::raw(condition::age(diagnoser, now_ns)),
        count("skipped"),
        count("overruns"),
        count("records_dropped"),
    ]
}

/// A counter; in the colour if it is not 0.
fn count_span(count: u64, tone: Tone, theme: Theme) -> Span<'static> {
    let style = theme.style(if count == 0 { Tone::Quiet } else { tone });
    Span::styled(count.to_string(), style)
}

fn draw_inputs(frame: &mut Frame, area: Rect, inputs: &[InputView], theme: Theme) {
    let count = |input: &InputView, name: &str| input.counters.get(name).copied().unwrap_or_default();
    let missed = |input: &InputView| {
        let counters = INPUT_COUNTERS.iter().filter(|(_, name, _)| *name != "accepted");
        counters.map(|(_, name, _)| count(input, name)).sum::<u64>()
    };
    let mut shown: Vec<_> = inputs.iter().collect();
    let room = usize::from(area.height).saturating_sub(1);
    let has_room = shown.len() <= room;
    if !has_room {
        // What goes wrong must be seen.
        shown.sort_by_key(|input| std::cmp::Reverse(missed(input)));
        shown.truncate(room.saturating_sub(1));
    }
    let mut columns = vec![Column::left("input", 9, 0)];
    columns.extend(INPUT_COUNTERS.map(|(title, _, rank)| Column::right(title, 0, rank)));
    let row = |input: &&InputView| {
        let mut row = vec![Span::raw(format!("  {}", input.name))];
        row.extend(INPUT_COUNTERS.map(|(_, name, _)| match count(input, name) {
            count if name == "accepted" => Span::raw(count.to_string()),
            count => count_span(count, Tone::Warn, theme),
        }));
        row
    };
    let rows: Vec<_> = shown.iter().map(row).collect();
    let (heading, lines) = columns::lines(&columns, &rows, area.width, theme);
    let more = (!has_room).then(|| {
        let text = format!("  … {} more inputs", inputs.len() - shown.len());
        Line::styled(text, theme.style(Tone::Quiet))
    });
    draw_lines(frame, area, [heading].into_iter().chain(lines).chain(more));
}

/// Draws as many lines as there is room for.
pub fn draw_lines<'a>(frame: &mut Frame, area: Rect, lines: impl IntoIterator<Item = Line<'a>>) {
    for (line, row) in lines.into_iter().zip(area.rows()) {
        frame.render_widget(line, row);
    }
}
