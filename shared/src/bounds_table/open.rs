//! Opening a table to read: nothing in the file is trusted before it has been checked.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

use nix::fcntl::OFlag;
use nix::unistd::{Gid, Group, Uid, User};

use super::decode::decode;
use super::directory::Image;
use super::layout::{HASH, MAGIC, VERSION, WORD_BYTES, header};
use super::mapping::ReadOnlyMapping;
use super::protocol::ReadWord;
use super::spec::Directory;

/// Why a table could not be opened.
#[derive(Debug, thiserror::Error)]
pub enum OpenError {
    /// There is no file.
    #[error("there is no bounds table at {}; is the daemon running, with this instance name and runtime \
             directory?", path.display())]
    NotFound {
        /// Where it was looked for.
        path: PathBuf,
    },
    /// The file may not be read.
    #[error("the bounds table {} may not be read by this user; {advice}", path.display())]
    PermissionDenied {
        /// The file.
        path: PathBuf,
        /// Who may read it, and what to do.
        advice: String,
    },
    /// The file is not a bounds table.
    #[error("{} is not a bounds table of residuald: {found}", path.display())]
    NotATable {
        /// The file.
        path: PathBuf,
        /// What it is instead.
        found: String,
    },
    /// The table has another layout.
    #[error("the bounds table {} has the layout {version} ({hash:016x}), this program reads the layout \
             {VERSION} ({HASH:016x}); use the client of the daemon's release", path.display())]
    OtherLayout {
        /// The file.
        path: PathBuf,
        /// Version in the file.
        version: u64,
        /// Hash in the file.
        hash: u64,
    },
    /// The file is shorter than the table in it.
    #[error("the bounds table {} is cut off: it has {actual} of {expected} bytes; restart the daemon", path.display())]
    Truncated {
        /// The file.
        path: PathBuf,
        /// Bytes it has.
        actual: u64,
        /// Bytes it should have.
        expected: u64,
    },
    /// The directory is damaged.
    #[error("the directory of the bounds table {} is damaged: {found}; restart the daemon", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        found: String,
    },
    /// Another error of the system.
    #[error("cannot open the bounds table {}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Which file a path leads to: device and inode.
pub(super) type FileId = (u64, u64);

/// A table that has passed all checks.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) mapping: ReadOnlyMapping,
    pub(super) directory: Directory,
    pub(super) image: Image,
    pub(super) file: FileId,
}

/// Opens and checks the table at `path`.
pub(super) fn open(path: &Path) -> Result<Opened, OpenError> {
    let failed = |source| OpenError::Io {
        path: path.into(),
        source,
    };
    let not_a_table = |found: &str| OpenError::NotATable {
        path: path.into(),
        found: found.into(),
    };
    let file = open_file(path)?;
    let metadata = file.metadata().map_err(failed)?;
    if !metadata.is_file() {
        return Err(not_a_table("it is not a regular file"));
    }
    let mapped_words = usize::try_from(metadata.len()).unwrap_or(usize::MAX) / WORD_BYTES;
    if mapped_words < header::WORDS {
        return Err(not_a_table(&format!("it has only {} bytes", metadata.len())));
    }
    let mapping = ReadOnlyMapping::new(&file, mapped_words).map_err(failed)?;
    let words = mapping.words();
    if words[header::MAGIC].load() != MAGIC {
        return Err(not_a_table("it does not begin with `RESIDUAL`"));
    }
    let (version, hash) = (words[header::VERSION].load(), words[header::HASH].load());
    if (version, hash) != (VERSION, HASH) {
        return Err(OpenError::OtherLayout {
            path: path.into(),
            version,
            hash,
        });
    }
    let expected = words[header::TOTAL_BYTES].load();
    if expected > metadata.len() {
        return Err(OpenError::Truncated {
            path: path.into(),
            actual: metadata.len(),
            expected,
        });
    }
    let damaged = |found: String| OpenError::Damaged {
        path: path.into(),
        found,
    };
    let directory_words = words[header::DIRECTORY_BYTES].load() / WORD_BYTES as u64;
    let directory_words = usize::try_from(directory_words)
        .ok()
        .filter(|count| (header::WORDS..=mapped_words).contains(count))
        .ok_or_else(|| damaged("its size is wrong".into()))?;
    // Checked and used is a private copy, which nobody can change in between.
    let copy: Vec<u64> = words[..directory_words].iter().map(ReadWord::load).collect();
    let (directory, image) = decode(&copy).map_err(damaged)?;
    if image.total_words > mapped_words {
        return Err(damaged("its slots lie outside the file".into()));
    }
    Ok(Opened {
        mapping,
        directory,
        image,
        file: (metadata.dev(), metadata.ino()),
    })
}

/// Opens the file read-only; a FIFO or device at the path does not block.
fn open_file(path: &Path) -> Result<File, OpenError> {
    let opened = OpenOptions::new()
        .read(true)
        .custom_flags(OFlag::O_NONBLOCK.bits())
        .open(path);
    opened.map_err(|source| match source.kind() {
        io::ErrorKind::NotFound => OpenError::NotFound { path: path.into() },
        io::ErrorKind::PermissionDenied => OpenError::PermissionDenied {
            path: path.into(),
            advice: advice(path),
        },
        _ => OpenError::Io {
            path: path.into(),
            source,
        },
    })
}

/// Who may read the file at `path`.
fn advice(path: &Path) -> String {
    let Ok(metadata) = fs::metadata(path) else {
        return "its directory may not be searched either; ask for access to the runtime directory".into();
    };
    let (uid, gid) = (Uid::from_raw(metadata.uid()), Gid::from_raw(metadata.gid()));
    if metadata.mode() & 0o040 != 0 {
        let name = Group::from_gid(gid)
            .ok()
            .flatten()
            .map_or_else(|| gid.to_string(), |group| group.name);
        format!("it is open to the group `{name}` (gid {gid}): become a member and log in again")
    } else {
        let name = User::from_uid(uid)
            .ok()
            .flatten()
            .map_or_else(|| uid.to_string(), |user| user.name);
        format!("it is open to the user `{name}` only: configure a group for the bounds table")
    }
}

/// Which file `path` leads to now.
pub(super) fn file_id(path: &Path) -> io::Result<FileId> {
    fs::metadata(path).map(|metadata| (metadata.dev(), metadata.ino()))
}
