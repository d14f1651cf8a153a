//! What one diagnoser said in a recording, and its charts.

use residual_chart::{Chart, Curve, Mark, Scale, Shade, Tint};
use residual_client::{AlarmState, AlarmTransition, StepRecord, Verdict, fault_names};
use residual_recording::header::Diagnoser;
use residual_recording::{Event, Reader};

use crate::error::Error;

/// What one diagnoser said.
pub struct History {
    diagnoser: Diagnoser,
    /// Where the time of all charts begins, nanoseconds of the daemon's time.
    start_ns: u64,
    records: Vec<StepRecord>,
    alarms: Vec<AlarmTransition>,
}

impl History {
    /// Reads what the named diagnosers said; all of them if none is named.
    pub fn read(reader: &mut Reader, names: &[String]) -> Result<Vec<Self>, Error> {
        let history = |diagnoser: &Diagnoser| Self {
            diagnoser: diagnoser.clone(),
            start_ns: 0,
            records: Vec::new(),
            alarms: Vec::new(),
        };
        let mut all: Vec<Self> = reader.header().diagnosers.iter().map(history).collect();
        let mut start_ns = u64::MAX;
        while let Some(event) = reader.next_event()? {
            match event {
                Event::Record(message) => {
                    start_ns = start_ns.min(message.record.instant_ns);
                    if let Some(history) = all.get_mut(message.slot) {
                        history.records.push(message.record);
                    }
                }
                Event::Alarm(transition) => {
                    if let Some(history) = all.get_mut(transition.slot as usize) {
                        history.alarms.push(transition);
                    }
                }
                Event::Sample(_) => {}
            }
        }
        all.retain(|history| names.is_empty() || names.contains(&history.diagnoser.name));
        for history in &mut all {
            history.start_ns = start_ns;
        }
        Ok(all)
    }

    /// The charts of the named channels, of all if none is named, with the names of their files.
    pub fn charts(&self, names: &[String]) -> Vec<(String, Chart)> {
        let (shades, marks) = (self.shades(), self.marks());
        let channels = self.diagnoser.channels.iter().enumerate();
        let wanted = channels.filter(|(_, channel)| names.is_empty() || names.contains(&channel.name));
        let charts = wanted.map(|(index, channel)| {
            let curve = |name: &str, part: fn(&residual_client::Channel) -> f64| Curve {
                name: name.into(),
                points: self.points(index, part),
            };
            let unit = if channel.unit.is_empty() {
                "1"
            } else {
                &channel.unit
            };
            let chart = Chart {
                title: format!("{}: {}", self.diagnoser.name, channel.name),
                x: "time from the start of the recording, s".into(),
                y: format!("residual between its bounds, {unit}"),
                curves: vec![curve("residual", |channel| channel.residual)],
                bounds: vec![
                    curve("lower bound", |channel| channel.lower),
                    curve("upper bound", |channel| channel.upper),
                ],
                shades: shades.clone(),
                marks: marks.clone(),
                scale: Scale::Linear,
            };
            let name = format!("{}.{}", self.diagnoser.name, channel.name);
            (name.replace(|c: char| c == '/' || c.is_whitespace(), "_"), chart)
        });
        charts.filter(|(_, chart)| chart.shows_anything()).collect()
    }

    /// Part of a channel against time; NaN where it was not evaluated.
    fn points(&self, index: usize, part: fn(&residual_client::Channel) -> f64) -> Vec<(f64, f64)> {
        let value = |record: &StepRecord| {
            let channel = record
                .channels()
                .get(index)
                .filter(|channel| channel.is_evaluated());
            channel.map_or(f64::NAN, part)
        };
        let records = self.records.iter();
        records
            .map(|record| (self.seconds(record.instant_ns), value(record)))
            .collect()
    }

    fn seconds(&self, instant_ns: u64) -> f64 {
        instant_ns.saturating_sub(self.start_ns) as f64 * 1e-9
    }

    /// What held from one record to the next: the alarm, as far as the recording has transitions of it, else the
    /// verdict.
    fn shades(&self) -> Vec<Shade> {
        let mut shades: Vec<Shade> = Vec::new();
        let mut alarms = self.alarms.iter().peekable();
        let mut alarm: Option<AlarmState> = None;
        let mut open: Option<&'static str> = None;
        for record in &self.records {
            while let Some(transition) = alarms.next_if(|next| next.instant_ns <= record.instant_ns) {
                alarm = Some(transition.state);
            }
            let from = self.seconds(record.instant_ns);
            if let Some(last) = shades.last_mut().filter(|_| open.is_some()) {
                last.to = from;
            }
            let now = state(alarm, record.verdict());
            if open != now.map(|(name, _)| name) {
                let to = from + self.diagnoser.period_ns as f64 * 1e-9;
                shades.extend(now.map(|(name, tint)| Shade {
                    name: name.into(),
                    tint,
                    from,
                    to,
                }));
            }
            open = now.map(|(name, _)| name);
        }
        shades
    }

    /// Where faults became certain.
    fn marks(&self) -> Vec<Mark> {
        let mut marks = Vec::new();
        let mut last = 0;
        for record in &self.records {
            let isolated = record.verdict() == Verdict::Isolated;
            let faults = if isolated { record.certainly_faulty } else { 0 };
            if faults != 0 && faults != last {
                let names: Vec<&str> = fault_names(&self.diagnoser.faults, faults).collect();
                marks.push(Mark {
                    x: self.seconds(record.instant_ns),
                    name: names.join(" + "),
                });
            }
            last = faults;
        }
        marks
    }
}

/// The name and the colour of what a record and its alarm say; none when all is well.
fn state(alarm: Option<AlarmState>, verdict: Verdict) -> Option<(&'static str, Tint)> {
    match (alarm, verdict) {
        (Some(AlarmState::Pending), _) => Some(("alarm pending", Tint::Orange)),
        (Some(AlarmState::Raised), _) => Some(("alarm raised", Tint::Red)),
        (Some(AlarmState::Isolated), _) => Some(("alarm isolated", Tint::Red)),
        (_, Verdict::GuaranteeLost) => Some(("guarantee lost", Tint::Violet)),
        (_, Verdict::NotEvaluated | Verdict::Starting) => Some(("not evaluated", Tint::Grey)),
        (None, Verdict::Fault) => Some(("fault", Tint::Orange)),
        (None, Verdict::Isolated) => Some(("isolated", Tint::Red)),
        (_, Verdict::Nominal | Verdict::Fault | Verdict::Isolated) => None,
    }
}
