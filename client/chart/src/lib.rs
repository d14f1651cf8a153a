//! Line charts with a legend, as SVG and (feature `png`) as PNG.
//!
//! | module | what |
//! |---|---|
//! | [`Chart`] | what a chart shows |
//! | `axis` | which range and which scale an axis has |
//! | `draw` | drawing on either kind of picture |
//! | `picture` | the text of an SVG file, the bytes of a PNG file |

mod axis;
mod chart;
mod draw;
mod picture;

pub use chart::{Chart, Curve, Mark, Scale, Shade, Tint};
pub use picture::ChartError;
