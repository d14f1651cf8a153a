//! Files that are written: never in the place of one that is there.

use std::fs::{self, File};
use std::io;
use std::path::Path;

use crate::error::Error;

/// Creates the file, which must not be there yet.
pub fn create(path: &Path) -> Result<File, Error> {
    File::create_new(path).map_err(|source| failed(path, source))
}

/// Refuses a file that is there, so that of several none is written if one cannot be.
pub fn refuse_existing(path: &Path) -> Result<(), Error> {
    // A dangling link counts as well: no new file can be made there.
    match path.symlink_metadata() {
        Ok(_) => Err(failed(path, io::ErrorKind::AlreadyExists.into())),
        Err(_) => Ok(()),
    }
}

/// Refuses a file that could not be created; leaves none.
pub fn check(path: &Path) -> Result<(), Error> {
    create(path)?;
    fs::remove_file(path).map_err(|source| failed(path, source))
}

/// Why the file was not created.
fn failed(path: &Path, source: io::Error) -> Error {
    Error::Create {
        path: path.into(),
        source,
    }
}
