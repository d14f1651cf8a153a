//! The ratio: distance to alarm, 1 at the bound.

use ratatui::style::Style;

use super::theme::{Theme, Tone};

/// Cells of a bar and the heading above it, from 0 to the bound.
pub fn scale(screen_width: u16) -> (usize, &'static str) {
    if screen_width < 100 {
        (8, "0       1")
    } else {
        (20, "0                   1")
    }
}

const EIGHTHS: [&str; 8] = ["", "▏", "▎", "▍", "▌", "▋", "▊", "▉"];

/// A bar of `width` cells that is full at the bound, and a mark behind it: `│` is the bound, `▶` stands for a ratio
/// beyond it. Empty if there is no ratio.
pub fn bar(ratio: f64, width: usize) -> String {
    if ratio.is_nan() {
        return String::new();
    }
    if ratio > 1.0 {
        return format!("{}▶", "█".repeat(width));
    }
    let eighths = (ratio.clamp(0.0, 1.0) * (width * 8) as f64).floor() as usize;
    let part = EIGHTHS.get(eighths % 8).copied().unwrap_or_default();
    let bar = format!("{}{part}", "█".repeat(eighths / 8));
    format!("{bar:·<width$}│")
}

/// The ratio in at most 6 characters.
pub fn text(ratio: f64) -> String {
    if ratio.is_nan() {
        "-".into()
    } else if ratio.is_infinite() || ratio.abs() < 999.995 {
        format!("{ratio:.2}")
    } else {
        format!("{ratio:.0e}")
    }
}

/// Green, yellow from 0.7 on, red beyond the bound.
pub fn style(ratio: f64, theme: Theme) -> Style {
    theme.style(match ratio {
        ratio if ratio > 1.0 => Tone::Bad,
        ratio if ratio > 0.7 => Tone::Warn,
        ratio if ratio.is_nan() => Tone::Quiet,
        _ => Tone::Good,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_bar_is_full_at_the_bound_marked_beyond_it_and_missing_without_a_ratio() {
        let bars = [0.0, 0.5, 0.54, 1.0, 1.0 + 1e-9, f64::INFINITY, f64::NAN].map(|ratio| bar(ratio, 4));
        assert_eq!(bars, ["····│", "██··│", "██▏·│", "████│", "████▶", "████▶", ""]);
    }

    #[test]
    fn ratios_stay_short() {
        let ratios = [0.254, 999.99, 1_000.0, 1e300, f64::INFINITY, f64::NAN];
        assert_eq!(ratios.map(text), ["0.25", "999.99", "1e3", "1e300", "inf", "-"]);
        assert!(ratios.map(text).iter().all(|text| text.len() <= 6));
    }
}
