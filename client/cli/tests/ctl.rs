//! `residual ctl` against a control server that the test runs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::process::{Command, Output};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use residual_shared::control::{
    Alarms, Answer, Changes, ChannelDescription, CheckpointOutcome, ControlError, Counter,
    DiagnoserDescription, DiagnoserEntry, LIST_PAGE, Listing, ReloadOutcome, Request, Response, Which,
};
use residual_shared::names::Instance;
use residual_shared::transport::{self, ControlServer};
use serde_json::{Value, json};
use tempfile::TempDir;

/// More diagnosers than fit on a page of the list.
const DIAGNOSERS: usize = LIST_PAGE + 5;

/// A control server on a thread of its own.
struct Daemon {
    directory: TempDir,
    instance: Instance,
    stop: Arc<AtomicBool>,
    /// Gives the requests it took.
    thread: Option<JoinHandle<Vec<Request>>>,
}

impl Daemon {
    /// With `silent`, requests are taken but not answered.
    fn start(name: &str, silent: bool) -> Self {
        let directory = tempfile::Builder::new()
            .prefix("rct")
            .tempdir_in("/dev/shm")
            .unwrap();
        let name = format!("{name}-{}", std::process::id());
        let instance = Instance::new(name.parse().unwrap(), directory.path());
        let stop = Arc::new(AtomicBool::new(false));
        let (serving, told) = (instance.clone(), Arc::clone(&stop));
        let (ready, wait_ready) = std::sync::mpsc::channel();
        let thread = thread::spawn(move || {
            let node = transport::open_node(&serving).unwrap();
            let mut server = ControlServer::create(&node, &serving).unwrap();
            ready.send(()).unwrap();
            let (mut taken, mut unanswered) = (Vec::new(), Vec::new());
            while !told.load(Ordering::Relaxed) {
                for (request, asker) in server.receive() {
                    taken.push(request.clone());
                    if silent {
                        unanswered.push(asker);
                    } else {
                        server.answer(asker, &answer(request));
                    }
                }
                thread::sleep(Duration::from_millis(1));
            }
            taken
        });
        wait_ready.recv().unwrap();
        Self {
            directory,
            instance,
            stop,
            thread: Some(thread),
        }
    }

    fn ctl(&self, arguments: &[&str]) -> Output {
        ctl(&self.directory, &self.instance.name.to_string(), arguments)
    }

    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.ctl(&[arguments, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", errors(&output));
        serde_json::from_slice(&output.stdout).unwrap()
    }

    fn stop(&mut self) -> Vec<Request> {
        self.stop.store(true, Ordering::Relaxed);
        self.thread
            .take()
            .map_or_else(Vec::new, |thread| thread.join().unwrap())
    }
}

impl Drop for Daemon {
    fn drop(&mut self) {
        self.stop();
        let _ = transport::remove_leftovers(&self.instance);
    }
}

fn ctl(directory: &TempDir, instance: &str, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_residual"))
        .arg("--runtime-directory")
        .arg(directory.path())
        .args(["ctl", "--instance", instance])
        .args(arguments)
        .output()
        .unwrap()
}

fn text(output: &Output) -> String {
    String::from_utf8(output.stdout.clone()).unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8(output.stderr.clone()).unwrap()
}

fn answer(request: Request) -> Answer {
    Ok(match request {
        Request::List { first } => Response::List(Listing {
            instance: "test".into(),
            program: "1.2.3".into(),
            pid: 77,
            epoch: 5,
            log: "info".into(),
            requests: Default::default(),
            total: DIAGNOSERS as u32,
            first,
            diagnosers: (first as usize..DIAGNOSERS).take(LIST_PAGE).map(entry).collect(),
        }),
        Request::Describe { diagnoser } if diagnoser == "front" => Response::Description(description()),
        Request::Describe { diagnoser } => {
            return Err(ControlError::NoSuchDiagnoser {
                name: diagnoser,
                known: "`front`".into(),
            });
        }
        Request::Reset { which } => Response::Reset {
            diagnosers: if which == Which::All { 9 } else { 1 },
        },
        Request::Acknowledge { .. } => Response::Acknowledged { alarms: 1 },
        Request::Checkpoint => Response::Checkpoint(CheckpointOutcome {
            path: "/run/state".into(),
            diagnosers: 2,
            bytes: 345,
        }),
        Request::Reload => Response::Reload(ReloadOutcome {
            diagnosers: Changes {
                unchanged: 1,
                changed: vec!["rear".into()],
                added: vec!["left".into(), "right".into()],
                ..Changes::default()
            },
            inputs: Changes::default(),
        }),
        Request::SetLogLevel { filter } => Response::LogLevel {
            before: "info".into(),
            now: filter,
        },
    })
}

fn entry(slot: usize) -> DiagnoserEntry {
    DiagnoserEntry {
        name: format!("diagnoser{slot}"),
        method: "chi_square".into(),
        period_ns: 2_500_000,
        channels: 3,
        faults: 2,
        steps: 11,
    }
}

fn description() -> DiagnoserDescription {
    DiagnoserDescription {
        name: "front".into(),
        method: "chi_square".into(),
        period_ns: 10_000_000,
        channels: vec![ChannelDescription {
            name: "force".into(),
            unit: "N".into(),
        }],
        faults: vec!["pump".into()],
        lifecycle: vec![("debounce".into(), "2 of 3".into())],
        gains: "from front.gains.toml, verified".into(),
        certificate: vec![("conditions".into(), "4 hold".into())],
        counters: vec![Counter {
            name: "max_step_ns".into(),
            value: 1234,
        }],
        ..DiagnoserDescription::default()
    }
}

#[test]
fn the_list_has_every_diagnoser_of_every_page() {
    let daemon = Daemon::start("ctl-list", false);
    let listing = daemon.json(&["list"]);
    assert_eq!(listing["diagnosers"].as_array().unwrap().len(), DIAGNOSERS);
    assert_eq!(listing["diagnosers"][DIAGNOSERS - 1]["name"], "diagnoser68");
    let shown = text(&daemon.ctl(&["list"]));
    for part in ["process 77", "log `info`", "diagnoser68", "2.5 ms", "0 rejected"] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
}

#[test]
fn a_description_shows_channels_faults_lifecycle_gains_and_counters() {
    let daemon = Daemon::start("ctl-describe", false);
    let shown = text(&daemon.ctl(&["describe", "front"]));
    for part in [
        "force [N]",
        "pump",
        "2 of 3",
        "front.gains.toml",
        "4 hold",
        "max step ns",
        "1234",
    ] {
        assert!(shown.contains(part), "{part}: {shown}");
    }
    assert_eq!(daemon.json(&["describe", "front"])["channels"][0]["unit"], "N");
}

#[test]
fn every_action_sends_its_request_and_shows_the_answer() {
    let mut daemon = Daemon::start("ctl-actions", false);
    for (arguments, shown, as_json) in [
        (
            &["reset", "front"][..],
            "1 diagnoser is reset",
            json!({ "reset": 1 }),
        ),
        (
            &["reset", "--all"],
            "9 diagnosers are reset",
            json!({ "reset": 9 }),
        ),
        (
            &["acknowledge", "front"],
            "1 alarm is acknowledged",
            json!({ "acknowledged": 1 }),
        ),
        (&["acknowledge", "--all"], "1 alarm", json!({ "acknowledged": 1 })),
        (
            &["acknowledge", "--alarm", "7.9"],
            "1 alarm",
            json!({ "acknowledged": 1 }),
        ),
        (
            &["checkpoint"],
            "/run/state (345 bytes)",
            json!({ "path": "/run/state", "diagnosers": 2, "bytes": 345 }),
        ),
        (
            &["reload"],
            "diagnosers: 1 unchanged, changed rear, added left right\ninputs: 0 unchanged\n",
            json!({
                "diagnosers": {
                    "unchanged": 1, "changed": ["rear"], "added": ["left", "right"], "removed": [], "more": 0
                },
                "inputs": { "unchanged": 0, "changed": [], "added": [], "removed": [], "more": 0 }
            }),
        ),
        (
            &["set-log-level", "debug"],
            "`debug` (before: `info`)",
            json!({ "before": "info", "now": "debug" }),
        ),
    ] {
        let output = daemon.ctl(arguments);
        assert!(
            text(&output).contains(shown),
            "{}{}",
            text(&output),
            errors(&output)
        );
        assert_eq!(daemon.json(arguments), as_json);
    }
    let taken = daemon.stop();
    let front = || "front".to_owned();
    for request in [
        Request::Reset {
            which: Which::Diagnoser(front()),
        },
        Request::Reset { which: Which::All },
        Request::Acknowledge {
            alarms: Alarms::Diagnoser(front()),
        },
        Request::Acknowledge { alarms: Alarms::All },
        Request::Acknowledge {
            alarms: Alarms::Number { epoch: 7, number: 9 },
        },
        Request::Checkpoint,
        Request::Reload,
        Request::SetLogLevel {
            filter: "debug".into(),
        },
    ] {
        assert_eq!(
            taken.iter().filter(|taken| **taken == request).count(),
            2,
            "{request:?}"
        );
    }
}

#[test]
fn the_exit_code_tells_refusal_wrong_usage_no_daemon_and_silence_apart() {
    let daemon = Daemon::start("ctl-codes", false);
    let refused = daemon.ctl(&["describe", "rear"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(
        errors(&refused).contains("no diagnoser `rear`; it has `front`"),
        "{}",
        errors(&refused)
    );
    for wrong in [
        &["reset"][..],
        &["reset", "front", "--all"],
        &["acknowledge"],
        &["acknowledge", "--all", "--alarm", "1.2"],
        &["acknowledge", "--alarm", "12"],
        &["list", "--timeout", "0"],
        &["list", "--timeout", "nan"],
        &["explode"],
    ] {
        assert_eq!(daemon.ctl(wrong).status.code(), Some(2), "{wrong:?}");
    }
    let nobody = ctl(&daemon.directory, "nobody", &["list"]);
    assert_eq!(nobody.status.code(), Some(3));
    assert!(
        errors(&nobody).contains("no daemon of instance `nobody`"),
        "{}",
        errors(&nobody)
    );

    let silent = Daemon::start("ctl-silent", true);
    let timed_out = silent.ctl(&["list", "--timeout", "0.2"]);
    assert_eq!(timed_out.status.code(), Some(6));
    assert!(
        errors(&timed_out).contains("no answer within 0.2 s"),
        "{}",
        errors(&timed_out)
    );
}

#[test]
fn the_help_documents_the_exit_codes() {
    let output = Command::new(env!("CARGO_BIN_EXE_residual"))
        .args(["ctl", "--help"])
        .output()
        .unwrap();
    let help = text(&output);
    for part in [
        "set-log-level",
        "6  `ctl`: the daemon did not answer in time",
        "--timeout",
    ] {
        assert!(help.contains(part), "{part}: {help}");
    }
}
