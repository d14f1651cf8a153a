//! The checkpoint file: what a new life of the daemon goes on from.
//!
//! | part | content |
//! |---|---|
//! | head | magic number, version |
//! | body | [`Checkpoint`], serialised by bincode |
//! | tail | checksum of all that stands before it |
//!
//! A file is written under another name in the same directory, brought to the disk and renamed, so there is always
//! a whole one. Only its owner may read it.

use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use tempfile::Builder;
use xxhash_rust::xxh3::xxh3_64;

use super::snapshot::encoding;

/// Begins every checkpoint.
const MAGIC: [u8; 8] = *b"RESCHECK";
/// Version of everything after it.
const VERSION: u64 = 1;
/// Bytes of magic number and version.
const HEAD: usize = 16;
/// Bytes of the checksum.
const TAIL: usize = size_of::<u64>();

/// A diagnoser or an input, by its name and by all that its state depends on.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Identity {
    /// Its name.
    pub name: String,
    /// Hash of its configuration and, for a diagnoser, of its gains.
    pub fingerprint: u64,
}

/// The states of all diagnosers and inputs of a daemon.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint {
    /// The daemon's instance.
    pub instance: String,
    /// Id of the machine's boot, whose clock all moments belong to.
    pub boot_id: u128,
    /// Where the daemon's time and CLOCK_MONOTONIC agree, nanoseconds.
    pub origin_ns: u64,
    /// Seconds of the daemon's time per second of CLOCK_MONOTONIC.
    pub speed: f64,
    /// Epoch of the sampling instants, nanoseconds of the daemon's time.
    pub epoch_ns: u64,
    /// The diagnosers, in the order of their parts of the snapshot.
    pub diagnosers: Vec<Identity>,
    /// The inputs, likewise, after the diagnosers.
    pub inputs: Vec<Identity>,
    /// The states ([`super::snapshot`]).
    pub snapshot: Vec<u8>,
}

/// Why a checkpoint cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// It cannot be read.
    #[error("the checkpoint {} cannot be read: {source}; starting afresh", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// It does not begin like a checkpoint.
    #[error("{} is not a checkpoint; starting afresh, and the next checkpoint will replace it", path.display())]
    NotACheckpoint {
        /// The file.
        path: PathBuf,
    },
    /// Another version of the program wrote it.
    #[error(
        "the checkpoint {} has version {found}, this program reads version {VERSION}; starting afresh",
        path.display()
    )]
    UnknownVersion {
        /// The file.
        path: PathBuf,
        /// Its version.
        found: u64,
    },
    /// It is incomplete or changed.
    #[error("the checkpoint {} is damaged; starting afresh", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
    },
    /// It cannot be written.
    #[error(
        "cannot write the checkpoint {}: {source}; does its directory exist, and may this user write there?",
        path.display()
    )]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}

impl Checkpoint {
    /// Writes the file, whole or not at all, readable by its owner only; gives its length, bytes.
    ///
    /// # Errors
    /// [`CheckpointError::Unwritable`]; an older checkpoint stays then.
    pub fn write(&self, path: &Path) -> Result<u64, CheckpointError> {
        self.replace(path).map_err(|source| CheckpointError::Unwritable {
            path: path.into(),
            source,
        })
    }

    fn replace(&self, path: &Path) -> io::Result<u64> {
        let mut bytes = [MAGIC, VERSION.to_le_bytes()].concat();
        bincode::serde::encode_into_std_write(self, &mut bytes, encoding()).map_err(io::Error::other)?;
        bytes.extend(xxh3_64(&bytes).to_le_bytes());
        let directory = match path.parent() {
            Some(directory) if !directory.as_os_str().is_empty() => directory,
            _ => Path::new("."),
        };
        let name = path.file_name().ok_or(io::ErrorKind::InvalidFilename)?;
        let mut temporary = name.to_owned();
        temporary.push(".new");
        // What a daemon that was killed while writing has left; there is one writer at a time.
        let _ = fs::remove_file(directory.join(&temporary));
        let mut file = Builder::new()
            .prefix(&temporary)
            .rand_bytes(0)
            .tempfile_in(directory)?;
        file.write_all(&bytes)?;
        file.as_file().sync_all()?;
        file.persist(path)?;
        // The new name is on the disk only when its directory is.
        File::open(directory)?.sync_all()?;
        Ok(bytes.len() as u64)
    }

    /// Reads a file; `None` if there is none.
    ///
    /// # Errors
    /// Why it cannot be used.
    pub fn read(path: &Path) -> Result<Option<Self>, CheckpointError> {
        let unreadable = |source| CheckpointError::Unreadable {
            path: path.into(),
            source,
        };
        let metadata = match fs::metadata(path) {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(unreadable(error)),
        };
        // Reading anything but a file might never end.
        if !metadata.is_file() {
            return Err(unreadable(io::Error::other("it is not a file")));
        }
        let bytes = fs::read(path).map_err(unreadable)?;
        Self::from_bytes(path, &bytes).map(Some)
    }

    fn from_bytes(path: &Path, bytes: &[u8]) -> Result<Self, CheckpointError> {
        let damaged = || CheckpointError::Damaged { path: path.into() };
        if !bytes.starts_with(&MAGIC) {
            return Err(CheckpointError::NotACheckpoint { path: path.into() });
        }
        let (content, tail) = bytes
            .split_at_checked(bytes.len().saturating_sub(TAIL))
            .ok_or_else(damaged)?;
        if content.len() < HEAD || tail != xxh3_64(content).to_le_bytes() {
            return Err(damaged());
        }
        let (head, body) = content.split_at(HEAD);
        let found = head[MAGIC.len()..]
            .iter()
            .rev()
            .fold(0, |number, byte| number << 8 | u64::from(*byte));
        if found != VERSION {
            return Err(CheckpointError::UnknownVersion {
                path: path.into(),
                found,
            });
        }
        // What claims to be longer than the file is damaged; without this limit it would be given memory first.
        let limited = encoding().with_limit::<{ 1 << 30 }>();
        match bincode::serde::decode_from_slice(body, limited) {
            Ok((checkpoint, used)) if used == body.len() => Ok(checkpoint),
            _ => Err(damaged()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::os::unix::fs::PermissionsExt;

    fn checkpoint() -> Checkpoint {
        let identity = |name: &str| Identity {
            name: name.into(),
            fingerprint: 7,
        };
        Checkpoint {
            instance: "plant".into(),
            boot_id: 1 << 100,
            origin_ns: 5,
            speed: 1.0,
            epoch_ns: 9,
            diagnosers: vec![identity("wing"), identity("tail")],
            inputs: vec![identity("imu")],
            snapshot: (0..=255).collect(),
        }
    }

    #[test]
    fn what_was_written_is_read_and_only_its_owner_may_read_it() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("state");
        assert_eq!(Checkpoint::read(&path).unwrap(), None);
        let mut checkpoint = checkpoint();
        for number in 0..2 {
            checkpoint.epoch_ns = number;
            fs::write(directory.path().join("state.new"), "half a checkpoint").unwrap();
            checkpoint.write(&path).unwrap();
            assert_eq!(Checkpoint::read(&path).unwrap().unwrap(), checkpoint);
        }
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o600);
        assert_eq!(fs::read_dir(&directory).unwrap().count(), 1);
    }

    #[test]
    fn what_cannot_be_read_or_written_is_named() {
        let directory = tempfile::tempdir().unwrap();
        let message = |error: CheckpointError| error.to_string();
        let refused = message(Checkpoint::read(directory.path()).unwrap_err());
        assert!(
            refused.contains(&directory.path().display().to_string()),
            "{refused}"
        );
        assert!(refused.contains("not a file"), "{refused}");
        let missing = directory.path().join("none").join("state");
        let refused = message(checkpoint().write(&missing).unwrap_err());
        assert!(refused.contains("none/state"), "{refused}");
        let foreign = directory.path().join("foreign");
        fs::write(&foreign, "instance = \"plant\"\n").unwrap();
        let refused = message(Checkpoint::read(&foreign).unwrap_err());
        assert!(refused.contains("foreign is not a checkpoint"), "{refused}");
    }

    #[test]
    fn a_checkpoint_of_another_version_says_so() {
        let directory = tempfile::tempdir().unwrap();
        let path = directory.path().join("state");
        checkpoint().write(&path).unwrap();
        let mut bytes = fs::read(&path).unwrap();
        bytes[MAGIC.len()] = 9;
        let content = bytes.len() - TAIL;
        let checksum = xxh3_64(&bytes[..content]);
        bytes[content..].copy_from_slice(&checksum.to_le_bytes());
        let refused = Checkpoint::from_bytes(&path, &bytes).unwrap_err().to_string();
        assert!(refused.contains("has version 9"), "{refused}");
    }

    proptest! {
        #[test]
        fn a_changed_or_shortened_file_is_refused(
            places in prop::collection::vec((any::<prop::sample::Index>(), 1_u8..), 0..4),
            length in any::<prop::sample::Index>(),
        ) {
            let directory = tempfile::tempdir().unwrap();
            let path = directory.path().join("state");
            checkpoint().write(&path).unwrap();
            let whole = fs::read(&path).unwrap();
            let mut bytes = whole.clone();
            for (place, change) in &places {
                bytes[place.index(whole.len())] ^= change;
            }
            if places.is_empty() {
                bytes.truncate(length.index(whole.len()));
            }
            if bytes != whole {
                prop_assert!(Checkpoint::from_bytes(&path, &bytes).is_err());
            }
        }

        /// With a right checksum as well, so that everything behind it is reached.
        #[test]
        fn a_forged_file_is_survived(
            places in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8),
        ) {
            let directory = tempfile::tempdir().unwrap();
            let path = directory.path().join("state");
            checkpoint().write(&path).unwrap();
            let mut bytes = fs::read(&path).unwrap();
            let content = bytes.len() - TAIL;
            for (place, value) in places {
                bytes[HEAD + place.index(content - HEAD)] = value;
            }
            let checksum = xxh3_64(&bytes[..content]);
            bytes[content..].copy_from_slice(&checksum.to_le_bytes());
            let _ = Checkpoint::from_bytes(&path, &bytes);
        }
    }
}
