//! The newest records and all counters as metrics, with names by the conventions of Prometheus: base units, `_total`
//! for counters, one label a dimension.

use std::sync::atomic::AtomicU64;

use prometheus_client::encoding::text::encode;
use prometheus_client::metrics::counter::Counter;
use prometheus_client::metrics::family::Family;
use prometheus_client::metrics::gauge::Gauge;
use prometheus_client::metrics::info::Info;
use prometheus_client::registry::{Registry, Unit};
use residual_client::{
    AlarmState, InputCounters, Instance, Liveness, ReadError, Reading, ScheduleCounters, StepRecord,
    TableReader, Verdict, alarm_flags, monotonic_ns,
};

use super::help;

type Labels = Vec<(&'static str, String)>;
type Numbers = Family<Labels, Gauge<f64, AtomicU64>>;
type Counts = Family<Labels, Counter>;

const VERDICTS: [Verdict; 6] = [
    Verdict::Starting,
    Verdict::Nominal,
    Verdict::Fault,
    Verdict::Isolated,
    Verdict::NotEvaluated,
    Verdict::GuaranteeLost,
];

const ALARM_STATES: [AlarmState; 4] = [
    AlarmState::Cleared,
    AlarmState::Pending,
    AlarmState::Raised,
    AlarmState::Isolated,
];

const FRESHNESS: [&str; 5] = ["fresh", "stale", "not evaluated", "starting", "dead"];

/// Why there are no metrics.
#[derive(Debug, thiserror::Error)]
pub enum MetricsError {
    /// A record cannot be read.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// They cannot be written.
    #[error(transparent)]
    Write(#[from] std::fmt::Error),
}

/// All metrics of an instance at this moment, in the text format of OpenMetrics. Without a table there is only `residual_up`, which is 0.
pub fn text(instance: &Instance) -> Result<String, MetricsError> {
    let mut registry = Registry::with_prefix("residual");
    let build = Info::new([("version", env!("CARGO_PKG_VERSION"))]);
    registry.register("build", "The exporter", build);
    let own = |more: &[(&'static str, &str)]| -> Labels {
        let instance = [("instance", instance.name.to_string())];
        let more = more.iter().map(|(name, value)| (*name, (*value).to_owned()));
        instance.into_iter().chain(more).collect()
    };
    let table = TableReader::open(&instance.bounds_path()).ok();
    let now_ns = monotonic_ns();
    let running = |table: &TableReader| table.liveness(now_ns) == Liveness::Running;
    let up = numbers(&mut registry, "up", "Whether the daemon lives", None);
    set(
        &up,
        own(&[]),
        f64::from(u8::from(table.as_ref().is_some_and(running))),
    );
    if let Some(table) = &table {
        add_daemon(&mut registry, table, now_ns, &own);
        add_diagnosers(&mut registry, table, now_ns, &own)?;
        add_alarms(&mut registry, table, &own)?;
        add_inputs(&mut registry, table, &own)?;
    }
    let mut text = String::new();
    encode(&mut text, &registry)?;
    Ok(text)
}

fn add_daemon(
    registry: &mut Registry,
    table: &TableReader,
    now_ns: u64,
    own: &impl Fn(&[(&'static str, &str)]) -> Labels,
) {
    let age = "Time since the daemon's last sign of life";
    let age = numbers(registry, "daemon_heartbeat_age", age, Some(Unit::Seconds));
    set(&age, own(&[]), table.heartbeat_age(now_ns).as_secs_f64());
    let start = "Start of the daemon's life since 1970";
    let start = numbers(registry, "daemon_start_time", start, Some(Unit::Seconds));
    set(&start, own(&[]), table.directory().epoch as f64 * 1e-9);
}

fn add_diagnosers(
    registry: &mut Registry,
    table: &TableReader,
    now_ns: u64,
    own: &impl Fn(&[(&'static str, &str)]) -> Labels,
) -> Result<(), MetricsError> {
    let channel = |registry: &mut Registry, name, help| numbers(registry, name, help, None);
    let ratio = "Distance to alarm, 1 at the bound; of channels that were evaluated at the latest instant";
    let ratio = channel(registry, "channel_ratio", ratio);
    let residual = channel(registry, "channel_residual", "Residual, in the channel's unit");
    let lower = channel(
        registry,
        "channel_lower_bound",
        "Lower bound of the residual, in the channel's unit",
    );
    let upper = channel(
        registry,
        "channel_upper_bound",
        "Upper bound of the residual, in the channel's unit",
    );
    let verdict = "What the diagnoser concludes: 1 for its present verdict, 0 for the others";
    let verdict = numbers(registry, "diagnoser_verdict", verdict, None);
    let freshness = "What the newest record is worth: 1 for what holds, 0 for the others";
    let freshness = numbers(registry, "diagnoser_freshness", freshness, None);
    let age = "Time since the sampling instant of the newest record, in the daemon's time";
    let age = numbers(registry, "diagnoser_record_age", age, Some(Unit::Seconds));
    let period = "Period of the sampling instants";
    let period = numbers(registry, "diagnoser_period", period, Some(Unit::Seconds));
    let schedule: Vec<Schedule> = ScheduleCounters::NAMES
        .iter()
        .map(|name| Schedule::register(registry, name))
        .collect();

    for (slot, spec) in table.directory().spec.slots.iter().enumerate() {
        let of = |more: &[(&'static str, &str)]| own(&[&[("diagnoser", spec.name.as_str())], more].concat());
        let mut record = StepRecord::new(0);
        let reading = Reading::take(table, slot, &mut record, now_ns)?;
        set(&period, of(&[]), spec.period_ns as f64 * 1e-9);
        for name in FRESHNESS {
            let holds = f64::from(u8::from(reading.freshness.name() == name));
            set(&freshness, of(&[("freshness", name)]), holds);
        }
        for (counter, value) in schedule
            .iter()
            .zip(table.read_schedule_counters(slot)?.to_words())
        {
            counter.set(of(&[]), value);
        }
        if reading.number == 0 {
            continue;
        }
        let time_ns = table.directory().spec.time.from_monotonic(now_ns);
        set(
            &age,
            of(&[]),
            time_ns.saturating_sub(record.instant_ns) as f64 * 1e-9,
        );
        for other in VERDICTS {
            let holds = f64::from(u8::from(record.verdict() == other));
            set(&verdict, of(&[("verdict", other.name())]), holds);
        }
        for (spec, channel) in spec.channels.iter().zip(record.channels()) {
            if !channel.is_evaluated() {
                continue;
            }
            let labels = of(&[("channel", &spec.name), ("unit", &spec.unit)]);
            set(&ratio, of(&[("channel", &spec.name)]), channel.ratio);
            set(&residual, labels.clone(), channel.residual);
            set(&lower, labels.clone(), channel.lower);
            set(&upper, labels, channel.upper);
        }
    }
    Ok(())
}

fn add_alarms(
    registry: &mut Registry,
    table: &TableReader,
    own: &impl Fn(&[(&'static str, &str)]) -> Labels,
) -> Result<(), MetricsError> {
    let state = "Where the alarm of a diagnoser stands: 1 for its present state, 0 for the others";
    let state = numbers(registry, "alarm_state", state, None);
    let latched = "Whether the alarm stays until it is acknowledged";
    let latched = numbers(registry, "alarm_latched", latched, None);
    let occurrences = "How often the alarm has been raised";
    let occurrences = counts(registry, "alarm_occurrences", occurrences);
    let newest = "Number of the newest transition of the alarm, 0 if there has been none";
    let newest = numbers(registry, "alarm_newest_transition", newest, None);
    for (slot, spec) in table.directory().spec.slots.iter().enumerate() {
        let of = |more: &[(&'static str, &str)]| own(&[&[("diagnoser", spec.name.as_str())], more].concat());
        let alarm = table.read_alarm_status(slot)?;
        for other in ALARM_STATES {
            let holds = f64::from(u8::from(alarm.state == other as u64));
            set(&state, of(&[("state", other.name())]), holds);
        }
        let is_latched = alarm.flags & u64::from(alarm_flags::LATCHED) != 0;
        set(&latched, of(&[]), f64::from(u8::from(is_latched)));
        occurrences.get_or_create(&of(&[])).inc_by(alarm.occurrences);
        set(&newest, of(&[]), alarm.number as f64);
    }
    Ok(())
}

fn add_inputs(
    registry: &mut Registry,
    table: &TableReader,
    own: &impl Fn(&[(&'static str, &str)]) -> Labels,
) -> Result<(), MetricsError> {
    let counters: Vec<Counts> = InputCounters::NAMES
        .iter()
        .map(|name| counts(registry, &format!("input_{name}"), help::input(name)))
        .collect();
    for (input, spec) in table.directory().spec.inputs.iter().enumerate() {
        let labels = own(&[("input", spec.name.as_str())]);
        for (counter, value) in counters.iter().zip(table.read_input_counters(input)?.to_words()) {
            counter.get_or_create(&labels).inc_by(value);
        }
    }
    Ok(())
}

/// A schedule counter: a count, or a longest time.
enum Schedule {
    Count(Counts),
    Longest(Numbers),
}

impl Schedule {
    fn register(registry: &mut Registry, name: &'static str) -> Self {
        let help = help::schedule(name);
        match name.strip_suffix("_ns") {
            Some(name) => {
                let name = format!("diagnoser_{name}");
                Self::Longest(numbers(registry, &name, help, Some(Unit::Seconds)))
            }
            None => Self::Count(counts(registry, &format!("diagnoser_{name}"), help)),
        }
    }

    fn set(&self, labels: Labels, value: u64) {
        match self {
            Self::Count(counts) => {
                counts.get_or_create(&labels).inc_by(value);
            }
            Self::Longest(numbers) => set(numbers, labels, value as f64 * 1e-9),
        }
    }
}

fn numbers(registry: &mut Registry, name: &str, help: &str, unit: Option<Unit>) -> Numbers {
    let family = Numbers::default();
    match unit {
        Some(unit) => registry.register_with_unit(name, help, unit, family.clone()),
        None => registry.register(name, help, family.clone()),
    }
    family
}

fn counts(registry: &mut Registry, name: &str, help: &str) -> Counts {
    let family = Counts::default();
    registry.register(name, help, family.clone());
    family
}

fn set(numbers: &Numbers, labels: Labels, value: f64) {
    numbers.get_or_create(&labels).set(value);
}
