//! All results as one Markdown file with charts: findings first, raw numbers after.

mod markdown;

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use residual_chart::{Chart, Curve};

use crate::results::Results;

pub use markdown::of_one;

/// Writes `REPORT.md` and the directory `charts` into `directory`.
///
/// # Errors
/// A file cannot be written, or a chart cannot be drawn.
pub fn write(all: &[Results], failures: &[(String, String)], directory: &Path) -> Result<()> {
    let charts = directory.join("charts");
    fs::create_dir_all(&charts).with_context(|| format!("{} cannot be made", charts.display()))?;
    for chart in all.iter().flat_map(|results| &results.charts) {
        let drawn = Chart {
            title: chart.title.clone(),
            x: chart.x.clone(),
            y: chart.y.clone(),
            curves: (chart.curves.iter())
                .map(|(name, points)| Curve {
                    name: name.clone(),
                    points: points.clone(),
                })
                .collect(),
            ..Chart::default()
        };
        let path = charts.join(format!("{}.svg", chart.file));
        fs::write(&path, drawn.svg()?).with_context(|| format!("{} cannot be written", path.display()))?;
    }
    let path = directory.join("REPORT.md");
    fs::write(&path, markdown::text(all, failures))
        .with_context(|| format!("{} cannot be written", path.display()))
}
