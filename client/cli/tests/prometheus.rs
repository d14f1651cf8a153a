//! `residual export prometheus`: its answers, read as Prometheus reads them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod live;

use std::collections::{BTreeMap, BTreeSet};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::process::{Child, Stdio};

use live::Live;
use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;

struct Exporter {
    child: Child,
    address: String,
}

impl Exporter {
    fn start(live: &Live) -> Self {
        let mut command = live.command(&["export", "prometheus", "--listen", "127.0.0.1:0"]);
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let mut said = String::new();
        BufReader::new(child.stderr.take().unwrap())
            .read_line(&mut said)
            .unwrap();
        let address = said
            .split("http://")
            .nth(1)
            .unwrap()
            .split('/')
            .next()
            .unwrap()
            .to_owned();
        Self { child, address }
    }

    /// Head and body of the answer to a request.
    fn ask(&self, request: &str) -> (String, String) {
        self.ask_with(request, "Accept: */*")
    }

    fn ask_with(&self, request: &str, header: &str) -> (String, String) {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(
            stream,
            "{request} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n{header}\r\n\r\n"
        )
        .unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        let (head, body) = answer.split_once("\r\n\r\n").unwrap();
        (head.to_owned(), body.to_owned())
    }

    fn metrics(&self) -> Metrics {
        let accept = "Accept: application/openmetrics-text;version=1.0.0;q=0.8,text/plain;q=0.5";
        let (head, body) = self.ask_with("GET /metrics", accept);
        assert!(head.starts_with("HTTP/1.1 200"), "{head}");
        assert!(head.contains("openmetrics-text"), "{head}");
        parse(&body)
    }
}

impl Drop for Exporter {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

#[derive(Debug)]
struct Metrics {
    /// By name and labels, sorted.
    values: BTreeMap<String, f64>,
    types: BTreeMap<String, String>,
}

impl Metrics {
    fn value(&self, name: &str) -> f64 {
        *self
            .values
            .get(name)
            .unwrap_or_else(|| panic!("no {name} in {:#?}", self.values))
    }
}

/// Reads the text format and checks what its specification demands.
fn parse(text: &str) -> Metrics {
    let mut metrics = Metrics {
        values: BTreeMap::new(),
        types: BTreeMap::new(),
    };
    assert!(text.ends_with("# EOF\n"), "{text}");
    let mut helped = BTreeSet::new();
    for line in text.lines().filter(|line| *line != "# EOF") {
        if let Some(rest) = line.strip_prefix("# ") {
            let mut words = rest.splitn(3, ' ');
            let (kind, name, value) = (
                words.next().unwrap(),
                words.next().unwrap(),
                words.next().unwrap(),
            );
            match kind {
                "HELP" => assert!(helped.insert(name.to_owned()), "{name} twice"),
                "TYPE" => drop(metrics.types.insert(name.into(), value.into())),
                "UNIT" => assert!(name.ends_with(value), "{line}"),
                _ => panic!("{line}"),
            }
            continue;
        }
        let (series, value) = line.rsplit_once(' ').unwrap();
        let name = series.split('{').next().unwrap();
        assert!(
            name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_'),
            "{line}"
        );
        let family = metrics.types.keys().find(|family| {
            let suffix = name.strip_prefix(family.as_str());
            suffix.is_some_and(|suffix| ["", "_total", "_info"].contains(&suffix))
        });
        let family = family.unwrap_or_else(|| panic!("{line} has no type"));
        assert_eq!(
            metrics.types[family] == "counter",
            name.ends_with("_total"),
            "{line}"
        );
        let labels = series.strip_prefix(name).unwrap().trim_matches(['{', '}']);
        let mut labels: Vec<&str> = labels
            .split("\",")
            .map(|label| label.trim_end_matches('"'))
            .collect();
        labels.sort_unstable();
        let series = format!("{name}{{{}}}", labels.join(","));
        let value = value.parse().unwrap_or_else(|_| panic!("{line}"));
        assert!(metrics.values.insert(series, value).is_none(), "{line} twice");
    }
    metrics
}

#[test]
fn metrics_hold_the_newest_record_and_all_counters_by_the_conventions() {
    let mut live = Live::start();
    let exporter = Exporter::start(&live);
    live.send_record(0);
    live.raise_alarm(4);
    let metrics = exporter.metrics();
    let instance = &live.instance.name;
    let own = |name: &str, labels: &str| format!("{name}{{{labels}instance=\"{instance}}}");
    assert_eq!(metrics.value(&own("residual_up", "")), 1.0);
    assert!(metrics.value(&own("residual_daemon_heartbeat_age_seconds", "")) < 20.0);
    let of = |name: &str, more: &str| {
        let mut labels = vec![format!("diagnoser=\"front"), format!("instance=\"{instance}")];
        labels.extend(
            more.split(',')
                .filter(|label| !label.is_empty())
                .map(str::to_owned),
        );
        labels.sort();
        metrics.value(&format!("{name}{{{}}}", labels.join(",")))
    };
    assert_eq!(of("residual_channel_ratio", "channel=\"force"), 0.25);
    assert_eq!(of("residual_channel_residual", "channel=\"force,unit=\"N"), 0.5);
    assert_eq!(
        of("residual_channel_upper_bound", "channel=\"force,unit=\"N"),
        2.0
    );
    assert_eq!(
        of("residual_channel_lower_bound", "channel=\"force,unit=\"N"),
        -2.0
    );
    assert_eq!(of("residual_diagnoser_verdict", "verdict=\"nominal"), 1.0);
    assert_eq!(of("residual_diagnoser_verdict", "verdict=\"fault"), 0.0);
    assert_eq!(of("residual_diagnoser_freshness", "freshness=\"fresh"), 1.0);
    assert_eq!(of("residual_diagnoser_period_seconds", ""), 0.01);
    assert_eq!(of("residual_diagnoser_steps_total", ""), 0.0);
    assert!(of("residual_diagnoser_record_age_seconds", "") < 20.0);
    assert_eq!(of("residual_diagnoser_max_step_seconds", ""), 0.0);
    assert_eq!(of("residual_alarm_state", "state=\"raised"), 1.0);
    assert_eq!(of("residual_alarm_state", "state=\"cleared"), 0.0);
    assert_eq!(of("residual_alarm_latched", ""), 1.0);
    assert_eq!(of("residual_alarm_occurrences_total", ""), 4.0);
    assert!(of("residual_alarm_newest_transition", "") > 0.0);
    let accepted = format!("residual_input_accepted_total{{input=\"imu,instance=\"{instance}}}");
    assert_eq!(metrics.value(&accepted), 0.0);
    assert!(
        metrics
            .values
            .keys()
            .any(|name| name.starts_with("residual_build_info{version="))
    );
    assert_eq!(metrics.types["residual_channel_ratio"], "gauge");
    // `rear` has not said anything yet.
    let rear = metrics
        .values
        .keys()
        .filter(|name| name.contains("verdict") && name.contains("rear"));
    assert_eq!(rear.count(), 0);
}

#[test]
fn the_exporter_survives_the_daemon_and_answers_only_what_it_knows() {
    let mut live = Live::start();
    let mut exporter = Exporter::start(&live);
    assert!(exporter.ask("GET /secret").0.starts_with("HTTP/1.1 404"));
    assert!(exporter.ask("POST /metrics").0.starts_with("HTTP/1.1 405"));
    assert_eq!(exporter.ask("HEAD /metrics").1, "");
    live.close_table();
    let up = format!("residual_up{{instance=\"{}}}", live.instance.name);
    assert_eq!(exporter.metrics().value(&up), 0.0);
    std::fs::remove_file(live.instance.bounds_path()).unwrap();
    let metrics = exporter.metrics();
    assert_eq!(metrics.value(&up), 0.0);
    assert!(!metrics.values.keys().any(|name| name.contains("channel")));
    kill(Pid::from_raw(exporter.child.id().cast_signed()), Signal::SIGTERM).unwrap();
    assert_eq!(exporter.child.wait().unwrap().code(), Some(0));
}

#[test]
fn whoever_does_not_ask_for_openmetrics_gets_the_older_format() {
    let mut live = Live::start();
    let exporter = Exporter::start(&live);
    live.send_record(0);
    let (head, body) = exporter.ask("GET /metrics");
    assert!(head.contains("text/plain; version=0.0.4"), "{head}");
    assert!(
        body.contains("\n# TYPE residual_input_accepted_total counter\n"),
        "{body}"
    );
    assert!(
        body.contains("# HELP residual_input_accepted_total Samples taken into the inbox.\n"),
        "{body}"
    );
    assert!(
        !body.contains("# EOF") && !body.contains("# UNIT") && !body.contains(" info\n"),
        "{body}"
    );
}

#[test]
fn an_instance_without_table_is_told_with_those_that_have_one() {
    let live = Live::start();
    let arguments = [
        "export",
        "prometheus",
        "--listen",
        "127.0.0.1:0",
        "--instance",
        "typo",
    ];
    let mut child = live.command(&arguments).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap())
        .lines()
        .map(Result::unwrap);
    assert!(lines.next().unwrap().contains("metrics of typo"));
    let told = lines.next().unwrap();
    child.kill().unwrap();
    child.wait().unwrap();
    assert!(
        told.contains("residual_up is 0") && told.ends_with(&format!("are {})", live.instance.name)),
        "{told}"
    );
}

#[test]
fn an_address_that_is_taken_is_refused() {
    let live = Live::start();
    let exporter = Exporter::start(&live);
    let output = live
        .command(&["export", "prometheus", "--listen", &exporter.address])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(1));
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("choose another address with --listen"), "{said}");
}
