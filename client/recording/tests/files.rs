//! Recordings written and read again.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use std::fs;
use std::io::Cursor;

use common::{alarm, header, record, sample};
use rand::{Rng as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use residual_recording::totals::End;
use residual_recording::{Event, ReadError, Reader, RecordMessage, Totals, Writer};
use residual_shared::alarm::AlarmState;
use residual_shared::record::{Channel, StepRecord};

/// Writes `events` to a file of its own in `directory`.
fn written(directory: &tempfile::TempDir, events: &[Event]) -> std::path::PathBuf {
    let path = directory.path().join("recording.mcap");
    let mut writer = Writer::create(&path, header(), &[0, 1], true).unwrap();
    for event in events {
        match event {
            Event::Record(message) => writer.write_record(message, 5).unwrap(),
            Event::Sample(message) => writer.write_sample(message).unwrap(),
            Event::Alarm(transition) => writer.write_alarm(transition, 5).unwrap(),
        }
    }
    let totals = Totals {
        topics: writer.topics(),
        end: Some(End::Asked),
        ..Totals::default()
    };
    writer.finish(&totals).unwrap();
    path
}

fn read(path: &std::path::Path) -> (Reader, Vec<Event>) {
    let mut reader = Reader::open(path).unwrap();
    let mut events = Vec::new();
    while let Some(event) = reader.next_event().unwrap() {
        events.push(event);
    }
    (reader, events)
}

#[test]
fn records_of_random_bits_come_back_bit_for_bit() {
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let directory = tempfile::tempdir().unwrap();
    let mut number = || f64::from_bits(random.next_u64());
    let records: Vec<RecordMessage> = (0..2_000)
        .map(|sequence| {
            let mut record = StepRecord::new(2);
            record.step = number().to_bits();
            record.instant_ns = number().to_bits();
            record.certainly_faulty = number().to_bits();
            record.possibly_faulty = number().to_bits();
            record.inputs_valid = number().to_bits();
            record.fault_estimate = number();
            record.fault_estimate_half_width = number();
            record.verdict = number().to_bits() as u32;
            record.flags = number().to_bits() as u32;
            record.skipped_instants = number().to_bits() as u32;
            for channel in record.channels_mut() {
                let [lower, residual, upper, ratio] = std::array::from_fn(|_| number());
                *channel = Channel {
                    lower,
                    residual,
                    upper,
                    ratio,
                };
            }
            RecordMessage {
                sequence,
                slot: 0,
                record,
            }
        })
        .collect();
    let events: Vec<Event> = records.iter().copied().map(Event::Record).collect();
    let (_, back) = read(&written(&directory, &events));
    assert_eq!(back.len(), records.len());
    for (back, record) in back.iter().zip(&records) {
        let Event::Record(back) = back else {
            panic!("{back:?}")
        };
        assert!(back.record.same_bits(&record.record), "{back:?} {record:?}");
        assert_eq!((back.sequence, back.slot), (record.sequence, record.slot));
    }
}

#[test]
fn header_samples_and_totals_come_back() {
    let directory = tempfile::tempdir().unwrap();
    let samples = [
        sample(0, 10, &[1.5, -0.0]),
        sample(1, 20, &[f64::NAN, f64::INFINITY]),
        sample(4, 30, &[1.0]),
        sample(3, 31, &[1.0, 2.0, 3.0, -4.5e-300]),
    ];
    let mut events: Vec<Event> = samples.iter().cloned().map(Event::Sample).collect();
    let raised = alarm(AlarmState::Raised);
    events.push(Event::Alarm(raised));
    events.push(Event::Record(record(1, 6)));
    events.push(Event::Record(record(1, 9)));
    let path = written(&directory, &events);
    let (reader, back) = read(&path);
    assert_eq!(reader.header(), &header());
    let alarms = back.iter().filter_map(|event| match event {
        Event::Alarm(transition) => Some(*transition),
        _ => None,
    });
    assert_eq!(alarms.collect::<Vec<_>>(), [raised]);
    for (back, sample) in back.iter().zip(&samples) {
        let Event::Sample(back) = back else {
            panic!("{back:?}")
        };
        let bits = |elements: &[f64]| {
            elements
                .iter()
                .map(|element| element.to_bits())
                .collect::<Vec<_>>()
        };
        assert_eq!(bits(&back.elements), bits(&sample.elements));
        assert_eq!((back.header, back.publisher), (sample.header, sample.publisher));
        assert_eq!(
            (back.looked_ns, back.received_ns),
            (sample.looked_ns, sample.received_ns)
        );
    }
    let totals = reader.totals().unwrap();
    // Number 2 never came, number 3 came late; the instants 7 and 8 have no record.
    let counts = |topic: &str| (totals.topics[topic].messages, totals.topics[topic].missing);
    assert_eq!(counts("/vtol/samples/imu"), (4, 1));
    assert_eq!(counts("/vtol/records/rear"), (2, 2));
    assert_eq!(counts("/vtol/records/front"), (0, 0));
    assert_eq!(totals.end, Some(End::Asked));
    assert!(!reader.is_cut_off());
}

#[test]
fn a_file_cut_at_any_byte_gives_its_whole_chunks_and_never_a_wrong_record() {
    let directory = tempfile::tempdir().unwrap();
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = Writer::new(&mut bytes, header(), &[0, 1], false).unwrap();
    let mut flushed = Vec::new();
    for second in 0..3 {
        for step in 0..4 {
            writer.write_record(&record(0, second * 4 + step), 0).unwrap();
        }
        writer.flush().unwrap();
        flushed.push(4 * (second as usize + 1));
    }
    writer.finish(&Totals::default()).unwrap();
    let bytes = bytes.into_inner();
    let path = directory.path().join("cut.mcap");
    let mut counts = Vec::new();
    for length in (0..bytes.len()).step_by(7) {
        fs::write(&path, &bytes[..length]).unwrap();
        let mut reader = match Reader::open(&path) {
            Ok(reader) => reader,
            Err(ReadError::Foreign(_) | ReadError::Mcap { .. }) => continue,
            Err(error) => panic!("{error}"),
        };
        let mut steps = 0;
        while let Some(Event::Record(message)) = reader.next_event().unwrap() {
            assert!(message.record.same_bits(&record(0, steps).record));
            steps += 1;
        }
        counts.push(steps);
    }
    assert!(counts.is_sorted(), "{counts:?}");
    assert!(
        flushed.iter().all(|count| counts.contains(&(*count as u64))),
        "{counts:?}"
    );
}

#[test]
fn damaged_and_foreign_files_are_refused() {
    let directory = tempfile::tempdir().unwrap();
    let records: Vec<Event> = (0..50).map(|step| Event::Record(record(0, step))).collect();
    let path = written(&directory, &records);
    let mut bytes = fs::read(&path).unwrap();
    // Within the compressed chunk.
    let chunk = bytes.windows(4).position(|four| four == [0x28, 0xb5, 0x2f, 0xfd]);
    bytes[chunk.unwrap() + 200] ^= 0xff;
    fs::write(&path, &bytes).unwrap();
    let mut reader = Reader::open(&path).unwrap();
    let error = loop {
        match reader.next_event() {
            Ok(Some(_)) => {}
            Ok(None) => panic!("the damage was not noticed"),
            Err(error) => break error,
        }
    };
    assert!(error.to_string().contains("damaged"), "{error}");
    fs::write(&path, "t,v\n0,1\n").unwrap();
    assert!(matches!(
        Reader::open(&path),
        Err(ReadError::Mcap { .. } | ReadError::Foreign(_))
    ));
    assert!(matches!(
        Reader::open(directory.path()),
        Err(ReadError::File { .. })
    ));
    let mut foreign = mcap::Writer::new(fs::File::create(&path).unwrap()).unwrap();
    foreign.finish().unwrap();
    assert!(matches!(Reader::open(&path), Err(ReadError::Foreign(_))));
    // A recording that is there already is not written over.
    assert!(Writer::create(&path, header(), &[0], false).is_err());
}
