//! Room for iceoryx2's shared memory, made sure of before it is used.
//!
//! iceoryx2 makes its segments sparse: on a full file system the first write to a page without memory kills the
//! process with SIGBUS. So a process first looks whether there is room for the small segments, and then gives
//! the large ones, once they stand, all of their memory.

use std::fs::File;
use std::io;
use std::path::Path;

use nix::errno::Errno;
use nix::fcntl::{OFlag, posix_fallocate};
use nix::sys::statvfs::statvfs;
use std::os::unix::fs::OpenOptionsExt;

use super::{SHARED_MEMORY, TransportError, management_files};
use crate::names::Instance;

/// What the management files of a node with some dozen services need at most, bytes.
const SMALL_SEGMENTS: u64 = 256 * 1024;

/// Checks that the small segments of a node fit into the runtime directory and into the shared memory.
pub(super) fn check(instance: &Instance) -> Result<(), TransportError> {
    for directory in [&*instance.runtime_directory, Path::new(SHARED_MEMORY)] {
        // A file system that tells nothing, or has no limit, is tried.
        let Ok(status) = statvfs(directory) else { continue };
        let available = status.blocks_available() * status.fragment_size();
        if status.blocks() > 0 && available < SMALL_SEGMENTS {
            return Err(TransportError::NoRoom {
                directory: directory.into(),
                bytes: SMALL_SEGMENTS,
            });
        }
    }
    Ok(())
}

/// Gives every segment of the instance all of its memory. Writing to it cannot fail afterwards.
pub(super) fn reserve(instance: &Instance) -> Result<(), TransportError> {
    for path in management_files(instance) {
        let failed = |source| TransportError::Directory {
            path: path.clone(),
            source,
        };
        let file = match File::options()
            .write(true)
            .custom_flags(OFlag::O_NOFOLLOW.bits())
            .open(&path)
        {
            Ok(file) => file,
            // Its process has removed it in the meantime.
            Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
            Err(error) => return Err(failed(error)),
        };
        let bytes = file.metadata().map_err(failed)?.len();
        loop {
            match posix_fallocate(&file, 0, bytes.cast_signed()) {
                Err(Errno::EINTR) => {}
                // An empty segment is one that its process is about to make.
                Ok(()) | Err(Errno::EINVAL) => break,
                Err(Errno::ENOSPC) => {
                    return Err(TransportError::NoRoom {
                        directory: SHARED_MEMORY.into(),
                        bytes,
                    });
                }
                Err(errno) => return Err(failed(errno.into())),
            }
        }
    }
    Ok(())
}
