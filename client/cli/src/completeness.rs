//! Whether a recording has everything that it should have.

use residual_recording::Reader;

/// Says on standard error what is missing in a recording that has been read to its end.
pub fn tell(reader: &Reader) {
    if reader.is_cut_off() {
        eprintln!("residual: the recording has no end: its recorder was killed");
    }
    if let Some(totals) = reader.totals().filter(|totals| !totals.is_complete()) {
        eprintln!(
            "residual: LOST on the way from the daemon to the recording: {} records, {} samples, {} alarm transitions",
            totals.lost_records, totals.lost_samples, totals.lost_alarms
        );
    }
}
