//! What a chart shows.

/// Points of a curve that are drawn at most; of more, the lowest and the highest of each stretch are kept.
const MOST_POINTS: usize = 4000;

/// Points joined by a line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// Points (x, y), by growing x. The line is broken where y is not finite.
    pub points: Vec<(f64, f64)>,
}

/// A stretch of the horizontal axis that is shaded from bottom to top.
#[derive(Clone, Debug, PartialEq)]
pub struct Shade {
    /// Its name; in the legend once for all shades of one name.
    pub name: String,
    /// Its colour.
    pub tint: Tint,
    /// Where it begins.
    pub from: f64,
    /// Where it ends.
    pub to: f64,
}

/// Colour of a shade.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tint {
    /// Something is wrong.
    Red,
    /// Something may be wrong.
    Orange,
    /// Nothing can be said any more.
    Violet,
    /// Nothing was said.
    Grey,
}

/// A moment with a name, drawn as a vertical line.
#[derive(Clone, Debug, PartialEq)]
pub struct Mark {
    /// Where it stands.
    pub x: f64,
    /// Its name, beside the line.
    pub name: String,
}

/// Scale of both axes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Logarithmic where the values span decades.
    #[default]
    ByValues,
    /// Linear.
    Linear,
}

/// A chart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Chart {
    /// Above it.
    pub title: String,
    /// Quantity and unit of the horizontal axis.
    pub x: String,
    /// Quantity and unit of the vertical axis.
    pub y: String,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Curves between which the others should lie, drawn thin and grey.
    pub bounds: Vec<Curve>,
    /// Shaded stretches, behind the curves.
    pub shades: Vec<Shade>,
    /// Moments.
    pub marks: Vec<Mark>,
    /// Scale of the axes.
    pub scale: Scale,
}

impl Chart {
    /// Whether there is a curve with two finite points.
    pub fn shows_anything(&self) -> bool {
        self.curves.iter().any(|curve| curve.finite().count() > 1)
    }

    /// All finite points.
    pub(crate) fn points(&self) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
        self.curves.iter().chain(&self.bounds).flat_map(Curve::finite)
    }
}

impl Curve {
    fn finite(&self) -> impl Iterator<Item = (f64, f64)> + Clone + '_ {
        self.points
            .iter()
            .copied()
            .filter(|(x, y)| x.is_finite() && y.is_finite())
    }

    /// The pieces of the line, thinned out if there are many points.
    pub(crate) fn pieces(&self) -> impl Iterator<Item = Vec<(f64, f64)>> + '_ {
        let stretch = (2 * self.points.len()).div_ceil(MOST_POINTS);
        self.points
            .split(|(x, y)| !(x.is_finite() && y.is_finite()))
            .filter(|piece| !piece.is_empty())
            .map(move |piece| thinned(piece, stretch))
    }
}

/// The lowest and the highest point of each stretch of `stretch` points; all points if that is at most 2.
fn thinned(points: &[(f64, f64)], stretch: usize) -> Vec<(f64, f64)> {
    if stretch <= 2 {
        return points.to_vec();
    }
    let extremes = points.chunks(stretch).flat_map(|chunk| {
        let by_y = |left: &&(f64, f64), right: &&(f64, f64)| left.1.total_cmp(&right.1);
        let (low, high) = (chunk.iter().min_by(by_y), chunk.iter().max_by(by_y));
        let mut both = [low, high];
        both.sort_by(|left, right| left.map_or(0.0, |p| p.0).total_cmp(&right.map_or(0.0, |p| p.0)));
        both.into_iter().flatten().copied()
    });
    extremes.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_curve_is_thinned_out_and_keeps_its_peaks() {
        let mut points: Vec<_> = (0..1_000_000).map(|k| (f64::from(k), 0.0)).collect();
        points[123_456].1 = 7.0;
        points[654_321].1 = -7.0;
        let curve = Curve {
            name: String::new(),
            points,
        };
        let pieces: Vec<_> = curve.pieces().collect();
        assert!(pieces.len() == 1 && pieces[0].len() <= MOST_POINTS);
        assert!(pieces[0].contains(&(123_456.0, 7.0)) && pieces[0].contains(&(654_321.0, -7.0)));
        assert!(pieces[0].is_sorted_by(|left, right| left.0 <= right.0));
    }

    #[test]
    fn a_line_is_broken_where_there_is_no_value() {
        let curve = Curve {
            name: String::new(),
            points: vec![
                (0.0, 1.0),
                (1.0, 2.0),
                (2.0, f64::NAN),
                (3.0, f64::INFINITY),
                (4.0, 3.0),
            ],
        };
        let pieces: Vec<_> = curve.pieces().collect();
        assert_eq!(pieces, [vec![(0.0, 1.0), (1.0, 2.0)], vec![(4.0, 3.0)]]);
    }
}
