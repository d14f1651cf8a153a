//! Bare words in a file that two processes map: what a benchmark compares the bounds table with.
#![allow(
    unsafe_code,
    reason = "shared memory without anything around it is the peer to compare with"
)]

use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::atomic::{AtomicU32, AtomicU64};

use memmap2::{MmapOptions, MmapRaw};

/// Words of a mapped file.
pub struct SharedWords(MmapRaw);

impl SharedWords {
    /// Maps the file at `path`, readable and writable.
    ///
    /// # Errors
    /// The file cannot be opened or mapped.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = File::options().read(true).write(true).open(path)?;
        MmapOptions::new().populate().map_raw(&file).map(Self)
    }

    /// The word `index`.
    ///
    /// # Panics
    /// It lies outside the file.
    pub fn word(&self, index: usize) -> &AtomicU64 {
        assert!(
            8 * index + 8 <= self.0.len(),
            "word {index} lies outside the file"
        );
        // SAFETY: the word lies within the mapping, which is aligned to pages and lives as long as `self`; all
        // processes access it atomically.
        unsafe { &*self.0.as_mut_ptr().cast::<AtomicU64>().add(index) }
    }

    /// The first four bytes of the word `index`, for a futex; such a word is not used as a whole.
    ///
    /// # Panics
    /// It lies outside the file.
    pub fn half(&self, index: usize) -> &AtomicU32 {
        assert!(
            8 * index + 8 <= self.0.len(),
            "word {index} lies outside the file"
        );
        // SAFETY: as for `word`.
        unsafe {
            &*self
                .0
                .as_mut_ptr()
                .cast::<AtomicU64>()
                .add(index)
                .cast::<AtomicU32>()
        }
    }
}
