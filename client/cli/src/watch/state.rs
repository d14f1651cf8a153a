//! What the view shows: the newest look, what was seen before, and where the user is.

use std::collections::HashMap;

use ratatui::crossterm::event::{KeyCode, KeyEvent, KeyModifiers};
use residual_client::ReadError;

use super::alarm_log::AlarmLog;
use super::history::{History, LONGEST_WINDOW_S};
use crate::snapshot::{DiagnoserView, Snapshot};

/// Windows of the plot, seconds.
const WINDOWS_S: [u32; 9] = [5, 10, 20, 60, 120, 300, 600, 1_200, LONGEST_WINDOW_S];

/// Points of all channels of all diagnosers that are remembered for plots: at 24 bytes each, 24 MiB.
const POINTS: usize = 1 << 20;

/// Records of one diagnoser that are remembered at most: more than any plot has columns.
const RECORDS: usize = 8_192;

/// What fills the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Page {
    /// One row for each diagnoser and input.
    List,
    /// One diagnoser with its channels and a plot.
    Detail,
    /// The alarm transitions.
    Alarms,
}

/// What the view shows.
#[derive(Debug)]
pub struct ViewState {
    /// The newest look; `None` until a daemon has been there.
    pub snapshot: Option<Snapshot>,
    /// Why the newest look failed and an older one is shown.
    pub failure: Option<String>,
    /// What fills the screen.
    pub page: Page,
    /// Whether colours are shown.
    pub has_colour: bool,
    /// The alarm transitions that were heard.
    pub alarms: AlarmLog,
    /// Index of the selected diagnoser.
    pub selected: usize,
    /// Index of the selected channel.
    pub channel: usize,
    window: usize,
    histories: HashMap<String, History>,
}

impl ViewState {
    /// The view before the first look.
    pub fn new(has_colour: bool) -> Self {
        Self {
            snapshot: None,
            failure: None,
            page: Page::List,
            has_colour,
            alarms: AlarmLog::default(),
            selected: 0,
            channel: 0,
            window: 3,
            histories: HashMap::new(),
        }
    }

    /// Takes a new look; the selection stays with its diagnoser and channel, by their names.
    pub fn look(&mut self, snapshot: Option<Snapshot>) {
        self.failure = None;
        let Some(snapshot) = snapshot else {
            return;
        };
        let diagnosers = &snapshot.diagnosers;
        let channels: usize = diagnosers.iter().map(|diagnoser| diagnoser.channels.len()).sum();
        let capacity = (POINTS / channels.max(1)).min(RECORDS);
        self.histories
            .retain(|name, _| diagnosers.iter().any(|diagnoser| diagnoser.name == *name));
        for diagnoser in diagnosers {
            let history = self.histories.entry(diagnoser.name.clone()).or_default();
            history.remember(snapshot.epoch, diagnoser, capacity);
        }
        if let Some(before) = self.diagnoser() {
            let is_same = |diagnoser: &DiagnoserView| diagnoser.name == before.name;
            let selected = diagnosers.iter().position(is_same);
            let channel = selected.and_then(|selected| {
                let name = &before.channels.get(self.channel)?.name;
                let channels = &diagnosers.get(selected)?.channels;
                channels.iter().position(|channel| channel.name == *name)
            });
            let last = diagnosers.len().saturating_sub(1);
            (self.selected, self.channel) =
                (selected.unwrap_or(self.selected.min(last)), channel.unwrap_or(0));
        }
        self.snapshot = Some(snapshot);
        if self.diagnoser().is_none() {
            self.selected = 0;
            if self.page == Page::Detail {
                self.page = Page::List;
            }
        }
    }

    /// Keeps the look before, and says why.
    pub fn failed_look(&mut self, error: &ReadError) {
        self.failure = Some(error.to_string());
    }

    /// The selected diagnoser.
    pub fn diagnoser(&self) -> Option<&DiagnoserView> {
        self.snapshot.as_ref()?.diagnosers.get(self.selected)
    }

    /// What was seen of the selected diagnoser.
    pub fn history(&self) -> Option<&History> {
        self.histories.get(&self.diagnoser()?.name)
    }

    /// Window of the plot, seconds.
    pub fn window_s(&self) -> u32 {
        WINDOWS_S.get(self.window).copied().unwrap_or(LONGEST_WINDOW_S)
    }

    /// Obeys a key; tells whether it ends the view.
    pub fn press(&mut self, key: KeyEvent) -> bool {
        if !key.is_press() && !key.is_repeat() {
            return false;
        }
        let is_control = key.modifiers.contains(KeyModifiers::CONTROL);
        match (key.code, self.page) {
            (KeyCode::Char('c'), _) if is_control => return true,
            (KeyCode::Char('q'), _) | (KeyCode::Esc, Page::List) => return true,
            (KeyCode::Esc | KeyCode::Backspace, _) => self.page = Page::List,
            (KeyCode::Enter, Page::List) if self.diagnoser().is_some() => {
                (self.page, self.channel) = (Page::Detail, self.worst_channel());
            }
            (KeyCode::Char('a'), Page::Alarms) => self.page = Page::List,
            (KeyCode::Char('a'), _) => self.page = Page::Alarms,
            (code, Page::List) => self.move_in_list(code),
            (code, Page::Detail) => self.move_in_detail(code),
            (code, Page::Alarms) => {
                let above = moved(self.alarms.above(), self.alarms.count(), code);
                self.alarms.scroll_to(above);
            }
        }
        false
    }

    /// Index of the channel with the largest ratio, where a look at a diagnoser begins.
    fn worst_channel(&self) -> usize {
        let index = self.diagnoser().and_then(|diagnoser| {
            let worst = diagnoser.worst_channel.as_ref()?;
            let mut channels = diagnoser.channels.iter();
            channels.position(|channel| channel.name == worst.name)
        });
        index.unwrap_or(0)
    }

    fn move_in_list(&mut self, code: KeyCode) {
        let count = self
            .snapshot
            .as_ref()
            .map_or(0, |snapshot| snapshot.diagnosers.len());
        self.selected = moved(self.selected, count, code);
    }

    fn move_in_detail(&mut self, code: KeyCode) {
        let channels = self.diagnoser().map_or(0, |diagnoser| diagnoser.channels.len());
        match code {
            KeyCode::Tab => self.channel = (self.channel + 1) % channels.max(1),
            KeyCode::BackTab => self.channel = (self.channel + channels.max(1) - 1) % channels.max(1),
            KeyCode::Char('+' | '=') => self.window = (self.window + 1).min(WINDOWS_S.len() - 1),
            KeyCode::Char('-') => self.window = self.window.saturating_sub(1),
            KeyCode::Left | KeyCode::Char('h') => self.turn_to(KeyCode::Up),
            KeyCode::Right | KeyCode::Char('l') => self.turn_to(KeyCode::Down),
            code => self.channel = moved(self.channel, channels, code),
        }
    }

    /// Shows the diagnoser above or below.
    fn turn_to(&mut self, code: KeyCode) {
        let before = self.selected;
        self.move_in_list(code);
        if self.selected != before {
            self.channel = self.worst_channel();
        }
    }
}

/// Where a key leads in a list of `count` rows.
fn moved(index: usize, count: usize, code: KeyCode) -> usize {
    let last = count.saturating_sub(1);
    match code {
        KeyCode::Up | KeyCode::Char('k') => index.saturating_sub(1),
        KeyCode::Down | KeyCode::Char('j') => (index + 1).min(last),
        KeyCode::PageUp => index.saturating_sub(10),
        KeyCode::PageDown => (index + 10).min(last),
        KeyCode::Home => 0,
        KeyCode::End => last,
        _ => index,
    }
}
