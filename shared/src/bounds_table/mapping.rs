//! The file as an array of words in memory. The only unsafe code of this crate is here.
#![allow(unsafe_code)]

use std::fs::File;
use std::io;
use std::slice;
use std::sync::atomic::{AtomicU32, AtomicU64, Ordering, fence};

use memmap2::{MmapOptions, MmapRaw};

use super::layout::WORD_BYTES;
use super::protocol::ReadWord;

// Rust defines atomic loads of 8 bytes from read-only memory on 64-bit processors only.
#[cfg(not(target_pointer_width = "64"))]
compile_error!("the bounds table needs a 64-bit processor");

/// A word of a read-only mapping: it offers no store, and only relaxed loads.
#[repr(transparent)]
pub(super) struct ReadOnlyWord(AtomicU64);

impl ReadWord for ReadOnlyWord {
    fn load(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }

    fn acquire_fence() {
        fence(Ordering::Acquire);
    }
}

/// A file mapped to be read and written.
#[derive(Debug)]
pub(super) struct WritableMapping(MmapRaw);

impl WritableMapping {
    /// Maps the first `words` words of `file`, which must be that long, with all pages present.
    pub(super) fn new(file: &File, words: usize) -> io::Result<Self> {
        MmapOptions::new()
            .len(words * WORD_BYTES)
            .populate()
            .map_raw(file)
            .map(Self)
    }

    /// The words.
    pub(super) fn words(&self) -> &[AtomicU64] {
        // SAFETY: the mapping begins at a page boundary (so aligned for words), is `len` bytes long, readable
        // and writable, and lives as long as `self`. Every access, here and in other processes, is atomic, and
        // every bit pattern is a valid AtomicU64.
        unsafe { slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len() / WORD_BYTES) }
    }

    /// The futex in the first four bytes of the word `index`, which nobody accesses as a word.
    pub(super) fn futex(&self, index: usize) -> &AtomicU32 {
        futex(&self.0, index)
    }
}

/// The four bytes at the word `index` of a mapping.
fn futex(mapping: &MmapRaw, index: usize) -> &AtomicU32 {
    assert!(
        index < mapping.len() / WORD_BYTES,
        "word {index} lies outside the mapping"
    );
    // SAFETY: the word lies within the mapping, is aligned, and lives as long as it. Its first four bytes are
    // accessed atomically and as four bytes only, here, in other processes and by the kernel. A reader's mapping is
    // read-only, and readers only load it relaxed, which read-only memory permits, and hand the address to the kernel.
    unsafe {
        &*mapping
            .as_ptr()
            .cast::<AtomicU64>()
            .add(index)
            .cast::<AtomicU32>()
    }
}

/// A file mapped to be read.
#[derive(Debug)]
pub(super) struct ReadOnlyMapping(MmapRaw);

impl ReadOnlyMapping {
    /// Maps the first `words` words of `file`, which must be that long.
    pub(super) fn new(file: &File, words: usize) -> io::Result<Self> {
        MmapOptions::new()
            .len(words * WORD_BYTES)
            .map_raw_read_only(file)
            .map(Self)
    }

    /// The words.
    pub(super) fn words(&self) -> &[ReadOnlyWord] {
        // SAFETY: as for the writable mapping; the memory is read-only, which relaxed loads of 8 bytes (the only
        // access that `ReadOnlyWord` has) permit on 64-bit processors.
        unsafe { slice::from_raw_parts(self.0.as_ptr().cast(), self.0.len() / WORD_BYTES) }
    }

    /// The futex in the first four bytes of the word `index`, to be waited on.
    pub(super) fn futex(&self, index: usize) -> &AtomicU32 {
        futex(&self.0, index)
    }
}
