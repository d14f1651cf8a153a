//! What a terminal would show, as text.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::buffer::Buffer;
use ratatui::style::{Color, Modifier};

use crate::watch::state::ViewState;
use crate::watch::view;

/// What a terminal of this size shows.
pub fn drawn(state: &ViewState, (width, height): (u16, u16)) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| view::draw(frame, state)).unwrap();
    terminal.backend().buffer().clone()
}

/// The characters; behind each line its styles, as runs of a column and what begins there.
pub fn text(buffer: &Buffer) -> String {
    let mut text = String::new();
    for row in buffer.area.rows() {
        let cells = || row.positions().map(|position| &buffer[position]);
        let symbols: String = cells().map(|cell| cell.symbol()).collect();
        text.push_str(&format!("|{symbols}|"));
        let mut before = (Color::Reset, Modifier::empty());
        for (column, cell) in cells().enumerate() {
            let style = (cell.fg, cell.modifier);
            if style != before {
                let modifier = if cell.modifier.is_empty() {
                    String::new()
                } else {
                    format!("+{:?}", cell.modifier)
                };
                text.push_str(&format!(" {column}:{:?}{modifier}", cell.fg));
                before = style;
            }
        }
        text.push('\n');
    }
    text
}
