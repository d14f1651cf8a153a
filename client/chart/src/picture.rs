//! The text of an SVG file, the bytes of a PNG file.

use plotters::prelude::*;

use crate::chart::Chart;
use crate::draw::draw;

/// Width and height, pixels.
const SIZE: (u32, u32) = (960, 600);

/// Why a chart cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("the chart `{title}` cannot be drawn: {reason}")]
pub struct ChartError {
    title: String,
    reason: String,
}

impl Chart {
    /// The chart as the text of an SVG file.
    ///
    /// # Errors
    /// [`ChartError`] if there is nothing to show.
    pub fn svg(&self) -> Result<String, ChartError> {
        self.check()?;
        let mut text = String::new();
        let area = SVGBackend::with_string(&mut text, SIZE).into_drawing_area();
        draw(self, &area).map_err(|reason| self.failed(reason))?;
        drop(area);
        Ok(text)
    }

    /// The chart as the bytes of a PNG file.
    ///
    /// # Errors
    /// [`ChartError`] if there is nothing to show.
    #[cfg(feature = "png")]
    pub fn png(&self) -> Result<Vec<u8>, ChartError> {
        self.check()?;
        let (width, height) = SIZE;
        let mut pixels = vec![0; width as usize * height as usize * 3];
        let area = BitMapBackend::with_buffer(&mut pixels, SIZE).into_drawing_area();
        draw(self, &area).map_err(|reason| self.failed(reason))?;
        drop(area);
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        let written = encoder
            .write_header()
            .and_then(|mut image| image.write_image_data(&pixels));
        written.map_err(|error| self.failed(error.to_string()))?;
        Ok(bytes)
    }

    fn check(&self) -> Result<(), ChartError> {
        if !self.shows_anything() {
            return Err(self.failed("no curve has two finite points".to_owned()));
        }
        #[cfg(feature = "png")]
        register_font().map_err(|()| self.failed("its font cannot be read".to_owned()))?;
        Ok(())
    }

    fn failed(&self, reason: String) -> ChartError {
        ChartError {
            title: self.title.clone(),
            reason,
        }
    }
}

/// Makes the font known with which texts are drawn, and measured in an SVG file as well.
#[cfg(feature = "png")]
fn register_font() -> Result<(), ()> {
    use std::sync::LazyLock;

    static SANS: &[u8] = include_bytes!("../font/sans.ttf");
    static REGISTERED: LazyLock<bool> =
        LazyLock::new(|| plotters::style::register_font(crate::draw::FONT, FontStyle::Normal, SANS).is_ok());
    REGISTERED.then_some(()).ok_or(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::{Curve, Mark, Scale, Shade, Tint};

    fn chart(points: Vec<(f64, f64)>) -> Chart {
        Chart {
            title: "a < b & c".to_owned(),
            x: "time, s".to_owned(),
            y: "width".to_owned(),
            curves: vec![Curve {
                name: "channel \"1\"".to_owned(),
                points,
            }],
            ..Chart::default()
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
    fn shades_and_marks_are_drawn_behind_and_named_once() {
        let shade = |from, to| Shade {
            name: "raised".into(),
            tint: Tint::Red,
            from,
            to,
        };
        let svg = Chart {
            shades: vec![shade(0.0, 1.0), shade(2.0, 900.0)],
            marks: vec![Mark {
                x: 1.5,
                name: "pump".into(),
            }],
            scale: Scale::Linear,
            ..chart(vec![(0.0, -1.0), (3.0, 1.0)])
        }
        .svg()
        .unwrap();
        assert_eq!(svg.matches("raised").count(), 1);
        assert!(svg.contains("pump"));
        assert!(svg.find("<rect").unwrap() < svg.find("<polyline").unwrap());
    }

    #[test]
    fn a_chart_without_two_finite_points_is_refused() {
        let empty = chart(vec![(0.0, 1.0), (1.0, f64::NAN)]);
        assert!(!empty.shows_anything());
        assert!(empty.svg().unwrap_err().to_string().contains("two finite points"));
    }

    #[cfg(feature = "png")]
    #[test]
    fn a_png_has_the_size_of_the_chart_and_its_curve_and_text_on_white() {
        let bytes = chart(vec![(0.0, 1.0), (1.0, 2.0)]).png().unwrap();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let frame = reader.next_frame(&mut pixels).unwrap();
        assert_eq!((frame.width, frame.height), SIZE);
        let (points, _) = pixels.as_chunks::<3>();
        let count = |wanted: &dyn Fn(&[u8; 3]) -> bool| points.iter().filter(|point| wanted(point)).count();
        assert!(count(&|point| *point == [255; 3]) > 400_000);
        let [red, green, blue] = [Palette99::pick(0).rgb()].map(|(r, g, b)| [r, g, b])[0];
        assert!(count(&|point| *point == [red, green, blue]) > 500, "the curve");
        // The title lies above the plot.
        let title = points
            .iter()
            .take(30 * SIZE.0 as usize)
            .filter(|point| point[0] < 128)
            .count();
        assert!(title > 100, "{title} dark pixels in the title");
    }
}
