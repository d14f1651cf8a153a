//! What was seen of a diagnoser's channels in the past, for plots.

use std::collections::VecDeque;

use crate::snapshot::DiagnoserView;

/// Longest time that is remembered, seconds.
pub const LONGEST_WINDOW_S: u32 = 1_800;

/// The channels of one diagnoser over the records that were seen, oldest first.
#[derive(Debug, Default)]
pub struct History {
    seen: VecDeque<Seen>,
}

/// One record that was seen.
#[derive(Debug)]
struct Seen {
    epoch: u64,
    record: u64,
    instant_ns: u64,
    /// Lower bound, residual and upper bound of each channel; NaN: not evaluated.
    channels: Box<[[f64; 3]]>,
}

/// Pieces without a gap: (seconds after the newest record, so at most 0; value in the channel's unit).
pub type Pieces = Vec<Vec<(f64, f64)>>;

impl History {
    /// Remembers the newest record, unless it is known or there is none; forgets what is too old or more than
    /// `capacity` records.
    pub fn remember(&mut self, epoch: u64, diagnoser: &DiagnoserView, capacity: usize) {
        let is_known = |last: &Seen| (last.epoch, last.record) == (epoch, diagnoser.record);
        if diagnoser.record == 0 || self.seen.back().is_some_and(is_known) {
            return;
        }
        // The daemon's time began anew.
        if self
            .seen
            .back()
            .is_some_and(|last| last.instant_ns > diagnoser.instant_ns)
        {
            self.seen.clear();
        }
        let values = diagnoser.channels.iter().map(|channel| {
            if channel.ratio.0.is_nan() {
                [f64::NAN; 3]
            } else {
                [channel.lower.0, channel.residual.0, channel.upper.0]
            }
        });
        self.seen.push_back(Seen {
            epoch,
            record: diagnoser.record,
            instant_ns: diagnoser.instant_ns,
            channels: values.collect(),
        });
        let oldest_ns = diagnoser
            .instant_ns
            .saturating_sub(u64::from(LONGEST_WINDOW_S) * 1_000_000_000);
        while self.seen.len() > capacity.max(1)
            || self
                .seen
                .front()
                .is_some_and(|first| first.instant_ns < oldest_ns)
        {
            self.seen.pop_front();
        }
    }

    /// Lower bound, residual and upper bound of a channel over the last `window_s` seconds.
    ///
    /// A line is broken where the channel was not evaluated, where the value is infinite, and where the daemon was
    /// started again.
    pub fn lines(&self, channel: usize, window_s: u32) -> [Pieces; 3] {
        let newest_ns = self.seen.back().map_or(0, |last| last.instant_ns);
        let oldest_ns = newest_ns.saturating_sub(u64::from(window_s) * 1_000_000_000);
        [0, 1, 2].map(|line| {
            let mut pieces: Pieces = Vec::new();
            let mut piece_of = None;
            for seen in self.seen.iter().filter(|seen| seen.instant_ns >= oldest_ns) {
                let value = seen.channels.get(channel).map_or(f64::NAN, |values| values[line]);
                if !value.is_finite() {
                    piece_of = None;
                    continue;
                }
                let point = ((newest_ns - seen.instant_ns) as f64 * -1e-9, value);
                match pieces.last_mut() {
                    Some(piece) if piece_of == Some(seen.epoch) => piece.push(point),
                    _ => pieces.push(vec![point]),
                }
                piece_of = Some(seen.epoch);
            }
            pieces
        })
    }
}
