//! Rows in columns, as many as there is room for.

use ratatui::text::{Line, Span};

use super::theme::Theme;

/// Least widths of the first two columns of rank 0 where they must give way: names, then states.
const LEAST: [usize; 2] = [10, 8];

/// One column.
#[derive(Clone, Copy, Debug)]
pub struct Column {
    /// Its heading.
    pub title: &'static str,
    /// Its least width.
    pub width: usize,
    /// Whether its cells end at its right edge.
    pub is_right: bool,
    /// The larger, the sooner it is left out for want of room; columns of rank 0 stay.
    pub rank: u8,
}

impl Column {
    /// A column of words.
    pub const fn left(title: &'static str, width: usize, rank: u8) -> Self {
        Self {
            title,
            width,
            is_right: false,
            rank,
        }
    }

    /// A column of numbers.
    pub const fn right(title: &'static str, width: usize, rank: u8) -> Self {
        Self {
            is_right: true,
            ..Self::left(title, width, rank)
        }
    }
}

/// The headings and the rows in a width; each row has a cell for each column.
pub fn lines(
    columns: &[Column],
    rows: &[Vec<Span<'static>>],
    width: u16,
    theme: Theme,
) -> (Line<'static>, Vec<Line<'static>>) {
    let widths = widths(columns, rows, usize::from(width));
    let heading = columns
        .iter()
        .map(|column| Span::styled(column.title, theme.bold()))
        .collect::<Vec<_>>();
    let lines = rows.iter().map(|row| line(columns, row, &widths)).collect();
    (line(columns, &heading, &widths), lines)
}

/// The width of each column; `None`: left out.
fn widths(columns: &[Column], rows: &[Vec<Span>], width: usize) -> Vec<Option<usize>> {
    let wanted = |index: usize, column: &Column| {
        let cells = rows.iter().filter_map(|row| row.get(index)).map(Span::width);
        cells
            .chain([column.width, Span::raw(column.title).width()])
            .max()
            .unwrap_or(0)
    };
    let mut widths: Vec<_> = columns
        .iter()
        .enumerate()
        .map(|(index, column)| Some(wanted(index, column)))
        .collect();
    let total = |widths: &[Option<usize>]| {
        let kept = widths.iter().flatten();
        kept.map(|width| width + 1).sum::<usize>().saturating_sub(1)
    };
    // The least important columns go first.
    while total(&widths) > width {
        let kept = columns
            .iter()
            .zip(&widths)
            .enumerate()
            .filter(|(_, (_, width))| width.is_some());
        let least = kept
            .max_by_key(|(_, (column, _))| column.rank)
            .map(|(index, (column, _))| (index, column.rank));
        match least {
            Some((index, 1..)) => {
                if let Some(width) = widths.get_mut(index) {
                    *width = None;
                }
            }
            _ => break,
        }
    }
    // Then those that stay give way.
    let staying = columns.iter().enumerate().filter(|(_, column)| column.rank == 0);
    for ((index, _), least) in staying.zip(LEAST) {
        let excess = total(&widths).saturating_sub(width);
        if let Some(Some(width)) = widths.get_mut(index) {
            *width = width.saturating_sub(excess).max(least.min(*width));
        }
    }
    widths
}

fn line(columns: &[Column], cells: &[Span<'static>], widths: &[Option<usize>]) -> Line<'static> {
    let mut line = Line::default();
    for ((column, cell), width) in columns.iter().zip(cells).zip(widths) {
        let Some(width) = *width else { continue };
        if !line.spans.is_empty() {
            line.push_span(Span::raw(" "));
        }
        let text = cut(&cell.content, width);
        let blank = " ".repeat(width.saturating_sub(Span::raw(text.as_str()).width()));
        let (before, behind) = if column.is_right {
            (blank, String::new())
        } else {
            (String::new(), blank)
        };
        line.push_span(Span::styled(format!("{before}{text}{behind}"), cell.style));
    }
    line
}

/// The text, or its beginning and `…`.
pub fn cut(text: &str, width: usize) -> String {
    if Span::raw(text).width() <= width {
        return text.into();
    }
    let mut kept: String = text.into();
    while Span::raw(kept.as_str()).width() + 1 > width && kept.pop().is_some() {}
    if width > 0 {
        kept.push('…');
    }
    kept
}

/// Index of the first row that is shown when `count` rows have `room` and `selected` must be seen.
pub fn first_row(selected: usize, count: usize, room: usize) -> usize {
    selected.saturating_sub(room / 2).min(count.saturating_sub(room))
}
