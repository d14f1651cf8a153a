//! Waiting for alarms from C.

use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::time::Duration;

use residual::{Alarm, AlarmEvent, AlarmListener, AlarmNumber, AlarmStart, AlarmState, alarm_flags};

use crate::monitor::{given, instance, residual_daemon_state};
use crate::status::{Failure, guarded, residual_status};
use crate::text::residual_text;

/// Value of `channel` for none.
pub const RESIDUAL_NONE: u32 = u32::MAX;

const _: () = assert!(RESIDUAL_NONE == residual::NONE);

/// The alarm stays until it is acknowledged.
pub const RESIDUAL_ALARM_FLAG_LATCHED: u32 = 1;
/// An acknowledgement caused or preceded the transition.
pub const RESIDUAL_ALARM_FLAG_ACKNOWLEDGED: u32 = 2;
/// A reset of the diagnoser caused the transition.
pub const RESIDUAL_ALARM_FLAG_RESET: u32 = 4;
/// The diagnoser was removed from the configuration, or replaced by another one of its name.
pub const RESIDUAL_ALARM_FLAG_WITHDRAWN: u32 = 8;

const _: () = assert!(
    RESIDUAL_ALARM_FLAG_LATCHED == alarm_flags::LATCHED
        && RESIDUAL_ALARM_FLAG_ACKNOWLEDGED == alarm_flags::ACKNOWLEDGED
        && RESIDUAL_ALARM_FLAG_RESET == alarm_flags::RESET
        && RESIDUAL_ALARM_FLAG_WITHDRAWN == alarm_flags::WITHDRAWN
);

/// Start of a listener: with the next transition that the daemon writes.
pub const RESIDUAL_ALARM_START_NOW: u32 = 0;
/// Start of a listener: with the oldest transition that the daemon still keeps.
pub const RESIDUAL_ALARM_START_OLDEST: u32 = 1;
/// Start of a listener: behind a known transition.
pub const RESIDUAL_ALARM_START_AFTER: u32 = 2;

/// Hears every alarm transition of one instance once, over all lives of its daemon.
pub struct residual_alarm_listener {
    listener: AlarmListener,
    /// The transition that was handed out last.
    last: Option<Alarm>,
}

/// The name of a transition for ever: its number and the life of the daemon that wrote it.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_alarm_number {
    /// Number of the life of the daemon.
    pub epoch: u64,
    /// Number of the transition, 1 for the first.
    pub number: u64,
}

/// Where the alarm of one diagnoser stands.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum residual_alarm_state {
    /// No fault.
    Cleared = 0,
    /// Violations, but not yet often enough.
    Pending = 1,
    /// A fault.
    Raised = 2,
    /// A fault of known components.
    Isolated = 3,
}

const _: () = assert!(
    residual_alarm_state::Cleared as u32 == AlarmState::Cleared as u32
        && residual_alarm_state::Pending as u32 == AlarmState::Pending as u32
        && residual_alarm_state::Raised as u32 == AlarmState::Raised as u32
        && residual_alarm_state::Isolated as u32 == AlarmState::Isolated as u32
);

/// What a listener hears.
#[repr(C)]
#[derive(Clone, Copy)]
pub enum residual_alarm_event_kind {
    /// The next transition.
    Transition = 0,
    /// The transitions `first` to `last` are lost; each missing number lies in exactly one gap.
    Gap = 1,
    /// The numbers have begun anew, with the life `origin`; what was missed behind `previous` nobody knows.
    NewNumbering = 2,
}

/// One change in the life of a fault.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_alarm_transition {
    /// Number and epoch.
    pub number: residual_alarm_number,
    /// CLOCK_MONOTONIC when it was written, nanoseconds.
    pub written_ns: u64,
    /// The sampling instant that caused it, nanoseconds of the daemon's time.
    pub instant_ns: u64,
    /// Number of that sampling instant.
    pub step: u64,
    /// The new state, a residual_alarm_state.
    pub state: u32,
    /// Bits RESIDUAL_ALARM_FLAG_….
    pub flags: u32,
    /// residual_verdict of the step.
    pub verdict: u32,
    /// The channel with the largest ratio; RESIDUAL_NONE if none was evaluated.
    pub channel: u32,
    /// How often the alarm of this diagnoser has been raised, this time included.
    pub occurrence: u64,
    /// Faults that are certainly present: bit j is fault j.
    pub certainly_faulty: u64,
    /// Faults that may be present.
    pub possibly_faulty: u64,
    /// Ratio of the channel; NaN for none.
    pub ratio: f64,
    /// Estimate of the isolated fault; NaN for none.
    pub fault_estimate: f64,
    /// Half width or standard deviation of the estimate; NaN for none.
    pub fault_estimate_half_width: f64,
}

/// What a listener hears; what does not belong to its kind is zero.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_alarm_event {
    /// What it is.
    pub kind: residual_alarm_event_kind,
    /// Of a gap: the first missing number.
    pub first: u64,
    /// Of a gap: the last missing number.
    pub last: u64,
    /// Of a new numbering: the last known transition of the old one.
    pub previous: residual_alarm_number,
    /// Of a new numbering: the life with which it began.
    pub origin: u64,
    /// Of a transition: the transition.
    pub transition: residual_alarm_transition,
    /// Of a transition: name of the diagnoser; empty if the daemon has it no more.
    pub diagnoser: residual_text,
    /// Of a transition: name of the channel; empty if there is none.
    pub channel: residual_text,
}

const NO_NUMBER: residual_alarm_number = residual_alarm_number { epoch: 0, number: 0 };

impl From<AlarmNumber> for residual_alarm_number {
    fn from(AlarmNumber { epoch, number }: AlarmNumber) -> Self {
        Self { epoch, number }
    }
}

impl From<&Alarm> for residual_alarm_transition {
    fn from(alarm: &Alarm) -> Self {
        let transition = &alarm.transition;
        Self {
            number: transition.number.into(),
            written_ns: transition.written_ns,
            instant_ns: transition.instant_ns,
            step: transition.step,
            state: transition.state as u32,
            flags: transition.flags,
            verdict: transition.verdict,
            channel: transition.channel,
            occurrence: transition.occurrence,
            certainly_faulty: transition.certainly_faulty,
            possibly_faulty: transition.possibly_faulty,
            ratio: transition.ratio,
            fault_estimate: transition.fault_estimate,
            fault_estimate_half_width: transition.fault_estimate_half_width,
        }
    }
}

impl residual_alarm_event {
    /// An event of this kind with nothing in it.
    fn empty(kind: residual_alarm_event_kind) -> Self {
        Self {
            kind,
            first: 0,
            last: 0,
            previous: NO_NUMBER,
            origin: 0,
            transition: residual_alarm_transition {
                number: NO_NUMBER,
                written_ns: 0,
                instant_ns: 0,
                step: 0,
                state: 0,
                flags: 0,
                verdict: 0,
                channel: 0,
                occurrence: 0,
                certainly_faulty: 0,
                possibly_faulty: 0,
                ratio: 0.0,
                fault_estimate: 0.0,
                fault_estimate_half_width: 0.0,
            },
            diagnoser: residual_text::new(""),
            channel: residual_text::new(""),
        }
    }
}

impl From<&AlarmEvent> for residual_alarm_event {
    fn from(event: &AlarmEvent) -> Self {
        match event {
            AlarmEvent::Transition(alarm) => Self {
                transition: alarm.into(),
                diagnoser: residual_text::new(alarm.diagnoser_name().unwrap_or_default()),
                channel: residual_text::new(alarm.channel().map_or("", |channel| &channel.name)),
                ..Self::empty(residual_alarm_event_kind::Transition)
            },
            AlarmEvent::Gap { first, last } => Self {
                first: *first,
                last: *last,
                ..Self::empty(residual_alarm_event_kind::Gap)
            },
            AlarmEvent::NewNumbering { previous, origin } => Self {
                previous: (*previous).into(),
                origin: *origin,
                ..Self::empty(residual_alarm_event_kind::NewNumbering)
            },
        }
    }
}

/// Listens to the alarms of an instance, whose daemon need not have been started.
///
/// `runtime_directory` may be NULL: the directory that RESIDUALD_RUNTIME_DIRECTORY names, or /dev/shm. `start`: one of
/// RESIDUAL_ALARM_START_…; `after` belongs to RESIDUAL_ALARM_START_AFTER and is not looked at otherwise.
///
/// # Safety
/// The texts end with a zero byte.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn residual_alarm_listener_open(
    instance: *const c_char,
    runtime_directory: *const c_char,
    start: u32,
    after: residual_alarm_number,
    listener: Option<&mut MaybeUninit<*mut residual_alarm_listener>>,
) -> residual_status {
    guarded(|| {
        let place = given(listener, "listener")?;
        // SAFETY: the caller's promise.
        let instance = unsafe { self::instance(instance, runtime_directory) }?;
        let start = match start {
            RESIDUAL_ALARM_START_NOW => AlarmStart::Now,
            RESIDUAL_ALARM_START_OLDEST => AlarmStart::Oldest,
            RESIDUAL_ALARM_START_AFTER => AlarmStart::After(AlarmNumber {
                epoch: after.epoch,
                number: after.number,
            }),
            other => return Err(Failure::Start(other)),
        };
        let listener = residual_alarm_listener {
            listener: AlarmListener::connect(&instance, start),
            last: None,
        };
        place.write(Box::into_raw(Box::new(listener)));
        Ok(residual_status::Ok)
    })
}

/// Closes a listener; NULL is allowed.
#[unsafe(no_mangle)]
pub extern "C" fn residual_alarm_listener_close(listener: Option<Box<residual_alarm_listener>>) {
    guarded(|| {
        drop(listener);
        Ok(residual_status::Ok)
    });
}

/// Waits for the next event: looks without pause for `spin_ns`, which takes a whole processor but sees an event within
/// a microsecond, then sleeps until one comes; at most for `timeout_ns` altogether. With the timeout 0 it never waits.
///
/// RESIDUAL_STATUS_NOTHING: none came in time, and `event` is as it was.
#[unsafe(no_mangle)]
pub extern "C" fn residual_alarm_listener_next(
    listener: Option<&mut residual_alarm_listener>,
    spin_ns: u64,
    timeout_ns: u64,
    event: Option<&mut MaybeUninit<residual_alarm_event>>,
) -> residual_status {
    guarded(|| {
        let listener = given(listener, "listener")?;
        let place = given(event, "event")?;
        let (spin, timeout) = (Duration::from_nanos(spin_ns), Duration::from_nanos(timeout_ns));
        let Some(event) = listener.listener.wait_spin_then_sleep(spin, timeout) else {
            return Ok(residual_status::Nothing);
        };
        place.write((&event).into());
        listener.last = match event {
            AlarmEvent::Transition(alarm) => Some(alarm),
            AlarmEvent::Gap { .. } | AlarmEvent::NewNumbering { .. } => None,
        };
        Ok(residual_status::Ok)
    })
}

/// Name of a fault (a bit of its fault sets) of the transition that this listener handed out last.
#[unsafe(no_mangle)]
pub extern "C" fn residual_alarm_listener_fault(
    listener: Option<&mut residual_alarm_listener>,
    fault: usize,
    name: Option<&mut MaybeUninit<residual_text>>,
) -> residual_status {
    guarded(|| {
        let last = given(listener, "listener")?.last.as_ref();
        let faults = last
            .and_then(|alarm| alarm.diagnoser.as_ref())
            .map(|diagnoser| &*diagnoser.faults);
        let faults = faults.unwrap_or_default();
        let text = faults.get(fault).ok_or(Failure::NoSuch {
            what: "fault",
            index: fault,
            count: faults.len(),
        })?;
        given(name, "name")?.write(residual_text::new(text));
        Ok(residual_status::Ok)
    })
}

/// The last transition that was handed out or reported missing: what RESIDUAL_ALARM_START_AFTER takes to go on from
/// here. RESIDUAL_STATUS_NOTHING: no table has been found yet.
#[unsafe(no_mangle)]
pub extern "C" fn residual_alarm_listener_position(
    listener: Option<&mut residual_alarm_listener>,
    position: Option<&mut MaybeUninit<residual_alarm_number>>,
) -> residual_status {
    guarded(|| {
        let Some(known) = given(listener, "listener")?.listener.position() else {
            return Ok(residual_status::Nothing);
        };
        given(position, "position")?.write(known.into());
        Ok(residual_status::Ok)
    })
}

/// Whether the daemon lives, as far as this listener has looked.
#[unsafe(no_mangle)]
pub extern "C" fn residual_alarm_listener_daemon(
    listener: Option<&mut residual_alarm_listener>,
    state: Option<&mut MaybeUninit<residual_daemon_state>>,
) -> residual_status {
    guarded(|| {
        let listener = given(listener, "listener")?;
        given(state, "state")?.write(listener.listener.state().into());
        Ok(residual_status::Ok)
    })
}
