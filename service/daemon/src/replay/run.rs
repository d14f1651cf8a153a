//! One run of a recording, with the time of the recording and that of the replay.

/// Rows of one run, in time order.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// What the run column says; empty without one.
    pub name: String,
    /// Position among the runs of the file, from 0.
    pub position: usize,
    /// What the kind column says; empty without one.
    pub kind: String,
    /// When the first row with a labelled fault was recorded, nanoseconds since the first row.
    pub labelled_onset_ns: Option<u64>,
    /// When each row was recorded, nanoseconds since the first row.
    pub recorded_ns: Vec<u64>,
    /// When each row is replayed, nanoseconds since the first row: as recorded, or one row a period.
    pub times_ns: Vec<u64>,
    /// Cells by row; NaN where the cell is empty.
    pub rows: Vec<Vec<f64>>,
}

impl Run {
    /// Time from the first to the last row as recorded, nanoseconds.
    pub fn duration_ns(&self) -> u64 {
        self.recorded_ns.last().copied().unwrap_or(0)
    }

    /// The recorded time of a moment of the replay: that of the last row before it, and what has passed since.
    pub fn recorded_at_ns(&self, replayed_ns: u64) -> u64 {
        let rows = self.times_ns.partition_point(|&time| time <= replayed_ns);
        let row = rows.saturating_sub(1);
        let (time, recorded) = (self.times_ns.get(row), self.recorded_ns.get(row));
        recorded.copied().unwrap_or(0) + (replayed_ns - time.copied().unwrap_or(0).min(replayed_ns))
    }
}
