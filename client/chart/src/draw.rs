//! Drawing on either kind of picture.

use std::collections::BTreeSet;
use std::ops::Range;

use plotters::coord::Shift;
use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;

use crate::axis::{Axis, number};
use crate::chart::{Chart, Tint};

/// The family of all texts.
pub(crate) const FONT: &str = "sans-serif";

impl Tint {
    fn colour(self) -> RGBAColor {
        match self {
            Self::Red => RED.mix(0.16),
            Self::Orange => RGBColor(255, 150, 0).mix(0.18),
            Self::Violet => RGBColor(140, 0, 200).mix(0.14),
            Self::Grey => BLACK.mix(0.1),
        }
    }
}

/// Draws a chart that shows something.
pub(crate) fn draw<B: DrawingBackend>(chart: &Chart, area: &DrawingArea<B, Shift>) -> Result<(), String> {
    let x = Axis::of(chart.points().map(|point| point.0), chart.scale);
    let y = Axis::of(chart.points().map(|point| point.1), chart.scale);
    let ranges = [x.range.clone(), y.range.clone()];
    match (x.logarithmic, y.logarithmic) {
        (false, false) => draw_on(chart, area, x.range, y.range, &ranges),
        (true, false) => draw_on(chart, area, x.range.log_scale(), y.range, &ranges),
        (false, true) => draw_on(chart, area, x.range, y.range.log_scale(), &ranges),
        (true, true) => draw_on(chart, area, x.range.log_scale(), y.range.log_scale(), &ranges),
    }
}

fn draw_on<B, X, Y, XR, YR>(
    chart: &Chart,
    area: &DrawingArea<B, Shift>,
    x: XR,
    y: YR,
    [x_range, y_range]: &[Range<f64>; 2],
) -> Result<(), String>
where
    B: DrawingBackend,
    XR: AsRangedCoord<CoordDescType = X, Value = f64>,
    YR: AsRangedCoord<CoordDescType = Y, Value = f64>,
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
    Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let text = |error: DrawingAreaErrorKind<_>| format!("{error:?}");
    area.fill(&WHITE).map_err(text)?;
    let mut context = ChartBuilder::on(area)
        .caption(&chart.title, (FONT, 20))
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(72)
        .build_cartesian_2d(x, y)
        .map_err(text)?;
    let mut named = BTreeSet::new();
    for shade in &chart.shades {
        let colour = shade.tint.colour().filled();
        let corners = [
            (shade.from.max(x_range.start), y_range.start),
            (shade.to.min(x_range.end), y_range.end),
        ];
        let drawn = context
            .draw_series([Rectangle::new(corners, colour)])
            .map_err(text)?;
        if named.insert(&shade.name) {
            let swatch = move |(x, y)| Rectangle::new([(x, y - 5), (x + 18, y + 5)], colour);
            drawn.label(&shade.name).legend(swatch);
        }
    }
    context
        .configure_mesh()
        .x_desc(&chart.x)
        .y_desc(&chart.y)
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .label_style((FONT, 12))
        .light_line_style(BLACK.mix(0.04))
        .draw()
        .map_err(text)?;
    for mark in &chart.marks {
        let line = [(mark.x, y_range.start), (mark.x, y_range.end)];
        let style = BLACK.mix(0.6).stroke_width(1);
        context
            .draw_series([PathElement::new(line, style)])
            .map_err(text)?;
        let name = Text::new(format!(" {}", mark.name), (mark.x, y_range.end), (FONT, 12));
        context.draw_series([name]).map_err(text)?;
    }
    let bounds = chart.bounds.iter().map(|curve| (curve, BLACK.mix(0.55), 1));
    let curves = chart.curves.iter().enumerate();
    let curves = curves.map(|(index, curve)| (curve, Palette99::pick(index).to_rgba(), 2));
    for (curve, colour, width) in bounds.chain(curves) {
        let style = colour.stroke_width(width);
        for (index, piece) in curve.pieces().enumerate() {
            let drawn = context.draw_series(LineSeries::new(piece, style)).map_err(text)?;
            if index == 0 {
                let line = move |(x, y)| PathElement::new([(x, y), (x + 18, y)], style);
                drawn.label(&curve.name).legend(line);
            }
        }
    }
    context
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .label_font((FONT, 12))
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.3))
        .draw()
        .map_err(text)?;
    area.present().map_err(text)
}
