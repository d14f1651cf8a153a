//! An instance of its own for tests with real iceoryx2 memory.
#![cfg(feature = "transport")]

use residual_shared::names::Instance;
use residual_shared::transport;
use tempfile::TempDir;

/// An instance of its own on a tmpfs, removed at the end.
pub struct Place {
    pub instance: Instance,
    _directory: TempDir,
}

impl Place {
    /// The instance is called `name` and the number of the process: a short one, for paths of sockets.
    pub fn new(name: &str) -> Self {
        let directory = tempfile::Builder::new()
            .prefix("rs")
            .tempdir_in("/dev/shm")
            .unwrap();
        let name = format!("{name}-{}", std::process::id());
        Self {
            instance: Instance::new(name.parse().unwrap(), directory.path()),
            _directory: directory,
        }
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        transport::remove_leftovers(&self.instance).unwrap();
    }
}
