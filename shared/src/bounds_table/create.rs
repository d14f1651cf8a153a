//! Making a new table: a complete file under a temporary name, renamed over the old one.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{FileExt, MetadataExt, OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use nix::errno::Errno;
use nix::fcntl::{OFlag, posix_fallocate};

use super::directory::{Image, encode};
use super::layout::{MAGIC, STATE_CLOSED, STATE_RUNNING, VERSION, WORD_BYTES, header};
use super::mapping::WritableMapping;
use super::protocol::WriteWord;
use super::spec::{Directory, SpecError, TableSpec};
use crate::clock::{monotonic_ns, nanoseconds};

/// Who may read a table besides the daemon's own user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Access {
    /// Group of the file (a gid); `None`: the daemon's own group.
    pub group: Option<u32>,
    /// Permission bits of the file: 0600, 0640 (the group reads) or 0644 (everybody reads).
    pub mode: u32,
}

/// Why a table could not be created. Nothing is left behind, and an older table is not touched.
#[derive(Debug, thiserror::Error)]
pub enum CreateError {
    /// The specification is not usable.
    #[error("the bounds table cannot be laid out: {0}")]
    Spec(#[from] SpecError),
    /// The mode lets somebody else write, or keeps the daemon out.
    #[error("mode {mode:o} for the bounds table; use 600, 640 or 644 (nobody but the daemon may write)")]
    Mode {
        /// The mode asked for.
        mode: u32,
    },
    /// The file system has no room.
    #[error("{} has no room for the {bytes} bytes of the bounds table; free some of it or make it larger \
             (mount -o remount,size=…)", directory.display())]
    NoSpace {
        /// The directory of the file.
        directory: PathBuf,
        /// Size of the table.
        bytes: usize,
    },
    /// The file cannot be given to the group.
    #[error(
        "the bounds table cannot be given to the group {group}: {source}; the daemon's user must be a \
             member of it"
    )]
    Group {
        /// The group's id.
        group: u32,
        /// What the system said.
        source: io::Error,
    },
    /// Another step failed.
    #[error("cannot {step} {}: {source}", path.display())]
    Io {
        /// What was tried.
        step: &'static str,
        /// With which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// A file under its temporary name; removed unless it got its final one.
struct Temporary {
    path: PathBuf,
    renamed: bool,
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if !self.renamed {
            // There is nothing better to do when it fails: the next daemon removes it.
            let _ = fs::remove_file(&self.path);
        }
    }
}

/// Creates the table at `path`, marks the one it replaces closed, and gives its mapping and places.
pub(super) fn create(
    path: &Path,
    spec: &TableSpec,
    access: &Access,
) -> Result<(WritableMapping, Image), CreateError> {
    let failed = |step, path: &Path| {
        let path = path.to_path_buf();
        move |source| CreateError::Io { step, path, source }
    };
    if access.mode & !0o044 != 0o600 {
        return Err(CreateError::Mode { mode: access.mode });
    }
    let old = OldTable::open(path);
    let epoch = nanoseconds(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default());
    let directory = Directory {
        spec: spec.clone(),
        epoch: old
            .as_ref()
            .map_or(epoch, |old| epoch.max(old.epoch.saturating_add(1))),
        boot_id: boot_id(),
        pid: std::process::id(),
    };
    let image = encode(&directory)?;
    let bytes = image.total_words * WORD_BYTES;

    remove_stale(path);
    let temporary_path = temporary_name(path);
    let file = OpenOptions::new()
        .read(true)
        .write(true)
        .create_new(true)
        .mode(0o600)
        .open(&temporary_path)
        .map_err(failed("create", &temporary_path))?;
    let mut temporary = Temporary {
        path: temporary_path,
        renamed: false,
    };
    allocate(&file, bytes).map_err(|errno| match errno {
        Errno::ENOSPC => {
            let directory = path.parent().unwrap_or(Path::new("/")).into();
            CreateError::NoSpace { directory, bytes }
        }
        errno => failed("allocate memory for", &temporary.path)(errno.into()),
    })?;
    if let Some(group) = access.group {
        fchown(&file, None, Some(group)).map_err(|source| CreateError::Group { group, source })?;
    }
    file.set_permissions(Permissions::from_mode(access.mode))
        .map_err(failed("set the permissions of", &temporary.path))?;
    let mapping = WritableMapping::new(&file, image.total_words).map_err(failed("map", &temporary.path))?;
    let words = mapping.words();
    for (word, value) in words.iter().zip(&image.words) {
        WriteWord::store(word, *value);
    }
    WriteWord::store(&words[header::HEARTBEAT], monotonic_ns());
    WriteWord::store(&words[header::STATE], STATE_RUNNING);

    fs::rename(&temporary.path, path).map_err(failed("move the new bounds table to", path))?;
    temporary.renamed = true;
    // Now, and not earlier: a reader that sees the old table closed finds the new one at once.
    if let Some(old) = old {
        old.close()
            .map_err(failed("mark as closed the table that was at", path))?;
    }
    Ok((mapping, image))
}

/// A table at the path before, written by the same user.
struct OldTable {
    file: File,
    epoch: u64,
}

impl OldTable {
    /// Opens what lies at `path` if it is a table of this version and of this user.
    fn open(path: &Path) -> Option<Self> {
        let flags = OFlag::O_NOFOLLOW | OFlag::O_NONBLOCK;
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .custom_flags(flags.bits())
            .open(path)
            .ok()?;
        let metadata = file.metadata().ok()?;
        let word = |index: usize| {
            let mut bytes = [0; WORD_BYTES];
            file.read_exact_at(&mut bytes, (index * WORD_BYTES) as u64).ok()?;
            Some(u64::from_ne_bytes(bytes))
        };
        let ours = metadata.is_file()
            && metadata.uid() == nix::unistd::geteuid().as_raw()
            && metadata.len() >= (header::WORDS * WORD_BYTES) as u64
            && word(header::MAGIC)? == MAGIC
            && word(header::VERSION)? == VERSION;
        let epoch = word(header::EPOCH)?;
        ours.then_some(Self { file, epoch })
    }

    /// Marks it closed, through the file: its memory may be damaged, and a mapping of it could fault.
    fn close(&self) -> io::Result<()> {
        self.file
            .write_all_at(&STATE_CLOSED.to_ne_bytes(), (header::STATE * WORD_BYTES) as u64)
    }
}

/// Gives the file real memory now: without it, a full tmpfs would kill the daemon at its first write.
fn allocate(file: &File, bytes: usize) -> Result<(), Errno> {
    loop {
        match posix_fallocate(file, 0, bytes as _) {
            Err(Errno::EINTR) => {}
            outcome => return outcome,
        }
    }
}

const TEMPORARY_EXTENSION: &str = ".new";

fn temporary_name(path: &Path) -> PathBuf {
    let mut name = OsString::from(path);
    name.push(format!(".{}{TEMPORARY_EXTENSION}", std::process::id()));
    name.into()
}

/// Removes what daemons killed during their start left of this table. Failures show at the creation.
fn remove_stale(path: &Path) {
    let (Some(directory), Some(name)) = (path.parent(), path.file_name()) else {
        return;
    };
    let is_stale = |candidate: &OsString| {
        let pid = candidate
            .as_encoded_bytes()
            .strip_prefix(name.as_encoded_bytes())?
            .strip_prefix(b".")?
            .strip_suffix(TEMPORARY_EXTENSION.as_bytes())?;
        (!pid.is_empty() && pid.iter().all(u8::is_ascii_digit)).then_some(())
    };
    let directory = if directory.as_os_str().is_empty() {
        Path::new(".")
    } else {
        directory
    };
    for entry in fs::read_dir(directory).into_iter().flatten().flatten() {
        if is_stale(&entry.file_name()).is_some() {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// The id of this boot of the machine; 0 when the system does not tell.
pub(super) fn boot_id() -> u128 {
    let text = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    u128::from_str_radix(&text.trim().replace('-', ""), 16).unwrap_or(0)
}
