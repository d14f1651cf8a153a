//! One daemon per instance: a lock file that the kernel releases when its holder dies.

use std::fs::{File, TryLockError};
use std::io::{self, Read as _, Seek as _, Write as _};
use std::os::unix::fs::OpenOptionsExt as _;
use std::path::PathBuf;

use residual_shared::names::Instance;

/// Holds the instance for this process.
#[derive(Debug)]
pub struct InstanceLock {
    _file: File,
}

/// Why the instance could not be taken.
#[derive(Debug, thiserror::Error)]
pub enum LockError {
    /// Another daemon runs it.
    #[error(
        "instance `{instance}` is already run by process {pid}; stop that daemon or choose another `instance`"
    )]
    Held {
        /// The instance.
        instance: String,
        /// The other daemon's process number, as it wrote it.
        pid: String,
    },
    /// The runtime directory does not exist.
    #[error(
        "the runtime directory `{directory}` does not exist; create it on a tmpfs, or set another \
         `runtime_directory`"
    )]
    NoDirectory {
        /// The missing directory.
        directory: PathBuf,
    },
    /// The lock file cannot be used.
    #[error("cannot lock `{path}`: {source}; may this user write there, and does another user own the file?")]
    File {
        /// The lock file.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
}

impl InstanceLock {
    /// Takes the instance or says who has it.
    pub fn take(instance: &Instance) -> Result<Self, LockError> {
        let path = instance.lock_path();
        if !instance.runtime_directory.is_dir() {
            return Err(LockError::NoDirectory {
                directory: instance.runtime_directory.clone(),
            });
        }
        let failed = |source| LockError::File {
            path: path.clone(),
            source,
        };
        let mut file = File::options()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .mode(0o600)
            .open(&path)
            .map_err(failed)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                let mut pid = String::new();
                file.read_to_string(&mut pid).map_err(failed)?;
                return Err(LockError::Held {
                    instance: instance.name.to_string(),
                    pid: pid.trim().into(),
                });
            }
            Err(TryLockError::Error(source)) => return Err(failed(source)),
        }
        file.set_len(0).and_then(|()| file.rewind()).map_err(failed)?;
        writeln!(file, "{}", std::process::id()).map_err(failed)?;
        Ok(Self { _file: file })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_daemon_is_told_who_holds_the_instance_and_gets_it_afterwards() {
        let directory = tempfile::tempdir().unwrap();
        let instance = Instance::new("twice".parse().unwrap(), directory.path());
        let first = InstanceLock::take(&instance).unwrap();
        let message = InstanceLock::take(&instance).unwrap_err().to_string();
        assert!(
            message.contains(&format!("process {}", std::process::id())),
            "{message}"
        );
        drop(first);
        InstanceLock::take(&instance).unwrap();
    }
}
