//! Where a life of the daemon begins: afresh, or where the checkpoint of an earlier one says.

use residual_shared::bounds_table::boot_id;
use residual_shared::clock::{DaemonTime, monotonic_ns};
use tracing::{info, warn};

use super::checkpoint::{Checkpoint, Identity};
use super::engine::Engine;
use super::running::{Grid, Running};
use super::snapshot::parts;
use crate::configuration::DaemonSection;

/// From start-up to the epoch of the schedule: lets everything settle before the first step.
const HEAD_START_NS: u64 = 20_000_000;

/// [`boot_id`] where the system does not tell it.
const UNKNOWN_BOOT: u128 = 0;

/// The begin of a life.
pub struct Life {
    /// Its time and its sampling instants: those of the earlier life, if it goes on from one.
    pub grid: Grid,
    checkpoint: Option<Checkpoint>,
    /// Whether the time of the checkpoint is that of this life, so that states go on and not the alarms alone.
    same_time: bool,
}

impl Checkpoint {
    /// A checkpoint of a daemon whose states are in `snapshot`.
    pub fn of(running: &Running, grid: Grid, snapshot: Vec<u8>) -> Self {
        Self {
            instance: running.configuration.daemon.instance.to_string(),
            boot_id: boot_id(),
            origin_ns: grid.time.origin_ns,
            speed: grid.time.speed,
            epoch_ns: grid.epoch_ns,
            diagnosers: running.identities.diagnosers.clone(),
            inputs: running.identities.inputs.clone(),
            snapshot,
        }
    }
}

impl Life {
    /// The life that begins now, with a time of this `speed`: where the configured checkpoint says, if there is one
    /// and it is of use. What is not is told to the log.
    pub fn begin(daemon: &DaemonSection, speed: f64) -> Self {
        let checkpoint = checkpoint(daemon);
        let continued = checkpoint
            .as_ref()
            .filter(|checkpoint| has_this_time(checkpoint, daemon, speed));
        let time = DaemonTime {
            origin_ns: continued.map_or_else(monotonic_ns, |checkpoint| checkpoint.origin_ns),
            speed,
        };
        let epoch_ns = match continued {
            Some(checkpoint) => checkpoint.epoch_ns,
            None => time.from_monotonic(time.origin_ns + HEAD_START_NS),
        };
        Self {
            grid: Grid { time, epoch_ns },
            same_time: continued.is_some(),
            checkpoint,
        }
    }

    /// Lets an engine with this life's epoch go on from the checkpoint, as far as the states fit; the others begin
    /// with their next instant.
    pub fn resume(&self, engine: &mut Engine, running: &Running) {
        let Some(checkpoint) = &self.checkpoint else {
            return;
        };
        let now_ns = self.grid.time.now_ns();
        let path = running.configuration.daemon.checkpoint_file.as_deref();
        let file = path.unwrap_or_else(|| "".as_ref()).display();
        let (diagnosers, inputs) = split(checkpoint);
        if !self.same_time {
            for (slot, identity) in running.identities.diagnosers.iter().enumerate() {
                if let Some(part) = part_of(identity, &checkpoint.diagnosers, &diagnosers) {
                    engine.restore_only_alarm(slot, part);
                }
            }
            return;
        }
        if diagnosers.len() < checkpoint.diagnosers.len() {
            warn!("the states in the checkpoint {file} are damaged; starting afresh");
            for slot in 0..running.identities.diagnosers.len() {
                engine.begin_at(slot, now_ns);
            }
            return;
        }
        for (input, identity) in running.identities.inputs.iter().enumerate() {
            if let Some(part) = part_of(identity, &checkpoint.inputs, &inputs)
                && !engine.restore_input(input, part)
            {
                let input = &identity.name;
                warn!(
                    input,
                    "its part of the checkpoint {file} is damaged; the input begins empty"
                );
            }
        }
        let mut resumed = 0;
        for (slot, identity) in running.identities.diagnosers.iter().enumerate() {
            let diagnoser = &identity.name;
            let refused = match part_of(identity, &checkpoint.diagnosers, &diagnosers) {
                Some(part) => match engine.restore_diagnoser(slot, part, now_ns) {
                    Ok(skipped) => {
                        info!(diagnoser, skipped, "goes on from its checkpoint");
                        resumed += 1;
                        continue;
                    }
                    Err(error) => error.to_string(),
                },
                None if checkpoint.diagnosers.iter().any(|saved| saved.name == *diagnoser) => {
                    "it has another configuration or other gains now".into()
                }
                None => "it was not there then".into(),
            };
            warn!(
                diagnoser,
                "begins afresh, not from the checkpoint {file}: {refused}"
            );
            engine.begin_at(slot, now_ns);
        }
        info!(
            resumed,
            of = running.identities.diagnosers.len(),
            "states taken from the checkpoint {file}"
        );
    }
}

/// The configured checkpoint, if there is one that can be read and is this instance's.
fn checkpoint(daemon: &DaemonSection) -> Option<Checkpoint> {
    let path = daemon.checkpoint_file.as_deref()?;
    match Checkpoint::read(path) {
        Ok(Some(checkpoint)) if checkpoint.instance == daemon.instance.to_string() => Some(checkpoint),
        Ok(Some(checkpoint)) => {
            let instance = checkpoint.instance;
            warn!(
                "the checkpoint {} is of the instance `{instance}`; starting afresh",
                path.display()
            );
            None
        }
        Ok(None) => {
            info!("there is no checkpoint {} yet; starting afresh", path.display());
            None
        }
        Err(error) => {
            warn!("{error}");
            None
        }
    }
}

/// Whether the time of a checkpoint goes on; if not, the log is told why.
fn has_this_time(checkpoint: &Checkpoint, daemon: &DaemonSection, speed: f64) -> bool {
    let now = DaemonTime {
        origin_ns: checkpoint.origin_ns,
        speed,
    };
    let reason = if !is_same_boot(checkpoint.boot_id, boot_id()) {
        "the machine was started since, and its clock began anew, or nobody can tell whether it was".into()
    } else if checkpoint.speed != speed {
        format!("the daemon's time ran with speed {} then", checkpoint.speed)
    } else if checkpoint.origin_ns > monotonic_ns() || checkpoint.epoch_ns > now.now_ns() + HEAD_START_NS {
        "its clock is ahead of the machine's".into()
    } else {
        return true;
    };
    let path = daemon.checkpoint_file.as_deref().unwrap_or_else(|| "".as_ref());
    warn!(
        "only the alarms go on from the checkpoint {}, the diagnosers begin afresh: {reason}",
        path.display()
    );
    false
}

/// Whether two moments are of the same boot; an unknown boot is the same as none.
fn is_same_boot(one: u128, other: u128) -> bool {
    one == other && one != UNKNOWN_BOOT
}

/// The parts of the diagnosers and those of the inputs; none if there are not as many as there should be.
fn split(checkpoint: &Checkpoint) -> (Vec<&[u8]>, Vec<&[u8]>) {
    let (diagnosers, inputs) = (checkpoint.diagnosers.len(), checkpoint.inputs.len());
    match parts(&checkpoint.snapshot) {
        Some(mut parts) if parts.len() == diagnosers + inputs => {
            let inputs = parts.split_off(diagnosers);
            (parts, inputs)
        }
        _ => (Vec::new(), Vec::new()),
    }
}

/// The part of the saved diagnoser or input with this identity.
fn part_of<'a>(identity: &Identity, saved: &[Identity], parts: &[&'a [u8]]) -> Option<&'a [u8]> {
    let place = saved.iter().position(|saved| saved == identity)?;
    parts.get(place).copied()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boots_are_the_same_only_if_they_are_known() {
        assert!(is_same_boot(7, 7));
        assert!(!is_same_boot(7, 8));
        assert!(!is_same_boot(UNKNOWN_BOOT, 7));
        assert!(!is_same_boot(UNKNOWN_BOOT, UNKNOWN_BOOT));
    }
}
