//! A daemon whose alarms never rest, killed and started again, and eight consumers in Rust, C and Python, some slow, some
//! killed and started again: every consumer saw each transition or reported exactly the missing range.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use hdrhistogram::Histogram;
use residual_client::{AlarmEvent, AlarmListener, AlarmNumber, AlarmStart};
use residual_diagnosis::diagnoser::{Description, Diagnoser, RestoreError, StepInput, Verdict};
use residual_shared::alarm::AlarmTransition;
use residual_shared::bounds_table::{Access, TableReader, TableWriter};
use residual_shared::clock::{DaemonTime, monotonic_ns, sleep_until_monotonic};
use residual_shared::record::{Channel, StepRecord};
use residual_shared::sample::SampleHeader;
use residuald::assembly::{assemble, descriptions, table_spec};
use residuald::configuration::Configuration;
use residuald::runtime::engine::RecordSink;
use support::helper::{Helper, instance, told_to_end};
use support::{Stage, wait_until};

/// Diagnosers of the stress daemon.
const DIAGNOSERS: usize = 8;

/// Environment of the helpers: the configuration, the number of the last transition, the steps of a diagnoser between
/// two transitions, and the consumer's manner.
const CONFIGURATION: &str = "RESIDUALD_STRESS_CONFIGURATION";
const LAST: &str = "RESIDUALD_STRESS_LAST";
const REST: &str = "RESIDUALD_STRESS_REST";
const MANNER: &str = "RESIDUALD_STRESS_MANNER";

/// A diagnoser that does its work and then says something else after every `rest` steps.
struct Restless {
    inner: Box<dyn Diagnoser>,
    /// Steps from one transition to the next.
    rest: u64,
    steps: u64,
}

impl Diagnoser for Restless {
    fn description(&self) -> &Description {
        self.inner.description()
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        self.inner.step(input, record);
        self.steps += 1;
        let (verdict, residual) = if (self.steps / self.rest).is_multiple_of(2) {
            (Verdict::Fault, 2.0)
        } else {
            (Verdict::Nominal, 0.0)
        };
        record.verdict = verdict as u32;
        record.channels_mut().fill(Channel::two_sided(residual, 1.0));
    }

    fn skip(&mut self, record: &mut StepRecord) {
        self.inner.skip(record);
    }

    fn reset(&mut self) {
        self.inner.reset();
    }

    fn boxed_clone(&self) -> Box<dyn Diagnoser> {
        Box::new(Self {
            inner: self.inner.boxed_clone(),
            rest: self.rest,
            steps: self.steps,
        })
    }

    fn save(&self, state: &mut Vec<u8>) {
        self.inner.save(state);
    }

    fn state_size(&self) -> usize {
        self.inner.state_size()
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        self.inner.restore(state)
    }
}

/// Writes to the table, and measures what writing a transition takes.
struct Sink {
    table: TableWriter,
    newest: u64,
    raise_ns: Histogram<u64>,
}

impl RecordSink for Sink {
    fn publish(&mut self, slot: usize, record: &StepRecord) -> bool {
        self.table.publish(slot, record);
        true
    }

    fn alarm(&mut self, transition: &AlarmTransition) {
        let begin = monotonic_ns();
        self.newest = self.table.raise(transition).number;
        self.raise_ns.saturating_record(monotonic_ns() - begin);
    }
}

/// The body of the stress daemon: steps its diagnosers every millisecond until the transition `LAST` is written.
#[test]
#[ignore = "the body of a helper process"]
fn stress_daemon() {
    let Some(instance) = instance() else { return };
    let end = told_to_end();
    let loaded = Configuration::from_file(Path::new(&std::env::var_os(CONFIGURATION).unwrap())).unwrap();
    let number = |name| -> u64 { std::env::var(name).unwrap().parse().unwrap() };
    let (last, rest) = (number(LAST), number(REST));
    let configuration = &loaded.configuration;
    let mut diagnosers = loaded.build_diagnosers().unwrap();
    for built in &mut diagnosers {
        built.diagnoser = Box::new(Restless {
            inner: built.diagnoser.boxed_clone(),
            rest,
            steps: 0,
        });
    }
    let epoch_ns = monotonic_ns();
    let spec = table_spec(
        configuration,
        &descriptions(&diagnosers),
        DaemonTime::MONOTONIC,
        epoch_ns,
    );
    let access = Access {
        group: None,
        mode: 0o600,
    };
    let mut sink = Sink {
        table: TableWriter::create(&instance.bounds_path(), &spec, &access).unwrap(),
        newest: 0,
        raise_ns: Histogram::new_with_bounds(1, 1_000_000_000, 3).unwrap(),
    };
    let mut engine = assemble(configuration, diagnosers, epoch_ns, 1.0);
    let mut sequence = 0;
    while sink.newest < last && !end.load(Ordering::Relaxed) {
        sleep_until_monotonic(engine.next_due_ns().unwrap());
        let now_ns = monotonic_ns();
        for (input, configured) in configuration.inputs.iter().enumerate() {
            let header = SampleHeader {
                sequence,
                timestamp_ns: now_ns,
            };
            engine.accept(input, 1, header, &vec![0.0; configured.signals.len()], now_ns);
        }
        sequence += 1;
        engine.step_due(now_ns, monotonic_ns, &mut sink);
        sink.table.heartbeat(monotonic_ns());
    }
    let show = |name: &str, histogram: &Histogram<u64>| {
        let at = |quantile| histogram.value_at_quantile(quantile);
        println!(
            "{name} p50 {} p99 {} p99.9 {} max {} ns",
            at(0.5),
            at(0.99),
            at(0.999),
            histogram.max()
        );
    };
    show("step", engine.step_times_ns());
    show("raise", &sink.raise_ns);
    while !end.load(Ordering::Relaxed) {
        sink.table.heartbeat(monotonic_ns());
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The body of a consumer in Rust: one line for each event.
#[test]
#[ignore = "the body of a helper process"]
fn consumer() {
    let Some(instance) = instance() else { return };
    let end = told_to_end();
    let manner = std::env::var(MANNER).unwrap();
    let (manner, since) = manner.split_once(' ').unwrap();
    let start = since
        .parse::<AlarmNumber>()
        .map_or(AlarmStart::Oldest, AlarmStart::After);
    let mut listener = AlarmListener::connect(&instance, start);
    let mut heard = 0;
    while !end.load(Ordering::Relaxed) {
        let spin = if manner == "spin" {
            Duration::from_micros(200)
        } else {
            Duration::ZERO
        };
        match listener.wait_spin_then_sleep(spin, Duration::from_millis(50)) {
            Some(AlarmEvent::Transition(alarm)) => println!("{} ", alarm.transition.number),
            Some(AlarmEvent::Gap { first, last }) => println!("GAP: numbers {first} to {last}"),
            Some(other) => println!("UNEXPECTED {other:?}"),
            None => {}
        }
        heard += 1;
        if manner == "slow" && heard % 64 == 0 {
            std::thread::sleep(Duration::from_millis(60));
        }
    }
}

/// A consumer process: how it is started behind a transition.
struct Consumer {
    name: &'static str,
    command: StartBehind,
    /// Whether it is killed now and then.
    killed: bool,
    process: Option<Helper>,
    account: Account,
}

/// A line of a consumer, in whichever language it writes it.
enum Heard {
    Transition { epoch: u64, number: u64 },
    Gap { first: u64, last: u64 },
}

impl Heard {
    /// What the line says; none if it speaks of something else, such as a test's frame.
    fn of(line: &str) -> Option<Self> {
        assert!(
            !line.contains("UNEXPECTED") && !line.contains("begin anew"),
            "{line}"
        );
        let digits = line.split(|character: char| !character.is_ascii_digit());
        let numbers: Vec<u64> = digits.filter_map(|digits| digits.parse().ok()).collect();
        if line.starts_with(|first: char| first.is_ascii_digit()) {
            let [epoch, number, ..] = numbers[..] else {
                panic!("{line}")
            };
            return Some(Self::Transition { epoch, number });
        }
        let is_gap = line.starts_with("GAP") || line.contains("are lost");
        is_gap.then(|| {
            let [.., first, last] = numbers[..] else {
                panic!("{line}")
            };
            Self::Gap { first, last }
        })
    }
}

/// The process of a consumer that goes on behind a transition.
type StartBehind = Box<dyn Fn(&Stage, Option<AlarmNumber>) -> Command>;

/// What a consumer has seen, over all its lives.
#[derive(Debug, Default)]
struct Account {
    /// The number before the first event: what the ring had lost when the consumer came.
    before: Option<u64>,
    /// The last number that was seen or reported missing.
    last: u64,
    /// Epoch of the last transition that was seen.
    epoch: u64,
    epochs: u64,
    seen: u64,
    gaps: u64,
    missing: u64,
}

impl Account {
    /// Takes a line of a consumer; panics if a number was seen twice, left out or reported missing wrongly.
    fn take(&mut self, line: &str) {
        let Some(heard) = Heard::of(line) else { return };
        let (Heard::Transition { number: first, .. } | Heard::Gap { first, .. }) = heard;
        if self.before.is_none() {
            // The first event of all begins with what the ring held when the consumer came.
            (self.before, self.last) = (Some(first - 1), first - 1);
        }
        assert_eq!(first, self.last + 1, "{line}");
        match heard {
            Heard::Transition { epoch, number } => {
                assert!(epoch >= self.epoch, "{line}");
                self.epochs += u64::from(epoch != self.epoch);
                (self.epoch, self.last) = (epoch, number);
                self.seen += 1;
            }
            Heard::Gap { first, last } => {
                assert!(last >= first, "{line}");
                self.last = last;
                self.gaps += 1;
                self.missing += last + 1 - first;
            }
        }
    }

    /// Where a new life of the consumer goes on.
    fn position(&self) -> Option<AlarmNumber> {
        (self.epoch > 0).then_some(AlarmNumber {
            epoch: self.epoch,
            number: self.last,
        })
    }
}

impl Consumer {
    fn rust(name: &'static str, manner: &'static str, killed: bool) -> Self {
        Self::new(name, killed, move |stage, since| {
            let since = since.map_or("oldest".into(), |number| number.to_string());
            let mut command = Helper::command(stage, "consumer");
            command.env(MANNER, format!("{manner} {since}"));
            command
        })
    }

    fn c(name: &'static str, program: PathBuf, killed: bool) -> Self {
        Self::new(name, killed, move |stage, since| {
            let mut command = Command::new(&program);
            command.arg(stage.instance.name.to_string());
            if let Some(number) = since {
                command.args([number.epoch.to_string(), number.number.to_string()]);
            }
            command
        })
    }

    fn python(name: &'static str, killed: bool) -> Self {
        Self::new(name, killed, |stage, since| {
            let mut command = Command::new("python3");
            let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../client/python");
            command
                .env("PYTHONPATH", package)
                .args(["-m", "residual_client", "alarms", "--follow", "--instance"])
                .arg(stage.instance.name.to_string())
                .arg("--since")
                .arg(since.map_or("oldest".into(), |number| number.to_string()));
            command
        })
    }

    fn new(
        name: &'static str,
        killed: bool,
        command: impl Fn(&Stage, Option<AlarmNumber>) -> Command + 'static,
    ) -> Self {
        Self {
            name,
            command: Box::new(command),
            killed,
            process: None,
            account: Account::default(),
        }
    }

    fn start(&mut self, stage: &Stage) {
        let mut command = (self.command)(stage, self.account.position());
        command.env("RESIDUALD_RUNTIME_DIRECTORY", &stage.instance.runtime_directory);
        self.process = Some(Helper::start_command(stage, self.name, &mut command));
    }

    /// Kills the process and takes what it wrote into the account.
    fn stop(&mut self) {
        if let Some(lines) = self.process.take().map(Helper::kill_and_read) {
            lines.iter().for_each(|line| self.account.take(line));
        }
    }

    /// Whether the process has accounted for the transition `last`.
    fn has_reached(&self, last: u64) -> bool {
        let lines = self.process.as_ref().map(Helper::last_lines).unwrap_or_default();
        lines.iter().any(|line| match Heard::of(line) {
            Some(Heard::Transition { number, .. }) => number >= last,
            Some(Heard::Gap { last: number, .. }) => number >= last,
            None => false,
        })
    }
}

/// The C example, if there is a compiler.
fn c_program(stage: &Stage) -> Option<PathBuf> {
    let exists = Command::new("cc")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_ok();
    if !exists {
        eprintln!("SKIPPED: there is no `cc`; no consumer in C");
        return None;
    }
    let binary = Path::new(env!("CARGO_BIN_EXE_residuald"));
    let (profile, target) = (binary.parent().unwrap(), binary.ancestors().nth(2).unwrap());
    let name = profile.file_name().unwrap().to_str().unwrap();
    let package = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../client/c");
    let built = Command::new(env!("CARGO"))
        .args(["build", "--offline", "--quiet", "--profile"])
        .arg(if name == "debug" { "dev" } else { name })
        .arg("--target-dir")
        .arg(target)
        .current_dir(&package)
        .status();
    assert!(built.unwrap().success());
    let program = stage.files.path().join("alarms_in_c");
    let compiled = Command::new("cc")
        .arg("-I")
        .arg(package.join("include"))
        .arg(package.join("examples/alarms.c"))
        .arg(profile.join("libresidual_client.a"))
        .args(["-lpthread", "-ldl", "-lm", "-o"])
        .arg(&program)
        .status();
    assert!(compiled.unwrap().success());
    Some(program)
}

fn has_python() -> bool {
    let exists = Command::new("python3")
        .arg("--version")
        .stdout(Stdio::null())
        .status()
        .is_ok();
    if !exists {
        eprintln!("SKIPPED: there is no `python3`; no consumer in Python");
    }
    exists
}

/// A stage whose diagnosers are stepped every millisecond.
fn stage() -> Stage {
    let mut stage = Stage::new();
    let mut rules = toml::Table::new();
    rules.insert("clear_steps".into(), 1.into());
    stage.set_diagnoser("sample_time_s", 0.001);
    stage.set_diagnoser("lifecycle", rules);
    let first = stage.diagnosers()[0].clone();
    for number in 1..DIAGNOSERS {
        let mut another = first.clone();
        another
            .as_table_mut()
            .unwrap()
            .insert("name".into(), format!("restless_{number}").into());
        stage.diagnosers().push(another);
    }
    stage
}

fn daemon(stage: &Stage, last: u64, rest: u64) -> Helper {
    let mut command = Helper::command(stage, "stress_daemon");
    command
        .env(CONFIGURATION, stage.configuration_file())
        .env(LAST, last.to_string())
        .env(REST, rest.to_string());
    let daemon = Helper::start_command(stage, "stress_daemon", &mut command);
    wait_until("the table of the stress daemon", || {
        TableReader::open(&stage.instance.bounds_path()).is_ok()
    });
    daemon
}

fn newest(stage: &Stage) -> u64 {
    TableReader::open(&stage.instance.bounds_path()).map_or(0, |table| table.newest_alarm())
}

/// Waits longer than other tests do: as long as the transitions go on coming.
fn wait_for_number(stage: &Stage, number: u64) {
    let (mut seen, mut since) = (0, Instant::now());
    while seen < number {
        std::thread::sleep(Duration::from_millis(5));
        let now = newest(stage);
        if now > seen {
            (seen, since) = (now, Instant::now());
        }
        assert!(since.elapsed() < support::PATIENCE, "no transition after {seen}");
    }
}

/// Runs the daemon up to the transition `last`, with `rest` steps of each diagnoser between two of its own, killed and started again halfway, with consumers of all kinds. Gives
/// what the second life of the daemon said of its steps.
fn run(last: u64, rest: u64, with_consumers: bool) -> String {
    let stage = stage();
    let mut consumers = Vec::new();
    if with_consumers {
        consumers.extend([
            Consumer::rust("rust", "sleep", false),
            Consumer::rust("rust_spinning", "spin", false),
            Consumer::rust("rust_slow", "slow", false),
            Consumer::rust("rust_killed", "sleep", true),
        ]);
        if let Some(program) = c_program(&stage) {
            consumers.push(Consumer::c("c", program.clone(), false));
            consumers.push(Consumer::c("c_killed", program, true));
        }
        if has_python() {
            consumers.push(Consumer::python("python", false));
            consumers.push(Consumer::python("python_killed", true));
        }
    }
    let first = daemon(&stage, last, rest);
    consumers.iter_mut().for_each(|consumer| consumer.start(&stage));
    for eighth in 1..8 {
        wait_for_number(&stage, last * eighth / 8);
        if eighth == 4 {
            break;
        }
        restart_some(&stage, &mut consumers);
    }
    first.kill();
    let second = daemon(&stage, last, rest);
    for eighth in 5..8 {
        wait_for_number(&stage, last * eighth / 8);
        restart_some(&stage, &mut consumers);
    }
    wait_for_number(&stage, last);
    let end = newest(&stage);
    for consumer in &mut consumers {
        wait_until(consumer.name, || consumer.has_reached(end));
        consumer.stop();
        let account = &consumer.account;
        assert_eq!(account.last, end, "{}", consumer.name);
        let all = end - account.before.unwrap();
        assert_eq!(account.seen + account.missing, all, "{}", consumer.name);
        assert_eq!(account.epochs, 2, "{}: the restart shows", consumer.name);
    }
    let mut said = String::new();
    for line in second.finish().iter().filter(|line| line.contains(" p50 ")) {
        let _ = writeln!(said, "  {line}");
    }
    for Consumer { name, account, .. } in &consumers {
        let Account {
            seen, gaps, missing, ..
        } = account;
        let _ = writeln!(said, "  {name}: {seen} seen, {missing} missing in {gaps} gaps");
    }
    said
}

fn restart_some(stage: &Stage, consumers: &mut [Consumer]) {
    for consumer in consumers.iter_mut().filter(|consumer| consumer.killed) {
        consumer.stop();
        consumer.start(stage);
    }
}

#[test]
fn every_consumer_accounts_for_every_transition_over_kills_of_both_sides() {
    eprintln!("{}", run(20_000, 1, true));
}

#[test]
#[ignore = "three minutes: cargo test -p residuald --test alarm_stress -- --ignored --nocapture a_million"]
fn a_million_transitions_are_accounted_for() {
    println!("{}", run(1_000_000, 1, true));
}

#[test]
#[ignore = "three minutes: cargo test -p residuald --test alarm_stress -- --ignored --nocapture eight_consumers"]
fn eight_consumers_hear_all_and_the_cost_of_a_step_with_and_without_them_is_shown() {
    // Eight transitions every 100 ms, and at every step; each twice, so that the noise of the machine shows as well.
    for (name, last, rest) in [
        ("80 transitions a second", 1_600, 100),
        ("8,000 transitions a second", 160_000, 1),
    ] {
        for consumers in [false, true, false, true] {
            let with = if consumers { "with" } else { "without" };
            println!("{name}, {with} consumers:\n{}", run(last, rest, consumers));
        }
    }
}
