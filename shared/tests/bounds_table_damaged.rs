//! Damaged, foreign and forged files: an error or a readable table, never a panic or an access outside the file.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;
use std::path::Path;

use common::{OWN, directory, slot, spec};
use proptest::prelude::*;
use residual_shared::bounds_table::{OpenError, TableReader, TableWriter, layout};
use residual_shared::record::{MAX_CHANNELS, StepRecord};

/// The words of a table with two diagnosers, one record each.
fn sound_words(path: &Path) -> Vec<u64> {
    let mut writer = TableWriter::create(path, &spec(vec![slot("a", 2), slot("b", 5)]), &OWN).unwrap();
    writer.publish(0, &StepRecord::new(2));
    writer.publish(1, &StepRecord::new(5));
    common::words(path)
}

/// Opens the file and, if that succeeds, reads everything in it.
fn read_all(path: &Path) -> Result<(), OpenError> {
    let reader = TableReader::open(path)?;
    let mut record = StepRecord::new(0);
    for index in 0..reader.directory().spec.slots.len() {
        let _ = reader.read(index, &mut record);
        assert!(record.channels().len() <= MAX_CHANNELS);
        let _ = record.verdict();
        reader.read_schedule_counters(index).unwrap();
    }
    for index in 0..reader.directory().spec.inputs.len() {
        reader.read_input_counters(index).unwrap();
    }
    let _ = reader.liveness(1);
    Ok(())
}

/// Values that break careless arithmetic, and arbitrary ones.
fn nasty_word() -> impl Strategy<Value = u64> {
    prop_oneof![
        any::<u64>(),
        0..4096u64,
        Just(u64::MAX),
        Just(u64::MAX - 7),
        Just(1 << 63),
        Just(u64::MAX << 32),
        (0..64u32, 0..300u64).prop_map(|(words, length)| (u64::from(words) * 8) | (length << 32)),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1_000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn any_flipped_byte_of_the_directory_is_noticed(position in any::<prop::sample::Index>(), flip in 1..=255u8) {
        let directory = directory();
        let path = directory.path().join("bounds");
        let words = sound_words(&path);
        let mut bytes = fs::read(&path).unwrap();
        let position = position.index(words[layout::header::DIRECTORY_BYTES] as usize);
        bytes[position] ^= flip;
        fs::write(&path, bytes).unwrap();
        let changes = [layout::header::STATE, layout::header::HEARTBEAT].contains(&(position / 8));
        prop_assert_eq!(read_all(&path).is_ok(), changes, "byte {}", position);
    }

    #[test]
    fn a_forged_directory_gives_an_error_or_a_table_within_the_file(
        changes in prop::collection::vec((any::<prop::sample::Index>(), nasty_word()), 1..4),
        in_entries in any::<bool>(),
    ) {
        let directory = directory();
        let path = directory.path().join("bounds");
        let mut words = sound_words(&path);
        // Half of the cases aim at the header and the entries, where the offsets are.
        let entries = layout::header::WORDS + 2 * layout::slot_entry::WORDS + layout::input_entry::WORDS;
        let range = if in_entries { entries } else { words.len() };
        for (position, word) in changes {
            words[position.index(range)] = word;
        }
        common::sign(&mut words);
        common::write(&path, &words);
        let _ = read_all(&path);
    }

    #[test]
    fn a_file_cut_off_anywhere_is_refused(length in any::<prop::sample::Index>()) {
        let directory = directory();
        let path = directory.path().join("bounds");
        sound_words(&path);
        let mut bytes = fs::read(&path).unwrap();
        bytes.truncate(length.index(bytes.len()));
        fs::write(&path, &bytes).unwrap();
        match read_all(&path) {
            Err(OpenError::NotATable { .. }) => prop_assert!(bytes.len() < 8 * layout::header::WORDS),
            Err(OpenError::Truncated { actual, .. }) => prop_assert_eq!(actual, bytes.len() as u64),
            other => prop_assert!(false, "{:?}", other),
        }
    }

    #[test]
    fn arbitrary_bytes_are_no_table(bytes in prop::collection::vec(any::<u8>(), 0..2_000)) {
        let directory = directory();
        let path = directory.path().join("bounds");
        fs::write(&path, bytes).unwrap();
        let outcome = read_all(&path);
        prop_assert!(matches!(outcome, Err(OpenError::NotATable { .. })), "{:?}", outcome);
    }

    #[test]
    fn any_words_in_the_slots_can_be_read(words_behind in prop::collection::vec(any::<u64>(), 64)) {
        let directory = directory();
        let path = directory.path().join("bounds");
        let mut words = sound_words(&path);
        let start = words[layout::header::DIRECTORY_BYTES] as usize / 8;
        for (word, value) in words[start..].iter_mut().zip(words_behind.iter().cycle()) {
            *word = *value;
        }
        common::write(&path, &words);
        prop_assert!(read_all(&path).is_ok());
    }
}

#[test]
fn each_kind_of_wrong_file_has_its_own_error() {
    let directory = directory();
    let path = directory.path().join("bounds");
    assert!(matches!(
        TableReader::open(&path),
        Err(OpenError::NotFound { .. })
    ));
    assert!(matches!(
        TableReader::open(directory.path()),
        Err(OpenError::NotATable { .. })
    ));
    nix::unistd::mkfifo(&path, nix::sys::stat::Mode::S_IRWXU).unwrap();
    assert!(matches!(
        TableReader::open(&path),
        Err(OpenError::NotATable { .. })
    ));
    fs::remove_file(&path).unwrap();

    let sound = sound_words(&path);
    let with = |field: usize, value: u64| {
        let mut words = sound.clone();
        words[field] = value;
        common::write(&path, &words);
        TableReader::open(&path).unwrap_err()
    };
    assert!(matches!(
        with(layout::header::MAGIC, 0),
        OpenError::NotATable { .. }
    ));
    assert!(matches!(
        with(layout::header::VERSION, layout::VERSION + 1),
        OpenError::OtherLayout { version, .. } if version == layout::VERSION + 1
    ));
    assert!(matches!(
        with(layout::header::HASH, 1),
        OpenError::OtherLayout { hash: 1, .. }
    ));
    assert!(matches!(
        with(layout::header::DIRECTORY_BYTES, u64::MAX),
        OpenError::Damaged { .. }
    ));
    assert!(matches!(
        with(layout::header::TOTAL_BYTES, u64::MAX),
        OpenError::Truncated { .. }
    ));
    assert!(matches!(
        with(layout::header::PID, u64::MAX),
        OpenError::Damaged { .. }
    ));
}
