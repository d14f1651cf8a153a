//! The residual of the selected channel between its bounds, over the time seen.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Chart, Dataset, GraphType};

use super::joined;
use super::theme::{Theme, Tone};
use crate::number::Number;
use crate::snapshot::DiagnoserView;
use crate::watch::history::Pieces;
use crate::watch::state::ViewState;

/// Room above and below the lines, as a share of their range.
const MARGIN: f64 = 0.05;

/// Draws a title and the plot below it.
pub fn draw(frame: &mut Frame, area: Rect, diagnoser: &DiagnoserView, state: &ViewState, theme: Theme) {
    let (Some(channel), Some(history)) = (diagnoser.channels.get(state.channel), state.history()) else {
        return;
    };
    let window_s = state.window_s();
    let unit = if channel.unit.is_empty() {
        "1"
    } else {
        &channel.unit
    };
    let bound_marker = if theme.has_colour() {
        Marker::Braille
    } else {
        Marker::Dot
    };
    let title = vec![
        Span::styled(format!("{} [{unit}]", channel.name), theme.bold()),
        Span::raw(format!("last {window_s} s")),
        Span::styled("residual", theme.style(Tone::Residual)),
        Span::styled(
            if theme.has_colour() {
                "bounds"
            } else {
                "bounds •"
            },
            theme.style(Tone::Warn),
        ),
    ];
    frame.render_widget(joined(title, usize::from(area.width)), Rect { height: 1, ..area });
    let [lower, residual, upper] = history.lines(state.channel, window_s);
    let below = Rect {
        y: area.y + 1,
        height: area.height.saturating_sub(1),
        ..area
    };
    let Some((low, high)) = range([&lower, &residual, &upper]) else {
        let message = format!("not evaluated within the last {window_s} s");
        frame.render_widget(
            Line::styled(message, theme.style(Tone::Quiet)),
            Rect { height: 1, ..below },
        );
        return;
    };
    let bound = theme.style(Tone::Warn);
    // The residual is drawn last, over its bounds.
    let datasets = datasets(&lower, bound_marker, bound)
        .chain(datasets(&upper, bound_marker, bound))
        .chain(datasets(&residual, Marker::Braille, theme.style(Tone::Residual)))
        .collect();
    let label = |value: f64| Span::raw(Number(value).short());
    let chart = Chart::new(datasets)
        .legend_position(None)
        .x_axis(
            Axis::default()
                .bounds([-f64::from(window_s), 0.0])
                .labels([Line::raw(format!("-{window_s} s")), Line::raw("newest")]),
        )
        .y_axis(Axis::default().bounds([low, high]).labels([
            label(low),
            label(f64::midpoint(low, high)),
            label(high),
        ]));
    frame.render_widget(chart, below);
}

fn datasets(pieces: &Pieces, marker: Marker, style: Style) -> impl Iterator<Item = Dataset<'_>> {
    pieces.iter().map(move |piece| {
        Dataset::default()
            .marker(marker)
            .graph_type(GraphType::Line)
            .style(style)
            .data(piece)
    })
}

/// What the vertical axis shows: all values and a margin; `None` if there is no value.
fn range(lines: [&Pieces; 3]) -> Option<(f64, f64)> {
    let values = || lines.into_iter().flatten().flatten().map(|point| point.1);
    let low = values().fold(f64::INFINITY, f64::min);
    let high = values().fold(f64::NEG_INFINITY, f64::max);
    if low > high {
        return None;
    }
    let margin = match (high - low) * MARGIN {
        margin if margin > 0.0 && margin.is_finite() => margin,
        // All values are equal.
        _ => low.abs().mul_add(MARGIN, f64::MIN_POSITIVE).max(1e-9),
    };
    Some((low - margin, high + margin))
}
