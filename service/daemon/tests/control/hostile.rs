//! Clients that keep to no protocol, and daemons that do not answer.

use std::fs;
use std::time::{Duration, Instant};

use iceoryx2::prelude::{AllocationStrategy, ServiceName};
use nix::sys::signal::Signal;
use residual_client::{Control, ControlError, RequestError};
use residual_shared::control::{Answer, MAX_REQUEST_BYTES, Request, VERSION, decode_answer, encode_request};
use residual_shared::names::Instance;
use residual_shared::transport::open_node;

use super::support::daemon::Daemon;
use super::support::{DIAGNOSER, Stage, wait_for, wait_until};
use super::{SHORT, control};

/// Sends each of these as a request, and gives the answers.
fn send(instance: &Instance, requests: &[Vec<u8>]) -> Vec<Answer> {
    let node = open_node(instance).unwrap();
    let service = node
        .service_builder(&ServiceName::new(&instance.control_service()).unwrap())
        .request_response::<[u8], [u8]>()
        .open()
        .unwrap();
    let client = service
        .client_builder()
        .initial_max_slice_len(16)
        .allocation_strategy(AllocationStrategy::PowerOfTwo)
        .create()
        .unwrap();
    let ask = |request: &Vec<u8>| {
        let loaned = client.loan_slice_uninit(request.len()).unwrap();
        let pending = loaned.write_from_slice(request).send().unwrap();
        let answer = wait_for("an answer", || pending.receive().unwrap());
        decode_answer(answer.payload()).unwrap()
    };
    requests.iter().map(ask).collect()
}

#[test]
fn garbage_oversized_and_foreign_requests_are_answered_with_an_error_and_counted() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let version = |number: u32| number.to_le_bytes().to_vec();
    let oversized = [version(VERSION), vec![0; MAX_REQUEST_BYTES]].concat();
    let list = encode_request(&Request::List { first: 0 }).unwrap();
    let mut requests = vec![
        vec![],
        vec![7],
        version(VERSION),
        version(VERSION + 1),
        oversized,
        vec![0xff; 1 << 20],
        [list.clone(), vec![0]].concat(),
    ];
    // Every kind of request with bytes that cannot be meant.
    requests.extend((0..20_u32).map(|kind| [version(VERSION), version(kind), vec![0xff; 40]].concat()));
    let answers = send(&stage.instance, &requests);
    let malformed = |answer: &Answer| matches!(answer, Err(ControlError::Malformed { .. }));
    assert!(
        malformed(&answers[0]) && malformed(&answers[1]) && malformed(&answers[2]),
        "{answers:?}"
    );
    let foreign = ControlError::Version {
        daemon: VERSION,
        client: VERSION + 1,
    };
    assert_eq!(answers[3], Err(foreign));
    let bytes = MAX_REQUEST_BYTES as u64 + 4;
    assert_eq!(answers[4], Err(ControlError::TooLong { bytes }));
    assert!(matches!(answers[5], Err(ControlError::Version { .. })));
    assert!(answers[6..].iter().all(malformed), "{answers:?}");

    // The daemon goes on.
    assert!(send(&stage.instance, &[list])[0].is_ok());
    let control = control(&stage);
    control.reset(DIAGNOSER).unwrap();
    let counted = control.list().unwrap().requests;
    assert_eq!((counted.answered, counted.rejected), (2, requests.len() as u64));
    let steps = stage.schedule_counters().steps;
    wait_until("more steps", || stage.schedule_counters().steps > steps + 10);
    assert!(
        daemon.messages().contains("control requests rejected"),
        "{}",
        daemon.messages()
    );
    let summary = daemon.stop();
    assert_eq!(summary.control.rejected, requests.len() as u64);
    assert_eq!(summary.schedule_total("skipped"), 0);
}

/// Stops a daemon and waits until each of its threads stands still: one thread takes the signal and tells the others.
fn freeze(daemon: &Daemon) {
    daemon.signal(Signal::SIGSTOP);
    wait_until("every thread to stand still", || {
        let threads = fs::read_dir(format!("/proc/{}/task", daemon.pid())).unwrap();
        threads.flatten().all(|thread| {
            let status = fs::read_to_string(thread.path().join("status")).unwrap();
            status.contains("State:\tT")
        })
    });
}

#[test]
fn a_stopped_daemon_is_timed_out_and_what_nobody_waits_for_any_more_is_not_obeyed() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    let control = control(&stage).with_timeout(SHORT);
    freeze(&daemon);
    for _ in 0..3 {
        let begin = Instant::now();
        let error = control.reset(DIAGNOSER).unwrap_err();
        assert!(
            matches!(error, RequestError::TimedOut { waited } if waited == SHORT),
            "{error}"
        );
        assert!((SHORT..Duration::from_secs(10)).contains(&begin.elapsed()));
    }
    daemon.signal(Signal::SIGCONT);
    let control = super::control(&stage);
    wait_until("the list", || control.list().is_ok());
    let summary = daemon.stop();
    assert_eq!(summary.control.rejected, 0);
    assert_eq!(summary.control.answered, 1, "the resets were not obeyed");
}

#[test]
fn a_request_to_a_daemon_that_is_killed_before_it_answers_ends_with_an_error() {
    let stage = Stage::new();
    let daemon = Daemon::start(&stage);
    freeze(&daemon);
    let instance = stage.instance.clone();
    let (asking, asks) = std::sync::mpsc::channel();
    let client = std::thread::spawn(move || {
        let control = Control::connect(&instance).unwrap().with_timeout(super::PATIENCE);
        asking.send(()).unwrap();
        (control.list(), Instant::now())
    });
    asks.recv().unwrap();
    std::thread::sleep(SHORT);
    daemon.kill();
    let killed = Instant::now();
    let (outcome, ended) = client.join().unwrap();
    assert!(matches!(outcome, Err(RequestError::DaemonEnded)), "{outcome:?}");
    assert!(ended.duration_since(killed) < super::PATIENCE);
}
