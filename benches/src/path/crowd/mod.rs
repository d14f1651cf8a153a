//! Up to 64 processes that all do the same while they are told to, and sleep otherwise.

use std::collections::BTreeMap;
use std::sync::atomic::Ordering;
use std::thread::sleep;
use std::time::Duration;

use anyhow::Result;
use hdrhistogram::Histogram;
use rustix::thread::futex::{self, Flags};
use serde::{Deserialize, Serialize};

use super::stage::Stage;
use crate::percentiles::{Counts, add, times};
use crate::process::Process;
use crate::shared_words::SharedWords;

pub mod member;

/// The shared word, a futex, that tells who does what.
const PHASE: usize = 0;

/// Words that a stage with a crowd needs.
pub const WORDS: usize = 8;

/// The phase in which all members end.
const END: u32 = u32::MAX;

/// Reads of one batch, between two looks at the clock.
pub const BATCH: u32 = 16;

/// Time for members to leave a phase.
const SETTLING: Duration = Duration::from_millis(3);

/// What the members that are active do.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum Activity {
    /// Look at the clock twice.
    LookAtTheClock,
    /// Read records of the bounds table, slot after slot.
    ReadTable,
    /// The same through the client library, with the freshness.
    ReadMonitor,
    /// Read the entry of the blackboard.
    ReadBlackboard,
    /// Sleep until there is an alarm, again and again.
    HearAlarms,
}

const ACTIVITIES: [Activity; 5] = [
    Activity::LookAtTheClock,
    Activity::ReadTable,
    Activity::ReadMonitor,
    Activity::ReadBlackboard,
    Activity::HearAlarms,
];

/// What a member measured in all phases with the same activity and as many active members.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Report {
    activity: Activity,
    active: u8,
    single: Counts,
    batches: Counts,
}

/// Times of all members, nanoseconds.
#[derive(Clone, Debug)]
pub struct Times {
    /// Of single reads, each with one look at the clock.
    pub single: Histogram<u64>,
    /// Of [`BATCH`] reads in a row, with one look at the clock.
    pub batches: Histogram<u64>,
}

/// A started crowd.
pub struct Crowd {
    members: Vec<Process>,
    words: SharedWords,
    phases: u32,
}

impl Crowd {
    /// Starts the members on a stage that has a bounds table; on `core` only, if one is given.
    ///
    /// # Errors
    /// They cannot be started.
    pub fn start(stage: &Stage, size: u8, core: Option<usize>, has_blackboard: bool) -> Result<Self> {
        let mut members = Vec::new();
        for index in 0..size {
            let mut more = vec!["--index".to_owned(), index.to_string()];
            if let Some(core) = core {
                more.extend(["--core".to_owned(), core.to_string()]);
            }
            if has_blackboard {
                more.push("--blackboard".into());
            }
            members.push(stage.start("member", false, &more)?);
        }
        for member in &mut members {
            member.line()?;
        }
        Ok(Self {
            members,
            words: stage.words()?,
            phases: 0,
        })
    }

    /// While the first `active` members do their part, does `work`.
    ///
    /// # Errors
    /// Those of `work`.
    pub fn during<T>(
        &mut self,
        activity: Activity,
        active: u8,
        work: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        self.tell(activity, active);
        sleep(SETTLING);
        let outcome = work();
        self.tell(activity, 0);
        sleep(SETTLING);
        outcome
    }

    /// Ends all members; what they measured, by activity and number of active members.
    ///
    /// # Errors
    /// A member failed.
    pub fn finish(mut self) -> Result<BTreeMap<(Activity, u8), Times>> {
        self.set(END);
        let mut all: BTreeMap<_, Times> = BTreeMap::new();
        for member in &mut self.members {
            for report in member.said::<Vec<Report>>()? {
                let times = all
                    .entry((report.activity, report.active))
                    .or_insert_with(Times::new);
                add(&mut times.single, &report.single);
                add(&mut times.batches, &report.batches);
            }
        }
        self.members.into_iter().try_for_each(Process::end)?;
        Ok(all)
    }

    fn tell(&mut self, activity: Activity, active: u8) {
        self.phases = (self.phases + 1) % 0xffff;
        let activity = ACTIVITIES.iter().position(|other| *other == activity);
        self.set(self.phases << 16 | u32::from(active) << 8 | activity.unwrap_or_default() as u32);
    }

    fn set(&self, phase: u32) {
        let futex = self.words.half(PHASE);
        futex.store(phase, Ordering::Release);
        // It fails for wrong addresses only.
        let _ = futex::wake(futex, Flags::empty(), i32::MAX.cast_unsigned());
    }
}

impl Times {
    fn new() -> Self {
        Self {
            single: times(),
            batches: times(),
        }
    }
}
