//! Samples and records between two nodes of one process, through real iceoryx2 memory.
#![cfg(feature = "transport")]
#![allow(clippy::unwrap_used)]

mod common;

use common::place::Place;
use residual_shared::record::StepRecord;
use residual_shared::sample::SampleHeader;
use residual_shared::transport::{
    self, RecordAudience, RecordPublisher, RecordSubscriber, SamplePublisher, SampleSubscriber,
    TransportError,
};

#[test]
fn samples_arrive_with_their_header_in_order_and_of_any_length() {
    let place = Place::new("samples");
    let node = transport::open_node(&place.instance).unwrap();
    let subscriber = SampleSubscriber::create(&node, &place.instance, "imu", 8, 2).unwrap();
    let other = transport::open_node(&place.instance).unwrap();
    let mut publisher = SamplePublisher::open(&other, &place.instance, "imu").unwrap();
    publisher.send(10, &[1.0, f64::NAN]).unwrap();
    publisher.skip();
    publisher.send(20, &[3.0]).unwrap();
    let mut seen = Vec::new();
    subscriber.receive(|_, header, elements| seen.push((header, elements.to_vec())));
    assert_eq!(
        seen[0].0,
        SampleHeader {
            sequence: 0,
            timestamp_ns: 10
        }
    );
    assert!(seen[0].1[1].is_nan());
    assert_eq!(
        seen[1],
        (
            SampleHeader {
                sequence: 2,
                timestamp_ns: 20
            },
            vec![3.0]
        )
    );
    assert!(publisher.send(30, &[0.0; 65]).is_err());
}

#[test]
fn a_slow_receiver_loses_the_oldest_and_the_sender_never_waits() {
    let place = Place::new("overflow");
    let node = transport::open_node(&place.instance).unwrap();
    let subscriber = SampleSubscriber::create(&node, &place.instance, "imu", 4, 1).unwrap();
    let mut publisher = SamplePublisher::open(&node, &place.instance, "imu").unwrap();
    for instant in 0..10 {
        publisher.send(instant, &[instant as f64]).unwrap();
    }
    let mut sequences = Vec::new();
    subscriber.receive(|_, header, _| sequences.push(header.sequence));
    assert_eq!(sequences, [6, 7, 8, 9]);
}

#[test]
fn a_publisher_without_daemon_is_told_to_start_one() {
    let place = Place::new("lonely");
    let node = transport::open_node(&place.instance).unwrap();
    let error = SamplePublisher::open(&node, &place.instance, "imu")
        .err()
        .unwrap();
    assert!(matches!(error, TransportError::NoService { .. }), "{error}");
    assert!(error.to_string().contains("start residuald"));
}

#[test]
fn records_reach_a_recorder_whole() {
    let place = Place::new("records");
    let node = transport::open_node(&place.instance).unwrap();
    let mut publisher = RecordPublisher::create(&node, &place.instance).unwrap();
    let recorder = RecordSubscriber::open(&node, &place.instance).unwrap();
    let mut sent = StepRecord::new(3);
    sent.step = 7;
    sent.channels_mut()[2].residual = 0.25;
    publisher.send(9, 5, &sent).unwrap();
    let mut count = 0;
    recorder.receive(|header, record| {
        assert_eq!((header.sequence, header.epoch, header.slot), (0, 9, 5));
        assert!(record.same_bits(&sent));
        count += 1;
    });
    assert_eq!(count, 1);
}

#[test]
fn an_audience_is_there_from_the_first_recorder_to_the_last() {
    let place = Place::new("audience");
    let node = transport::open_node(&place.instance).unwrap();
    assert!(RecordAudience::open(&node, &place.instance).is_err());
    let _publisher = RecordPublisher::create(&node, &place.instance).unwrap();
    let audience = RecordAudience::open(&node, &place.instance).unwrap();
    assert!(audience.is_empty());
    let other = transport::open_node(&place.instance).unwrap();
    let recorders = [(); 2].map(|()| RecordSubscriber::open(&other, &place.instance).unwrap());
    for recorder in recorders {
        assert!(!audience.is_empty());
        drop(recorder);
    }
    assert!(audience.is_empty());
}

#[test]
fn management_memory_is_closed_to_strangers_and_leftovers_can_be_removed() {
    use std::os::unix::fs::PermissionsExt;
    let place = Place::new("modes");
    let prefix = place.instance.iceoryx_prefix();
    let files = || -> Vec<_> {
        let entries = std::fs::read_dir("/dev/shm").unwrap().flatten();
        entries
            .filter(|entry| entry.file_name().to_string_lossy().starts_with(&prefix))
            .collect()
    };
    let node = transport::open_node(&place.instance).unwrap();
    assert!(!files().is_empty());
    for file in files() {
        assert_eq!(
            file.metadata().unwrap().permissions().mode() & 0o007,
            0,
            "{:?}",
            file.path()
        );
    }
    transport::remove_leftovers(&place.instance).unwrap();
    assert!(!files().is_empty(), "a living node keeps its memory");
    drop(node);
    transport::remove_leftovers(&place.instance).unwrap();
    assert!(files().is_empty());
    assert!(!place.instance.iceoryx_root().exists());
}
