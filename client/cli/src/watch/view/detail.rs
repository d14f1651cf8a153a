//! One diagnoser: what it concludes, every channel, and a plot of the selected one.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::columns::{self, Column};
use super::list::draw_lines;
use super::theme::{Theme, Tone};
use super::{alarms, condition, joined, plot, ratio};
use crate::number::Number;
use crate::snapshot::{ChannelView, DiagnoserView, Snapshot};
use crate::watch::state::ViewState;

/// Least height of a plot.
const LEAST_PLOT: usize = 5;

/// The columns; the bar's heading is its scale.
const fn columns(scale: &'static str) -> [Column; 7] {
    [
        Column::left("channel", 0, 0),
        Column::right("lower", 8, 5),
        Column::right("residual", 8, 1),
        Column::right("upper", 8, 4),
        Column::left("unit", 0, 3),
        Column::right("ratio", 6, 0),
        Column::left(scale, 0, 2),
    ]
}

/// Draws the selected diagnoser.
pub fn draw(frame: &mut Frame, area: Rect, snapshot: &Snapshot, state: &ViewState, theme: Theme) {
    let Some(diagnoser) = state.diagnoser() else {
        return;
    };
    let mut about = about(diagnoser, snapshot.now_ns, usize::from(area.width), theme);
    let room = usize::from(area.height);
    // A small screen shows the channels rather than all about the diagnoser.
    about.truncate(match room {
        ..5 => 1,
        5..9 => 2,
        _ => about.len(),
    });
    let rest = room - about.len();
    let wanted = diagnoser.channels.len() + 1;
    let table = match rest.checked_sub(wanted) {
        Some(left) if left >= LEAST_PLOT => wanted,
        // Half for the plot, where the channels can be moved through.
        _ if rest / 2 >= LEAST_PLOT => rest - rest / 2,
        _ => rest,
    };
    let part = |from: usize, height: usize| Rect {
        y: area.y + from as u16,
        height: height as u16,
        ..area
    };
    let [info, channels, chart] = [
        part(0, about.len()),
        part(about.len(), table),
        part(about.len() + table, rest - table),
    ];
    draw_lines(frame, info, about);
    draw_channels(frame, channels, diagnoser, state, theme);
    if usize::from(chart.height) >= LEAST_PLOT {
        plot::draw(frame, chart, diagnoser, state, theme);
    }
}

/// What the diagnoser concludes, in lines that fit; the most important first.
fn about(diagnoser: &DiagnoserView, now_ns: u64, width: usize, theme: Theme) -> Vec<Line<'static>> {
    let (mark, tone) = condition::mark(diagnoser);
    let list = |names: &[String]| {
        if names.is_empty() {
            "-".into()
        } else {
            names.join(", ")
        }
    };
    let title = vec![
        Span::styled(
            format!("{mark} {} {}", diagnoser.name, condition::word(diagnoser)),
            theme.style(tone).patch(theme.bold()),
        ),
        Span::raw(diagnoser.method.clone()),
        Span::raw("alarm"),
        alarms::status(&diagnoser.alarm, theme),
        Span::raw(if diagnoser.alarm.is_latched { "latched" } else { "" }),
    ];
    let mut times = vec![Span::raw(format!("age {}", condition::age(diagnoser, now_ns)))];
    if diagnoser.record > 0 {
        times.push(Span::raw(format!("step {}", diagnoser.step)));
        times.push(Span::raw(format!(
            "at {:.3} s",
            diagnoser.instant_ns as f64 * 1e-9
        )));
    }
    times.push(Span::raw(format!(
        "period {} ms",
        diagnoser.period_ns as f64 * 1e-6
    )));
    times.extend(
        diagnoser
            .flags
            .iter()
            .map(|flag| Span::styled(*flag, theme.style(Tone::Warn))),
    );
    let faults = vec![
        Span::raw(format!("certainly faulty: {}", list(&diagnoser.certainly_faulty))),
        Span::raw(format!("possibly: {}", list(&diagnoser.possibly_faulty))),
    ];
    let [estimate, half_width] =
        [diagnoser.fault_estimate, diagnoser.fault_estimate_half_width].map(Number::short);
    let estimate = vec![Span::raw(format!("fault estimate: {estimate} ± {half_width}"))];
    let counters = diagnoser.counters.iter();
    let counters = counters.map(|(name, count)| Span::raw(format!("{} {count}", name.replace('_', " "))));
    [title, times, faults, estimate, counters.collect()]
        .map(|pieces| joined(pieces, width))
        .into()
}

fn draw_channels(frame: &mut Frame, area: Rect, diagnoser: &DiagnoserView, state: &ViewState, theme: Theme) {
    let (cells, scale) = ratio::scale(area.width);
    let rows: Vec<_> = diagnoser
        .channels
        .iter()
        .map(|channel| channel_row(channel, cells, theme))
        .collect();
    let (heading, lines) = columns::lines(&columns(scale), &rows, area.width, theme);
    let room = usize::from(area.height).saturating_sub(1);
    let first = columns::first_row(state.channel, lines.len(), room);
    draw_lines(
        frame,
        area,
        [heading].into_iter().chain(lines.into_iter().skip(first)),
    );
    let selected = (state.channel - first.min(state.channel) + 1) as u16;
    if !diagnoser.channels.is_empty() && selected < area.height {
        let row = Rect {
            y: area.y + selected,
            height: 1,
            ..area
        };
        frame.buffer_mut().set_style(row, theme.selected());
    }
}

fn channel_row(channel: &ChannelView, cells: usize, theme: Theme) -> Vec<Span<'static>> {
    let ratio = channel.ratio.0;
    let value = |number: Number| {
        // Not evaluated: the numbers mean nothing.
        Span::raw(if ratio.is_nan() {
            "-".into()
        } else {
            number.short()
        })
    };
    let style = ratio::style(ratio, theme);
    vec![
        Span::raw(channel.name.clone()),
        value(channel.lower),
        value(channel.residual),
        value(channel.upper),
        Span::raw(channel.unit.clone()),
        Span::styled(ratio::text(ratio), style),
        Span::styled(ratio::bar(ratio, cells), style),
    ]
}
