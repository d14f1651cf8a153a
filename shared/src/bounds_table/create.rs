//! Making a new table: a complete file under a temporary name, renamed over the old one.

use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, Permissions};
use std::io;
use std::os::unix::fs::{OpenOptionsExt, PermissionsExt, fchown};
use std::path::{Path, PathBuf};
use std::sync::atomic::Ordering;
use std::time::{SystemTime, UNIX_EPOCH};

use nix::errno::Errno;
use nix::fcntl::posix_fallocate;

use super::directory::{Image, encode};
use super::inheritance::Inheritance;
use super::layout::{STATE_RUNNING, WORD_BYTES, header};
use super::mapping::WritableMapping;
use super::old_table::OldTable;
use super::protocol::WriteWord;
use super::spec::{Directory, SlotSpec, SpecError, TableSpec};
use super::writer::TableWriter;
use crate::clock::{monotonic_ns, nanoseconds};
use crate::counters::AlarmStatus;

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

/// A complete table under a temporary name. Dropped without being published, it leaves nothing behind.
pub struct PreparedTable {
    path: PathBuf,
    /// Of each slot.
    identities: Vec<u64>,
    epoch: u64,
    temporary: Temporary,
    mapping: WritableMapping,
    image: Image,
    /// The table that is replaced, and what has been taken over from it so far.
    old: Option<(OldTable, Inheritance)>,
}

impl PreparedTable {
    /// Prepares the table for `path`, with the transitions of the alarm ring there. What lies there stays as it is,
    /// and its daemon may write to it in the meantime, from another thread.
    ///
    /// # Errors
    /// See [`CreateError`].
    pub fn create(path: &Path, spec: &TableSpec, access: &Access) -> Result<Self, CreateError> {
        if access.mode & !0o044 != 0o600 {
            return Err(CreateError::Mode { mode: access.mode });
        }
        let old = OldTable::open(path);
        let now = nanoseconds(SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default());
        let epoch = (old.as_ref()).map_or(now, |old| now.max(old.epoch.saturating_add(1)));
        let directory = Directory {
            spec: spec.clone(),
            epoch,
            boot_id: boot_id(),
            pid: std::process::id(),
            alarm_origin: old.as_ref().and_then(OldTable::alarm_origin).unwrap_or(epoch),
        };
        let image = encode(&directory)?;
        remove_stale(path);
        let temporary = Temporary {
            path: temporary_name(path),
            renamed: false,
        };
        let file = OpenOptions::new()
            .read(true)
            .write(true)
            .create_new(true)
            .mode(0o600)
            .open(&temporary.path)
            .map_err(failed("create", &temporary.path))?;
        let mapping = fill(&file, &image, access, path, &temporary.path)?;
        let identities: Vec<u64> = spec.slots.iter().map(SlotSpec::identity).collect();
        let mut old = old.map(|old| {
            let inheritance = Inheritance::new(&old, &identities);
            (old, inheritance)
        });
        take_over(&mut old, &image, &mapping).map_err(failed(READ_ALARMS, path))?;
        Ok(Self {
            path: path.into(),
            identities,
            epoch,
            temporary,
            mapping,
            image,
            old,
        })
    }

    /// For each diagnoser: where its alarm stands in the table that is replaced, if it is the same there.
    pub fn alarm_status(&self) -> Vec<Option<AlarmStatus>> {
        let mut all = vec![None; self.identities.len()];
        let known = self.old.iter().flat_map(|(_, inheritance)| inheritance.status());
        known.for_each(|(slot, status)| all[slot] = Some(status));
        all
    }

    /// Shows where the alarm of the slot with the index `slot` stands, for clients to find it with the table; what
    /// the table that is replaced shows of the same diagnoser comes before it.
    pub fn show_alarm_status(&self, slot: usize, status: &AlarmStatus) {
        if let Some(place) = self.image.slots.get(slot) {
            store(&self.mapping.words()[place.alarm..], status);
        }
    }

    /// Makes it the table that clients find: takes over the latest transitions of the old one's alarm ring and the
    /// status of its alarms, withdraws the alarms of diagnosers that it does not have, replaces it, and marks it
    /// closed.
    ///
    /// The old table's daemon must not write any more. Allocates nothing; a few system calls, whose number does not
    /// depend on the size of the ring but on how many transitions have come since the preparation.
    ///
    /// # Errors
    /// [`CreateError::Io`]. The older table then stays as it was.
    pub fn publish(mut self) -> Result<TableWriter, CreateError> {
        take_over(&mut self.old, &self.image, &self.mapping).map_err(failed(READ_ALARMS, &self.path))?;
        let words = self.mapping.words();
        if let Some((_, inheritance)) = &self.old {
            let ring = self.image.alarms.ring(words);
            inheritance.withdraw_gone(&ring, self.epoch);
            let futex = self.mapping.futex(self.image.alarms.wake());
            futex.store(WriteWord::load_own(ring.newest) as u32, Ordering::Relaxed);
            for (slot, status) in inheritance.status() {
                let place = self
                    .image
                    .slots
                    .get(slot)
                    .map_or(words.len(), |place| place.alarm);
                store(&words[place..], &status);
            }
        }
        WriteWord::store(&words[header::HEARTBEAT], monotonic_ns());
        fs::rename(&self.temporary.path, &self.path)
            .map_err(failed("move the new bounds table to", &self.path))?;
        self.temporary.renamed = true;
        // Now, and not earlier: a reader that sees the old table closed finds the new one at once.
        if let Some((old, _)) = &self.old {
            // Clients find the new table by now, so there is no way back, and none is needed: a table without
            // heartbeat counts as hung, and its readers look for a new one as they do when it is closed.
            let _ = old.close();
        }
        Ok(TableWriter::new(
            self.mapping,
            self.image,
            self.epoch,
            self.identities,
        ))
    }
}

const READ_ALARMS: &str = "read the alarms of the bounds table at";

/// Takes over the transitions that have come since the last time.
fn take_over(
    old: &mut Option<(OldTable, Inheritance)>,
    image: &Image,
    mapping: &WritableMapping,
) -> io::Result<()> {
    match old {
        Some((old, inheritance)) => inheritance.catch_up(old, &image.alarms.ring(mapping.words())),
        None => Ok(()),
    }
}

fn store<W: WriteWord>(words: &[W], status: &AlarmStatus) {
    for (word, value) in words.iter().zip(status.to_words()) {
        word.store(value);
    }
}

/// Gives the file its memory, its permissions and the words of the directory; maps it.
fn fill(
    file: &File,
    image: &Image,
    access: &Access,
    path: &Path,
    temporary: &Path,
) -> Result<WritableMapping, CreateError> {
    let bytes = image.total_words * WORD_BYTES;
    allocate(file, bytes).map_err(|errno| match errno {
        Errno::ENOSPC => {
            let directory = path.parent().unwrap_or(Path::new("/")).into();
            CreateError::NoSpace { directory, bytes }
        }
        errno => failed("allocate memory for", temporary)(errno.into()),
    })?;
    if let Some(group) = access.group {
        fchown(file, None, Some(group)).map_err(|source| CreateError::Group { group, source })?;
    }
    file.set_permissions(Permissions::from_mode(access.mode))
        .map_err(failed("set the permissions of", temporary))?;
    let mapping = WritableMapping::new(file, image.total_words).map_err(failed("map", temporary))?;
    let words = mapping.words();
    for (word, value) in words.iter().zip(&image.words) {
        WriteWord::store(word, *value);
    }
    WriteWord::store(&words[header::STATE], STATE_RUNNING);
    Ok(mapping)
}

fn failed(step: &'static str, path: &Path) -> impl FnOnce(io::Error) -> CreateError {
    let path = path.to_path_buf();
    move |source| CreateError::Io { step, path, source }
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
pub fn boot_id() -> u128 {
    let text = fs::read_to_string("/proc/sys/kernel/random/boot_id").unwrap_or_default();
    u128::from_str_radix(&text.trim().replace('-', ""), 16).unwrap_or(0)
}
