//! One member: does what the phase says, and says what it measured at the end.

use std::collections::BTreeMap;
use std::hint::black_box;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use iceoryx2::port::reader::EntryHandle;
use iceoryx2::prelude::ipc;
use residual_client::{AlarmListener, AlarmStart, Followed, Monitor};
use residual_shared::bounds_table::TableReader;
use residual_shared::clock::monotonic_ns;
use residual_shared::record::StepRecord;
use rustix::thread::futex::{self, Flags, Timespec};

use super::{ACTIVITIES, Activity, BATCH, END, PHASE, Report, Times};
use crate::path::read::blackboard;
use crate::path::stage::Part;
use crate::percentiles::counts;
use crate::process::{asked_to_end, say};
use crate::processor::pin;

/// Single reads between two batches.
const SINGLE_READS: u32 = 8;

/// Longest sleep before a member looks whether it shall end.
const NAP: Duration = Duration::from_millis(20);

/// What it is told.
#[derive(Clone, Debug, clap::Args)]
pub struct Options {
    #[command(flatten)]
    part: Part,
    /// Its place in the crowd.
    #[arg(long)]
    index: u8,
    /// The only core it runs on.
    #[arg(long)]
    core: Option<usize>,
    /// There is a blackboard.
    #[arg(long)]
    blackboard: bool,
}

/// What it reads.
struct Sources {
    table: TableReader,
    monitor: Monitor,
    followed: Followed,
    blackboard: Option<EntryHandle<ipc::Service, u64, blackboard::Value>>,
    listener: AlarmListener,
    record: StepRecord,
    slot: usize,
}

/// Takes part until the phase says that it is over.
///
/// # Errors
/// There is no table, or no blackboard where there should be one.
pub fn play(options: &Options) -> Result<()> {
    let end = asked_to_end();
    if let Some(core) = options.core {
        pin(core)?;
    }
    let instance = options.part.instance()?;
    let table = TableReader::open(&instance.bounds_path())?;
    let first = table.directory().spec.slots.first().context("no slot")?;
    let mut monitor = Monitor::open(&instance)?;
    let attached = options
        .blackboard
        .then(|| blackboard::attach(&instance))
        .transpose()?;
    let (ports, entry) = attached.map_or((None, None), |(ports, entry)| (Some(ports), Some(entry)));
    let mut sources = Sources {
        followed: monitor.follow(&first.name)?,
        monitor,
        blackboard: entry,
        listener: AlarmListener::open(&instance, AlarmStart::Now)?,
        record: StepRecord::new(0),
        slot: 0,
        table,
    };
    let words = options.part.words()?;
    let phase = words.half(PHASE);
    say(&"ready")?;
    let reports = take_part(&mut sources, options.index, phase, &end)?;
    drop((sources, ports));
    say(&reports)
}

fn take_part(sources: &mut Sources, index: u8, phase: &AtomicU32, end: &AtomicBool) -> Result<Vec<Report>> {
    let mut measured: BTreeMap<(Activity, u8), Times> = BTreeMap::new();
    loop {
        let now = phase.load(Ordering::Acquire);
        if now == END || end.load(Ordering::Relaxed) {
            break;
        }
        let (active, activity) = ((now >> 8) as u8, (now & 0xff) as usize);
        if index >= active {
            wait(phase, now);
            continue;
        }
        let activity = *ACTIVITIES.get(activity).context("no such activity")?;
        let times = measured.entry((activity, active)).or_insert_with(Times::new);
        let is_over = || phase.load(Ordering::Relaxed) != now || end.load(Ordering::Relaxed);
        match activity {
            Activity::LookAtTheClock => measure(times, is_over, || Ok(())),
            Activity::ReadTable => measure(times, is_over, || sources.read_table()),
            Activity::ReadMonitor => measure(times, is_over, || sources.read_monitor()),
            Activity::ReadBlackboard => measure(times, is_over, || sources.read_blackboard()),
            Activity::HearAlarms => {
                while !is_over() {
                    black_box(sources.listener.wait(NAP));
                }
                Ok(())
            }
        }?;
    }
    let reports = measured.into_iter().map(|((activity, active), times)| Report {
        activity,
        active,
        single: counts(&times.single),
        batches: counts(&times.batches),
    });
    Ok(reports.collect())
}

fn measure(
    times: &mut Times,
    is_over: impl Fn() -> bool,
    mut read: impl FnMut() -> Result<()>,
) -> Result<()> {
    while !is_over() {
        for _ in 0..SINGLE_READS {
            let begin = monotonic_ns();
            read()?;
            times.single.saturating_record(monotonic_ns() - begin);
        }
        let begin = monotonic_ns();
        for _ in 0..BATCH {
            read()?;
        }
        times.batches.saturating_record(monotonic_ns() - begin);
    }
    Ok(())
}

impl Sources {
    #[inline]
    fn read_table(&mut self) -> Result<()> {
        let slots = self.table.directory().spec.slots.len();
        self.slot = if self.slot + 1 < slots { self.slot + 1 } else { 0 };
        self.table.read(self.slot, &mut self.record)?;
        black_box(&self.record);
        Ok(())
    }

    #[inline]
    fn read_monitor(&mut self) -> Result<()> {
        black_box(self.monitor.read_followed(self.followed, &mut self.record)?);
        black_box(&self.record);
        Ok(())
    }

    #[inline]
    fn read_blackboard(&mut self) -> Result<()> {
        let entry = self.blackboard.as_ref().ok_or_else(|| anyhow!("no blackboard"))?;
        black_box(*entry.get());
        Ok(())
    }
}

fn wait(phase: &AtomicU32, known: u32) {
    let nap = Timespec {
        tv_sec: 0,
        tv_nsec: i64::from(NAP.subsec_nanos()),
    };
    // Woken or not: the caller looks again.
    let _ = futex::wait(phase, Flags::empty(), known, Some(&nap));
}
