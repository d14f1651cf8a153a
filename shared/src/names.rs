//! Names and paths of an instance.
//!
//! Everything that belongs to one instance carries its name, so that several daemons (and tests) run side by
//! side. All of it lies in the runtime directory, which must be a tmpfs: gone at boot, no disk in the path.

use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Environment variable that replaces [`DEFAULT_RUNTIME_DIRECTORY`] for programs that have no configuration.
pub const RUNTIME_DIRECTORY_VARIABLE: &str = "RESIDUALD_RUNTIME_DIRECTORY";

/// Where an instance keeps its segment, lock and iceoryx2 files unless told otherwise.
pub const DEFAULT_RUNTIME_DIRECTORY: &str = "/dev/shm";

/// Longest instance name. iceoryx2 puts socket paths below its root directory, and those end at 108 bytes.
pub const MAX_INSTANCE_NAME: usize = 24;

/// Longest root directory and prefix together: iceoryx2 puts 36 bytes more into the path of a socket, which ends
/// at 107.
const MAX_SOCKET_PLACE: usize = 71;

/// The name of one running daemon: 1 to 24 of `a–z 0–9 _ -`.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct InstanceName(String);

/// Why an instance name was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InstanceNameError {
    /// The name has no or too many characters.
    #[error("instance name `{0}` has {len} characters; use 1 to {MAX_INSTANCE_NAME}", len = .0.len())]
    Length(String),
    /// A character is not allowed.
    #[error("instance name `{0}` holds `{1}`; use only a-z, 0-9, `_` and `-`")]
    Character(String, char),
}

impl FromStr for InstanceName {
    type Err = InstanceNameError;

    fn from_str(name: &str) -> Result<Self, Self::Err> {
        let allowed = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_' || c == '-';
        if let Some(c) = name.chars().find(|&c| !allowed(c)) {
            return Err(InstanceNameError::Character(name.into(), c));
        }
        if name.is_empty() || name.len() > MAX_INSTANCE_NAME {
            return Err(InstanceNameError::Length(name.into()));
        }
        Ok(Self(name.into()))
    }
}

impl fmt::Display for InstanceName {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(&self.0)
    }
}

/// An instance at its place: name and runtime directory.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    /// The instance's name.
    pub name: InstanceName,
    /// The directory, on a tmpfs, that holds its files.
    pub runtime_directory: PathBuf,
}

impl Instance {
    /// The instance `name` in `runtime_directory`.
    pub fn new(name: InstanceName, runtime_directory: impl Into<PathBuf>) -> Self {
        Self {
            name,
            runtime_directory: runtime_directory.into(),
        }
    }

    /// The instance `name` in the directory that the environment names, or the default one.
    pub fn from_environment(name: InstanceName) -> Self {
        let directory = std::env::var_os(RUNTIME_DIRECTORY_VARIABLE)
            .map_or_else(|| Path::new(DEFAULT_RUNTIME_DIRECTORY).into(), PathBuf::from);
        Self::new(name, directory)
    }

    /// The bounds table, readable by the configured group.
    pub fn bounds_path(&self) -> PathBuf {
        self.path("bounds")
    }

    /// The lock that keeps a second daemon away; the kernel releases it when its holder dies.
    pub fn lock_path(&self) -> PathBuf {
        self.path("lock")
    }

    /// Root directory of the instance's iceoryx2 files.
    pub fn iceoryx_root(&self) -> PathBuf {
        self.path("iox2")
    }

    /// Prefix of the instance's iceoryx2 files and shared memory. The dots, which no instance name holds, keep
    /// the prefix of one instance from being the beginning of another's. It is short because root directory and
    /// prefix both stand in the paths of sockets.
    pub fn iceoryx_prefix(&self) -> String {
        format!("rsd.{}.", self.name)
    }

    /// Whether the sockets of iceoryx2's event listeners have paths short enough for the system.
    pub fn has_room_for_sockets(&self) -> bool {
        self.iceoryx_root().as_os_str().len() + self.iceoryx_prefix().len() <= MAX_SOCKET_PLACE
    }

    /// iceoryx2 service on which the samples of one input travel; the last part is the payload's version.
    pub fn sample_service(&self, input: &str) -> String {
        format!("residuald/{}/input/{input}/v1", self.name)
    }

    /// iceoryx2 service on which every step record travels; the last part is the version of payload and
    /// header.
    pub fn record_service(&self) -> String {
        format!("residuald/{}/records/v2", self.name)
    }

    /// iceoryx2 service that takes control requests; the last part is the version of its byte stream.
    pub fn control_service(&self) -> String {
        format!("residuald/{}/control/v1", self.name)
    }

    /// iceoryx2 event service that wakes at every alarm; the last part is the version of its event ids.
    pub fn alarm_service(&self) -> String {
        format!("residuald/{}/alarms/v1", self.name)
    }

    fn path(&self, extension: &str) -> PathBuf {
        self.runtime_directory
            .join(format!("residuald.{}.{extension}", self.name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_would_break_a_path_are_refused() {
        for bad in ["", "a/b", "A", "ä", "..", "a b", &"x".repeat(25)] {
            assert!(bad.parse::<InstanceName>().is_err(), "{bad}");
        }
        assert!("vehicle-1_a".parse::<InstanceName>().is_ok());
    }

    #[test]
    fn names_of_up_to_21_characters_leave_room_for_sockets_in_the_default_directory() {
        let of =
            |length: usize| Instance::new("x".repeat(length).parse().unwrap(), DEFAULT_RUNTIME_DIRECTORY);
        assert!(of(21).has_room_for_sockets());
        assert!(!of(22).has_room_for_sockets());
    }

    #[test]
    fn two_instances_share_no_path_and_no_service() {
        let of = |name: &str| Instance::new(name.parse().unwrap(), "/dev/shm");
        let (a, b) = (of("a"), of("b"));
        assert_ne!(a.bounds_path(), b.bounds_path());
        assert_ne!(a.iceoryx_root(), b.iceoryx_root());
        assert_ne!(a.sample_service("imu"), b.sample_service("imu"));
    }
}
