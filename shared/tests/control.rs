//! Control requests: as bytes, and between a server and clients through real iceoryx2 memory.
#![cfg(feature = "transport")]
#![allow(clippy::unwrap_used, clippy::panic)]

mod common;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use common::place::Place;
use proptest::prelude::*;
use residual_shared::control::{
    Alarms, ControlCounters, ControlError, DecodeError, EncodeError, MAX_ANSWER_BYTES, MAX_REQUEST_BYTES,
    Request, Response, VERSION, Which, decode_answer, decode_request, encode_answer, encode_request,
};
use residual_shared::names::Instance;
use residual_shared::transport::{self, ControlClient, ControlServer, RequestError};

fn requests() -> impl Strategy<Value = Request> {
    let name = ".{0,64}";
    prop_oneof![
        any::<u32>().prop_map(|first| Request::List { first }),
        name.prop_map(|diagnoser| Request::Describe { diagnoser }),
        name.prop_map(|name| Request::Reset {
            which: Which::Diagnoser(name)
        }),
        any::<(u64, u64)>().prop_map(|(epoch, number)| Request::Acknowledge {
            alarms: Alarms::Number { epoch, number }
        }),
        name.prop_map(|filter| Request::SetLogLevel { filter }),
        Just(Request::Checkpoint),
        Just(Request::Reload),
    ]
}

proptest! {
    #[test]
    fn every_request_survives_its_bytes(request in requests()) {
        prop_assert_eq!(decode_request(&encode_request(&request).unwrap()), Ok(request));
    }

    #[test]
    fn random_bytes_are_a_request_or_an_error_but_never_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = (decode_request(&bytes), decode_answer(&bytes));
        // Behind a right version word the bytes get further.
        let versioned = [&VERSION.to_le_bytes()[..], &bytes].concat();
        let _ = (decode_request(&versioned), decode_answer(&versioned));
    }

    #[test]
    fn a_request_with_an_altered_cut_or_added_byte_never_panics(
        request in requests(), place in any::<prop::sample::Index>(), byte in any::<u8>(),
    ) {
        let bytes = encode_request(&request).unwrap();
        let mut altered = bytes.clone();
        altered[place.index(bytes.len())] = byte;
        let _ = decode_request(&altered);
        prop_assert!(decode_request(&bytes[..place.index(bytes.len())]).is_err());
        prop_assert!(decode_request(&[&bytes[..], &[byte]].concat()).is_err());
    }
}

#[test]
fn a_length_that_the_bytes_do_not_have_takes_no_memory_and_is_malformed() {
    // Describe { diagnoser } with a name of 2^63 bytes.
    let bytes = [
        &VERSION.to_le_bytes()[..],
        &1_u32.to_le_bytes(),
        &(1_u64 << 63).to_le_bytes(),
    ]
    .concat();
    assert!(matches!(
        decode_request(&bytes),
        Err(DecodeError::Malformed { .. })
    ));
}

#[test]
fn oversized_requests_and_answers_are_refused_on_both_sides() {
    let longest = |length| Request::Describe {
        diagnoser: "x".repeat(length),
    };
    // Version word, variant, length.
    let fits = MAX_REQUEST_BYTES - 4 - 4 - 8;
    let encoded = encode_request(&longest(fits)).unwrap();
    assert_eq!(encoded.len(), MAX_REQUEST_BYTES);
    assert_eq!(decode_request(&encoded), Ok(longest(fits)));
    assert_eq!(
        encode_request(&longest(fits + 1)),
        Err(EncodeError::TooLong {
            limit: MAX_REQUEST_BYTES
        })
    );
    let bytes = [encoded, vec![0]].concat();
    assert!(matches!(decode_request(&bytes), Err(DecodeError::TooLong { .. })));
    let answer = Err(ControlError::Refused {
        reason: "x".repeat(MAX_ANSWER_BYTES),
    });
    assert!(encode_answer(&answer).is_err());
}

#[test]
fn another_version_is_told_from_garbage() {
    let mut bytes = encode_request(&Request::Reload).unwrap();
    bytes[0] += 1;
    let error = decode_request(&bytes).unwrap_err();
    assert_eq!(error, DecodeError::Version { theirs: VERSION + 1 });
    assert!(
        error.to_string().contains("use a client of the daemon's release"),
        "{error}"
    );
    assert!(matches!(
        decode_request(&[1, 2]),
        Err(DecodeError::TooShort { bytes: 2 })
    ));
}

/// A server on a thread of its own that answers every request with one that tells which it was.
struct Serving {
    stop: Arc<AtomicBool>,
    thread: JoinHandle<ControlCounters>,
}

impl Serving {
    fn start(instance: &Instance) -> Self {
        let (stop, instance) = (Arc::new(AtomicBool::new(false)), instance.clone());
        let told = Arc::clone(&stop);
        let (ready, wait_ready) = std::sync::mpsc::channel();
        let thread = thread::spawn(move || {
            let node = transport::open_node(&instance).unwrap();
            let mut server = ControlServer::create(&node, &instance).unwrap();
            ready.send(()).unwrap();
            while !told.load(Ordering::Relaxed) {
                for (request, asker) in server.receive() {
                    let answer = match request {
                        Request::SetLogLevel { filter } => Ok(Response::LogLevel {
                            before: String::new(),
                            now: filter,
                        }),
                        // Longer than an answer may be.
                        Request::Describe { .. } => Ok(Response::LogLevel {
                            before: String::new(),
                            now: "x".repeat(MAX_ANSWER_BYTES),
                        }),
                        _ => Err(ControlError::Stopping),
                    };
                    server.answer(asker, &answer);
                }
                thread::sleep(Duration::from_millis(1));
            }
            server.counters()
        });
        wait_ready.recv().unwrap();
        Self { stop, thread }
    }

    fn finish(self) -> ControlCounters {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

const PATIENCE: Duration = Duration::from_secs(20);

fn echo(client: &ControlClient, text: String) {
    let request = Request::SetLogLevel { filter: text.clone() };
    match client.request(&request, PATIENCE).unwrap() {
        Response::LogLevel { now, .. } => assert_eq!(now, text),
        other => panic!("{other:?}"),
    }
}

#[test]
fn clients_at_once_each_get_their_own_answers() {
    let place = Place::new("ctl-many");
    let server = Serving::start(&place.instance);
    let clients = (0..4).map(|number| {
        let instance = place.instance.clone();
        thread::spawn(move || {
            let client = ControlClient::connect(&instance).unwrap();
            for request in 0..50 {
                echo(&client, format!("{number}-{request}"));
            }
        })
    });
    for client in clients.collect::<Vec<_>>() {
        client.join().unwrap();
    }
    let counters = server.finish();
    assert_eq!((counters.answered, counters.rejected), (200, 0));
}

#[test]
fn errors_and_answers_that_are_too_long_arrive_as_errors() {
    let place = Place::new("ctl-errors");
    let server = Serving::start(&place.instance);
    let client = ControlClient::connect(&place.instance).unwrap();
    let refused = client.request(&Request::Reload, PATIENCE).unwrap_err();
    assert!(
        matches!(refused, RequestError::Refused(ControlError::Stopping)),
        "{refused}"
    );
    let diagnoser = "x".into();
    let refused = client
        .request(&Request::Describe { diagnoser }, PATIENCE)
        .unwrap_err();
    assert!(
        matches!(refused, RequestError::Refused(ControlError::AnswerTooLong)),
        "{refused}"
    );
    assert_eq!(server.finish().answered, 2);
}

#[test]
fn without_a_server_a_request_is_not_possible_and_without_an_answer_it_times_out() {
    let place = Place::new("ctl-none");
    let error = ControlClient::connect(&place.instance).unwrap_err();
    assert!(matches!(error, RequestError::NoDaemon { .. }), "{error}");
    assert!(error.to_string().contains("start residuald"), "{error}");

    // A server that takes nothing.
    let node = transport::open_node(&place.instance).unwrap();
    let mut server = ControlServer::create(&node, &place.instance).unwrap();
    let client = ControlClient::connect(&place.instance).unwrap();
    let timeout = Duration::from_millis(150);
    for _ in 0..5 {
        let begin = Instant::now();
        let error = client.request(&Request::Checkpoint, timeout).unwrap_err();
        assert!(
            matches!(error, RequestError::TimedOut { waited } if waited == timeout),
            "{error}"
        );
        assert!((timeout..PATIENCE).contains(&begin.elapsed()));
    }
    assert_eq!(
        server.receive().len(),
        0,
        "the client does not wait for them any more"
    );
}
