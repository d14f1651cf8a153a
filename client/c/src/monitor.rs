//! Polling bounds from C.

use std::ffi::{OsStr, c_char};
use std::mem::MaybeUninit;

use residual::{DaemonState, Followed, Instance, Monitor, SlotSpec, StepRecord};

use crate::record::{residual_reading, residual_record};
use crate::status::{Failure, guarded, residual_status, text};
use crate::text::residual_text;

/// A client's view of one instance, over all lives of its daemon.
pub struct residual_monitor {
    monitor: Monitor,
    followed: Vec<Followed>,
    record: StepRecord,
}

/// Whether there is a daemon.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum residual_daemon_state {
    /// It lives.
    Running = 0,
    /// It gives no sign of life: stopped, killed, or kept from running.
    Hung = 1,
    /// It has ended in good order, or before the machine's last boot.
    Closed = 2,
    /// Its table cannot be opened.
    Unreachable = 3,
}

impl From<DaemonState<'_>> for residual_daemon_state {
    fn from(state: DaemonState<'_>) -> Self {
        match state {
            DaemonState::Running => Self::Running,
            DaemonState::Hung(_) => Self::Hung,
            DaemonState::Closed => Self::Closed,
            DaemonState::Unreachable(_) | DaemonState::Unknown => Self::Unreachable,
        }
    }
}

/// A diagnoser of the daemon's latest life.
#[repr(C)]
pub struct residual_diagnoser {
    /// Its name.
    pub name: residual_text,
    /// Its method.
    pub method: residual_text,
    /// Its period, nanoseconds.
    pub period_ns: u64,
    /// Sampling instants lie at epoch + phase + k · period, nanoseconds.
    pub phase_ns: u64,
    /// The step for an instant is due this much later, nanoseconds.
    pub margin_ns: u64,
    /// Number of its channels.
    pub channel_count: usize,
    /// Number of its faults.
    pub fault_count: usize,
}

/// Name and unit of a channel.
#[repr(C)]
pub struct residual_channel_name {
    /// Its name.
    pub name: residual_text,
    /// Its unit; empty for a number without unit.
    pub unit: residual_text,
}

/// The instance that the caller names.
///
/// # Safety
/// As for [`text`]; `directory` may be NULL: the one that the environment names, or the default.
pub(crate) unsafe fn instance(name: *const c_char, directory: *const c_char) -> Result<Instance, Failure> {
    // SAFETY: the caller's promise.
    let name = unsafe { text(name, "instance") }?.parse()?;
    if directory.is_null() {
        return Ok(Instance::from_environment(name));
    }
    // SAFETY: the caller's promise.
    let directory = unsafe { text(directory, "runtime_directory") }?;
    Ok(Instance::new(name, OsStr::new(directory)))
}

/// The value behind a pointer of the caller, or an error for NULL.
pub(crate) fn given<T>(value: Option<T>, name: &'static str) -> Result<T, Failure> {
    value.ok_or(Failure::Null(name))
}

/// Opens the bounds table of an instance.
///
/// `runtime_directory` may be NULL: the directory that RESIDUALD_RUNTIME_DIRECTORY names, or /dev/shm. Fails if no
/// daemon has run yet (RESIDUAL_STATUS_NO_DAEMON) or the table cannot be read. A daemon that has ended is no error.
///
/// # Safety
/// The texts end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn residual_monitor_open(
    instance: *const c_char,
    runtime_directory: *const c_char,
    monitor: Option<&mut MaybeUninit<*mut residual_monitor>>,
) -> residual_status {
    guarded(|| {
        let place = given(monitor, "monitor")?;
        // SAFETY: the caller's promise.
        let instance = unsafe { self::instance(instance, runtime_directory) }?;
        place.write(new(Monitor::open(&instance)?));
        Ok(residual_status::Ok)
    })
}

/// As residual_monitor_open(), but the daemon need not have been started: until it is, every diagnoser reads as dead.
///
/// # Safety
/// The texts end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn residual_monitor_connect(
    instance: *const c_char,
    runtime_directory: *const c_char,
    monitor: Option<&mut MaybeUninit<*mut residual_monitor>>,
) -> residual_status {
    guarded(|| {
        let place = given(monitor, "monitor")?;
        // SAFETY: the caller's promise.
        let instance = unsafe { self::instance(instance, runtime_directory) }?;
        place.write(new(Monitor::connect(&instance)));
        Ok(residual_status::Ok)
    })
}

fn new(monitor: Monitor) -> *mut residual_monitor {
    Box::into_raw(Box::new(residual_monitor {
        monitor,
        followed: Vec::new(),
        record: StepRecord::new(0),
    }))
}

/// Closes a monitor; NULL is allowed.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_close(monitor: Option<Box<residual_monitor>>) {
    guarded(|| {
        drop(monitor);
        Ok(residual_status::Ok)
    });
}

/// Whether the daemon lives, and the number of its latest known life (0: none). `epoch` may be NULL.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_daemon(
    monitor: Option<&mut residual_monitor>,
    state: Option<&mut MaybeUninit<residual_daemon_state>>,
    epoch: Option<&mut MaybeUninit<u64>>,
) -> residual_status {
    guarded(|| {
        let monitor = given(monitor, "monitor")?;
        given(state, "state")?.write(monitor.monitor.state().into());
        if let Some(epoch) = epoch {
            let table = monitor.monitor.table();
            epoch.write(table.map_or(0, |table| table.directory().epoch));
        }
        Ok(residual_status::Ok)
    })
}

/// The diagnosers of the latest known life of the daemon.
fn slots(monitor: Option<&mut residual_monitor>) -> Result<&[SlotSpec], Failure> {
    let table = given(monitor, "monitor")?.monitor.table();
    Ok(&table.ok_or(Failure::NoTable)?.directory().spec.slots)
}

fn at<'a, T>(list: &'a [T], index: usize, what: &'static str) -> Result<&'a T, Failure> {
    let count = list.len();
    list.get(index).ok_or(Failure::NoSuch { what, index, count })
}

/// The number of diagnosers. It and their order may change with a new epoch.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_diagnoser_count(
    monitor: Option<&mut residual_monitor>,
    count: Option<&mut MaybeUninit<usize>>,
) -> residual_status {
    guarded(|| {
        given(count, "count")?.write(slots(monitor)?.len());
        Ok(residual_status::Ok)
    })
}

/// Describes the diagnoser with this index.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_diagnoser(
    monitor: Option<&mut residual_monitor>,
    index: usize,
    diagnoser: Option<&mut MaybeUninit<residual_diagnoser>>,
) -> residual_status {
    guarded(|| {
        let slot = at(slots(monitor)?, index, "diagnoser")?;
        given(diagnoser, "diagnoser")?.write(residual_diagnoser {
            name: residual_text::new(&slot.name),
            method: residual_text::new(&slot.method),
            period_ns: slot.period_ns,
            phase_ns: slot.phase_ns,
            margin_ns: slot.margin_ns,
            channel_count: slot.channels.len(),
            fault_count: slot.faults.len(),
        });
        Ok(residual_status::Ok)
    })
}

/// Name and unit of a channel of the diagnoser with this index.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_channel(
    monitor: Option<&mut residual_monitor>,
    index: usize,
    channel: usize,
    name: Option<&mut MaybeUninit<residual_channel_name>>,
) -> residual_status {
    guarded(|| {
        let slot = at(slots(monitor)?, index, "diagnoser")?;
        let channel = at(&slot.channels, channel, "channel")?;
        given(name, "name")?.write(residual_channel_name {
            name: residual_text::new(&channel.name),
            unit: residual_text::new(&channel.unit),
        });
        Ok(residual_status::Ok)
    })
}

/// Name of a fault of the diagnoser with this index; bit j of a fault set is fault j.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_fault(
    monitor: Option<&mut residual_monitor>,
    index: usize,
    fault: usize,
    name: Option<&mut MaybeUninit<residual_text>>,
) -> residual_status {
    guarded(|| {
        let slot = at(slots(monitor)?, index, "diagnoser")?;
        given(name, "name")?.write(residual_text::new(at(&slot.faults, fault, "fault")?));
        Ok(residual_status::Ok)
    })
}

/// A handle that finds the diagnoser of this name in this and every later life of the daemon.
///
/// # Safety
/// `name` ends with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn residual_monitor_follow(
    monitor: Option<&mut residual_monitor>,
    name: *const c_char,
    followed: Option<&mut MaybeUninit<usize>>,
) -> residual_status {
    guarded(|| {
        let monitor = given(monitor, "monitor")?;
        let place = given(followed, "followed")?;
        // SAFETY: the caller's promise.
        let name = unsafe { text(name, "name") }?;
        let followed = monitor.monitor.follow(name)?;
        place.write(monitor.followed.len());
        monitor.followed.push(followed);
        Ok(residual_status::Ok)
    })
}

/// Reads the newest record of a followed diagnoser. No allocation; while the daemon lives, no system call.
///
/// Without a record (`number` of the reading is 0) the record is empty. `record` may be NULL.
#[unsafe(no_mangle)]
pub extern "C" fn residual_monitor_read(
    monitor: Option<&mut residual_monitor>,
    followed: usize,
    reading: Option<&mut MaybeUninit<residual_reading>>,
    record: Option<&mut MaybeUninit<residual_record>>,
) -> residual_status {
    guarded(|| {
        let residual_monitor {
            monitor,
            followed: handles,
            record: newest,
        } = given(monitor, "monitor")?;
        let handle = *at(handles, followed, "followed diagnoser")?;
        let found = monitor.read_followed(handle, newest)?;
        if found.number == 0 {
            *newest = StepRecord::new(0);
        }
        given(reading, "reading")?.write(found.into());
        if let Some(record) = record {
            record.write((&*newest).into());
        }
        Ok(residual_status::Ok)
    })
}
