//! Publishing and reading allocate nothing.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
#![allow(unsafe_code)] // The counting allocator.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use residual_client::{
    AlarmListener, AlarmStart, ChannelSpec, DaemonTime, Freshness, Instance, Monitor, ScheduleCounters,
    SlotSpec, StepRecord, TableSpec, Verdict, monotonic_ns,
};
use residual_shared::bounds_table::{Access, TableWriter};

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: hands every request on to the system's allocator as it is.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.with(|count| count.set(count.get() + 1));
        // SAFETY: the caller's promise is the one that the system's allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

fn allocations(action: impl FnOnce()) -> u64 {
    let before = ALLOCATIONS.with(Cell::get);
    action();
    ALLOCATIONS.with(Cell::get) - before
}

#[test]
fn publishing_and_reading_allocate_nothing() {
    assert!(
        allocations(|| drop(std::hint::black_box(Box::new(1)))) > 0,
        "the allocator does not count"
    );
    let directory = tempfile::tempdir_in("/dev/shm").unwrap();
    let instance = Instance::new("test".parse().unwrap(), directory.path());
    let channel = ChannelSpec {
        name: "r".into(),
        unit: "m".into(),
    };
    let slot = SlotSpec {
        name: "a".into(),
        method: "chi_square".into(),
        period_ns: 10_000_000_000,
        phase_ns: 0,
        margin_ns: 0,
        channels: vec![channel; 30],
        faults: vec![],
    };
    let spec = TableSpec {
        instance: "test".into(),
        slots: vec![slot],
        inputs: vec![],
        time: DaemonTime::MONOTONIC,
        schedule_epoch_ns: 0,
        stale_after_periods: 3,
        alarm_capacity: 64,
    };
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let mut writer = TableWriter::create(&instance.bounds_path(), &spec, &access).unwrap();
    let mut monitor = Monitor::open(&instance).unwrap();
    let followed = monitor.follow("a").unwrap();
    let mut listener = AlarmListener::open(&instance, AlarmStart::Now).unwrap();
    let mut record = StepRecord::new(30);
    record.verdict = Verdict::Nominal as u32;
    let mut back = StepRecord::new(0);
    let count = allocations(|| {
        for step in 0..1_000 {
            let now_ns = monotonic_ns();
            record.step = step;
            record.instant_ns = now_ns;
            writer.heartbeat(now_ns);
            writer.publish(0, &record);
            writer.publish_schedule_counters(0, &ScheduleCounters::default());
            let reading = monitor.read_followed(followed, &mut back).unwrap();
            assert_eq!((reading.freshness, back.step), (Freshness::Fresh, step));
            monitor.read("a", &mut back).unwrap();
            assert_eq!(listener.try_next(), None);
        }
    });
    assert_eq!(count, 0);
}
