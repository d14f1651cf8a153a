//! Plots of a design, for people: one SVG file each.
//!
//! | file | shows |
//! |---|---|
//! | `NAME.frequency.svg` | singular values of the transfer matrices from disturbance and fault to residual |
//! | `NAME.bounds.svg` | width of each channel's bounds from the start on |
//! | `NAME.detection.svg` | smallest constant fault that is detected within a time |

mod bounds;
mod detection;
mod frequency;

use residual_chart::{Chart, ChartError};
use residual_diagnosis::method::Designed;
use residual_diagnosis::response::Response;
use std::path::{Path, PathBuf};

/// Why plots cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// A chart that cannot be drawn.
    #[error("{0}")]
    Draw(#[from] ChartError),
    /// A file or directory that cannot be written.
    #[error("{path} cannot be written: {reason}; choose another directory")]
    Write {
        /// Which.
        path: PathBuf,
        /// Why.
        reason: std::io::Error,
    },
}

/// Draws all that there is to show of one diagnoser into `directory` and returns the files.
///
/// # Errors
/// [`PlotError`]: a chart cannot be drawn or a file cannot be written.
pub fn write(
    directory: &Path,
    name: &str,
    sample_time_s: f64,
    designed: &Designed,
    responses: &[Response],
) -> Result<Vec<PathBuf>, PlotError> {
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |reason| PlotError::Write { path, reason }
    };
    std::fs::create_dir_all(directory).map_err(failed(directory))?;
    let charts = [
        ("frequency", frequency::chart(name, responses)),
        ("bounds", bounds::chart(name, sample_time_s, designed)),
        (
            "detection",
            detection::chart(name, sample_time_s, &designed.achieved),
        ),
    ];
    let mut files = Vec::new();
    for (kind, chart) in charts {
        if let Some(chart) = chart.filter(Chart::shows_anything) {
            let path = directory.join(format!("{name}.{kind}.svg"));
            std::fs::write(&path, chart.svg()?).map_err(failed(&path))?;
            files.push(path);
        }
    }
    Ok(files)
}
