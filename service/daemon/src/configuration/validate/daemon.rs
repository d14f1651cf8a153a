//! `[daemon]` and `[realtime]`.

use super::check_range;
use crate::configuration::locate::Mistakes;
use crate::configuration::schema::{Daemon, Group, Realtime};
use crate::configuration::{DaemonSection, RealtimeSection};
use crate::logging;
use nix::unistd;
use residual_shared::bounds_table::{MAX_ALARM_CAPACITY, MIN_ALARM_CAPACITY};
use residual_shared::names::{Instance, InstanceName};
use std::path::Path;

/// iceoryx2 puts sockets below its root directory, and their paths end at 108 bytes.
const MAX_ICEORYX_ROOT: usize = 60;

/// Largest `record_queue`: 256 MiB of records.
const MAX_RECORD_QUEUE: u64 = 65_536;

/// Shortest time from one checkpoint to the next, seconds: each is brought to the disk.
const MIN_CHECKPOINT_PERIOD_S: f64 = 0.1;

/// Longest time from one checkpoint to the next, one day.
const MAX_CHECKPOINT_PERIOD_S: f64 = 86_400.0;

/// Largest processor number of the kernel's CPU set.
const MAX_CPU: u64 = 1023;

pub(in crate::configuration) fn daemon(
    section: Daemon,
    directory: &Path,
    mistakes: &mut Mistakes<'_>,
) -> Option<DaemonSection> {
    let instance = match section.instance.parse::<InstanceName>() {
        Ok(instance) => Some(instance),
        Err(error) => {
            let message = error.to_string();
            let (message, help) = message.split_once("; ").unwrap_or((&message, ""));
            mistakes.at("daemon.instance", message, help);
            None
        }
    };
    if !section.runtime_directory.is_absolute() {
        mistakes.at(
            "daemon.runtime_directory",
            format!("`{}` is not an absolute path", section.runtime_directory.display()),
            "give the absolute path of a directory on a tmpfs, for instance \"/dev/shm\" or \"/run/residuald\"",
        );
    } else if let Some(instance) = &instance {
        let root = Instance::new(instance.clone(), &section.runtime_directory).iceoryx_root();
        if root.as_os_str().len() > MAX_ICEORYX_ROOT {
            mistakes.at(
                "daemon.runtime_directory",
                format!("`{}` is too long: sockets below it would exceed the system's limit", root.display()),
                format!("shorten the directory or the instance name so that this path has at most {MAX_ICEORYX_ROOT} bytes"),
            );
        }
    }
    let checkpoint_period_ns = checkpoint_period(&section, mistakes);
    let group = section.group.and_then(|group| group_id(group, mistakes));
    let mode = permission_bits(&section.mode, mistakes);
    if section.stale_after_periods == 0 {
        mistakes.at(
            "daemon.stale_after_periods",
            "with 0 periods every record would be stale at once",
            "use 1 or more; 3 survives two lost steps",
        );
    }
    check_range(
        "daemon.record_queue",
        section.record_queue as u64,
        1,
        MAX_RECORD_QUEUE,
        "number of buffered records",
        mistakes,
    );
    let capacities = MIN_ALARM_CAPACITY..=MAX_ALARM_CAPACITY;
    if !(section.alarm_capacity.is_power_of_two() && capacities.contains(&section.alarm_capacity)) {
        mistakes.at(
            "daemon.alarm_capacity",
            format!(
                "{} is no possible number of kept alarm transitions",
                section.alarm_capacity
            ),
            format!(
                "use a power of two from {MIN_ALARM_CAPACITY} to {MAX_ALARM_CAPACITY}; 1024 is the default"
            ),
        );
    }
    if let Err(error) = logging::parse(&section.log) {
        mistakes.at(
            "daemon.log",
            format!("`{}` is not a log filter: {error}", section.log),
            "use error, warn, info, debug or trace, or a list such as \"info,residuald=debug\"",
        );
    }
    Some(DaemonSection {
        instance: instance?,
        runtime_directory: section.runtime_directory,
        group,
        mode: mode?,
        stale_after_periods: section.stale_after_periods,
        catch_up_limit: section.catch_up_limit,
        log: section.log,
        record_queue: section.record_queue,
        alarm_capacity: section.alarm_capacity,
        gains_file: section.gains_file.map(|file| directory.join(file)),
        checkpoint_file: section.checkpoint_file.map(|file| directory.join(file)),
        checkpoint_period_ns,
    })
}

fn checkpoint_period(section: &Daemon, mistakes: &mut Mistakes<'_>) -> Option<u64> {
    let path = "daemon.checkpoint_period_s";
    let seconds = section.checkpoint_period_s?;
    if section.checkpoint_file.is_none() {
        mistakes.at(
            path,
            "there is a period for checkpoints but no file",
            "name one with `checkpoint_file`, or leave `checkpoint_period_s` out",
        );
    }
    if !(MIN_CHECKPOINT_PERIOD_S..=MAX_CHECKPOINT_PERIOD_S).contains(&seconds) {
        mistakes.at(
            path,
            format!("a checkpoint every {seconds} s is not possible"),
            "use 0.1 (ten times a second) to 86400 (once a day)",
        );
        return None;
    }
    Some((seconds * 1e9).round() as u64)
}

fn group_id(group: Group, mistakes: &mut Mistakes<'_>) -> Option<u32> {
    let name = match group {
        Group::Number(number) => return Some(number),
        Group::Name(name) => name,
    };
    match unistd::Group::from_name(&name) {
        Ok(Some(group)) => Some(group.gid.as_raw()),
        Ok(None) => {
            mistakes.at(
                "daemon.group",
                format!("there is no group `{name}` on this machine"),
                format!("create it (groupadd --system {name}), or name an existing group or its number"),
            );
            None
        }
        Err(error) => {
            mistakes.at(
                "daemon.group",
                format!("the group `{name}` cannot be looked up: {error}"),
                "",
            );
            None
        }
    }
}

/// Permission bits that let the owner read and write, and nobody else write.
fn permission_bits(mode: &str, mistakes: &mut Mistakes<'_>) -> Option<u32> {
    let mut refuse = |message: String, help: &str| {
        mistakes.at("daemon.mode", message, help);
        None
    };
    let bits = match u32::from_str_radix(mode.trim_start_matches("0o"), 8) {
        Ok(bits) if bits <= 0o777 => bits,
        _ => {
            return refuse(
                format!("`{mode}` is not a permission"),
                "write it in octal digits, for instance \"0640\"",
            );
        }
    };
    if bits & 0o022 != 0 {
        let who = if bits & 0o002 != 0 {
            "everybody"
        } else {
            "the group"
        };
        return refuse(
            format!("the mode {mode} would let {who} write to the bounds table"),
            "clients only read: use \"0640\" (the group reads) or \"0644\" (everybody reads)",
        );
    }
    if bits & 0o600 != 0o600 || bits & 0o111 != 0 {
        return refuse(
            format!("the mode {mode} does not fit a table that its owner reads and writes"),
            "use \"0600\", \"0640\" or \"0644\"",
        );
    }
    Some(bits)
}

pub(in crate::configuration) fn realtime(section: &Realtime, mistakes: &mut Mistakes<'_>) -> RealtimeSection {
    let fifo_priority = section.fifo_priority.and_then(|priority| {
        let valid = u8::try_from(priority)
            .ok()
            .filter(|priority| (1..=99).contains(priority));
        if valid.is_none() {
            mistakes.at(
                "realtime.fifo_priority",
                format!("{priority} is no SCHED_FIFO priority"),
                "use 1 to 99, or leave the key out for the usual scheduling",
            );
        }
        valid
    });
    if let Some(cpu) = section.cpu {
        check_range(
            "realtime.cpu",
            cpu as u64,
            0,
            MAX_CPU,
            "processor number",
            mistakes,
        );
    }
    RealtimeSection {
        fifo_priority,
        cpu: section.cpu,
        lock_memory: section.lock_memory,
    }
}
