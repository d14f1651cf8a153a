//! Colours, or none.

use ratatui::style::{Color, Modifier, Style};

/// How things look.
#[derive(Clone, Copy, Debug)]
pub struct Theme {
    has_colour: bool,
}

/// What a colour means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Near the bound, or not judged.
    Warn,
    /// Beyond the bound, or a fault.
    Bad,
    /// No daemon.
    Dead,
    /// Of second importance.
    Quiet,
    /// The residual in a plot.
    Residual,
}

impl Theme {
    /// The look with or without colours.
    pub fn new(has_colour: bool) -> Self {
        Self { has_colour }
    }

    /// Whether there are colours.
    pub fn has_colour(self) -> bool {
        self.has_colour
    }

    /// The style of a meaning; without colours, what is bad is bold and what matters less is dim.
    pub fn style(self, tone: Tone) -> Style {
        let style = match tone {
            Tone::Bad => self.bold(),
            Tone::Quiet => Style::new().add_modifier(Modifier::DIM),
            _ => Style::new(),
        };
        let colour = match tone {
            Tone::Good => Color::Green,
            Tone::Warn => Color::Yellow,
            Tone::Bad => Color::Red,
            Tone::Dead => Color::Magenta,
            Tone::Residual => Color::Cyan,
            Tone::Quiet => return style,
        };
        if self.has_colour { style.fg(colour) } else { style }
    }

    /// Headings.
    pub fn bold(self) -> Style {
        Style::new().add_modifier(Modifier::BOLD)
    }

    /// The selected row.
    pub fn selected(self) -> Style {
        Style::new().add_modifier(Modifier::REVERSED)
    }
}
