//! A line chart with a legend, as SVG.

use plotters::coord::ranged1d::{AsRangedCoord, ValueFormatter};
use plotters::prelude::*;
use std::ops::Range;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 600);
/// Beyond this ratio of largest to smallest value an axis is logarithmic.
const LOGARITHMIC: f64 = 50.0;
/// A logarithmic axis shows at most this many decades below the largest value.
const DECADES: i32 = 12;

/// Why a chart cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the chart `{title}` cannot be drawn: {reason}")]
pub struct ChartError {
    title: String,
    reason: String,
}

/// Points joined by a line.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// Points (x, y), by growing x.
    pub points: Vec<(f64, f64)>,
}

/// A chart.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// Quantity and unit of the horizontal axis.
    pub x: String,
    /// Quantity and unit of the vertical axis.
    pub y: String,
    /// The curves.
    pub curves: Vec<Curve>,
}

impl Chart {
    /// Whether there is a curve with two finite points.
    pub fn shows_anything(&self) -> bool {
        self.curves.iter().any(|curve| finite(curve).count() > 1)
    }

    /// The chart as the text of an SVG file.
    ///
    /// # Errors
    /// [`ChartError`] if there is nothing to show.
    pub fn svg(&self) -> Result<String, ChartError> {
        let failed = |reason: String| ChartError {
            title: self.title.clone(),
            reason,
        };
        if !self.shows_anything() {
            return Err(failed("no curve has two finite points".to_owned()));
        }
        let points = || self.curves.iter().flat_map(finite);
        let (x, y) = (
            Axis::of(points().map(|point| point.0)),
            Axis::of(points().map(|point| point.1)),
        );
        let mut text = String::new();
        {
            let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
            let drawn = match (x.logarithmic, y.logarithmic) {
                (false, false) => self.draw(&area, x.range, y.range),
                (true, false) => self.draw(&area, x.range.log_scale(), y.range),
                (false, true) => self.draw(&area, x.range, y.range.log_scale()),
                (true, true) => self.draw(&area, x.range.log_scale(), y.range.log_scale()),
            };
            drawn.map_err(failed)?;
        }
        Ok(text)
    }

    fn draw<X, Y, XR, YR>(
        &self,
        area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
        x: XR,
        y: YR,
    ) -> Result<(), String>
    where
        XR: AsRangedCoord<CoordDescType = X, Value = f64>,
        YR: AsRangedCoord<CoordDescType = Y, Value = f64>,
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let text = |error: DrawingAreaErrorKind<_>| format!("{error:?}");
        area.fill(&WHITE).map_err(text)?;
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 20))
            .margin(12)
            .x_label_area_size(44)
            .y_label_area_size(72)
            .build_cartesian_2d(x, y)
            .map_err(text)?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .x_label_formatter(&number)
            .y_label_formatter(&number)
            .light_line_style(BLACK.mix(0.04))
            .draw()
            .map_err(text)?;
        for (index, curve) in self.curves.iter().enumerate() {
            let colour = Palette99::pick(index).to_rgba();
            chart
                .draw_series(LineSeries::new(finite(curve), colour.stroke_width(2)))
                .map_err(text)?
                .label(&curve.name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperRight)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.3))
            .draw()
            .map_err(text)?;
        area.present().map_err(text)
    }
}

fn finite(curve: &Curve) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
    curve
        .points
        .iter()
        .copied()
        .filter(|(x, y)| x.is_finite() && y.is_finite())
}

/// A label of an axis.
fn number(value: &f64) -> String {
    let size = value.abs();
    if *value == 0.0 || (1e-3..1e5).contains(&size) {
        let text = format!("{value:.4}");
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        format!("{value:.1e}")
    }
}

/// What an axis shows.
struct Axis {
    range: Range<f64>,
    logarithmic: bool,
}

impl Axis {
    /// The axis of these values: logarithmic if they are positive, or nearly all zero, and span decades.
    fn of(values: impl Iterator<Item = f64> + Clone) -> Self {
        let largest = values.clone().fold(f64::NEG_INFINITY, f64::max);
        let smallest = values.clone().fold(f64::INFINITY, f64::min);
        let least_shown = largest * 10f64.powi(-DECADES);
        let positive = values
            .filter(|value| *value > least_shown)
            .fold(f64::INFINITY, f64::min);
        if smallest >= 0.0 && largest > LOGARITHMIC * positive {
            return Self {
                range: positive / 1.2..largest * 1.2,
                logarithmic: true,
            };
        }
        let room = match largest - smallest {
            0.0 => largest.abs().max(1.0) * 0.1,
            span => span * 0.05,
        };
        let low = if smallest >= 0.0 { 0.0 } else { smallest - room };
        Self {
            range: low..largest + room,
            logarithmic: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        Chart {
            title: "a < b & c".to_owned(),
            x: "time, s".to_owned(),
            y: "width".to_owned(),
            curves: vec![Curve {
                name: "channel \"1\"".to_owned(),
                points,
            }],
        }
    }

    #[test]
    fn the_text_is_an_svg_with_title_axes_and_legend_and_nothing_unescaped() {
        let svg = chart(vec![(0.0, 1.0), (1.0, 2.0), (2.0, f64::INFINITY)])
            .svg()
            .unwrap();
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"));
        for part in ["a &lt; b &amp; c", "time, s", "width", "polyline"] {
            assert!(svg.contains(part), "{part}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf\""), "{svg}");
    }

    #[test]
    fn values_over_decades_make_a_logarithmic_axis_that_ignores_zeros() {
        let axis = Axis::of([0.0, 1e-3, 10.0].into_iter());
        assert!(axis.logarithmic && axis.range.start > 1e-4);
        let axis = Axis::of([0.0, 1.0, 10.0].into_iter());
        assert!(!axis.logarithmic && axis.range.start == 0.0);
    }

    #[test]
    fn a_chart_without_two_finite_points_is_refused() {
        let empty = chart(vec![(0.0, 1.0), (1.0, f64::NAN)]);
        assert!(!empty.shows_anything());
        assert!(empty.svg().unwrap_err().to_string().contains("two finite points"));
    }
}
