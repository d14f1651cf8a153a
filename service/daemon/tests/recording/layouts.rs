//! The layouts in `deploy/dashboards` name only what a recording of the example holds.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use residual_recording::recorder::{self, Stream};
use residual_shared::clock::{monotonic_ns, sleep_until_monotonic};
use serde_json::Value;

use super::support::daemon::Daemon;
use super::support::publisher::Drivers;
use super::support::{PERIOD_NS, Stage};

const FOXGLOVE: &str = include_str!("../../../../deploy/dashboards/vtol.foxglove.json");
const PLOT_JUGGLER: &str = include_str!("../../../../deploy/dashboards/vtol.plotjuggler.xml");

/// The schema and one message of each topic in a recording of the example, whose instance is called `vtol` again.
fn topics() -> BTreeMap<String, (Value, Option<Value>)> {
    let stage = Stage::new();
    let path = stage.files.path().join("example.mcap");
    let daemon = Daemon::start(&stage);
    let mut stream = Stream::open(&stage.instance, true).unwrap();
    let end = AtomicBool::new(false);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let mut drivers = Drivers::open(&stage.instance);
            let start_ns = monotonic_ns();
            for k in 0..30 {
                sleep_until_monotonic(start_ns + k * PERIOD_NS);
                drivers.send(k, start_ns + k * PERIOD_NS);
            }
            std::thread::sleep(Duration::from_millis(50));
            end.store(true, Ordering::Relaxed);
        });
        recorder::record(&mut stream, &path, &[0], None, &end).unwrap();
    });
    daemon.stop();
    let bytes = std::fs::read(&path).unwrap();
    let own = format!("/{}/", stage.instance.name);
    let summary = mcap::Summary::read(&bytes).unwrap().unwrap();
    let mut topics = BTreeMap::new();
    for channel in summary.channels.values() {
        let schema = serde_json::from_slice(&channel.schema.as_ref().unwrap().data).unwrap();
        topics.insert(channel.topic.replacen(&own, "/vtol/", 1), (schema, None));
    }
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        let topic = message.channel.topic.replacen(&own, "/vtol/", 1);
        topics.get_mut(&topic).unwrap().1 = Some(serde_json::from_slice(&message.data).unwrap());
    }
    topics
}

/// Topic and fields of a path that begins with a topic, behind which `separator` stands.
fn assert_exists(topics: &BTreeMap<String, (Value, Option<Value>)>, path: &str, separator: char) {
    let found = topics.iter().find_map(|(topic, content)| {
        let fields = path.strip_prefix(topic.as_str())?;
        Some((content, fields.strip_prefix(separator).unwrap_or(fields)))
    });
    let ((schema, message), fields) =
        found.unwrap_or_else(|| panic!("no topic of {path} in {:?}", topics.keys()));
    let (mut schema, mut message) = (schema, message.as_ref());
    for field in fields.split(separator).filter(|field| !field.is_empty()) {
        schema = &schema["properties"][field];
        assert!(schema.is_object(), "{path}: the schema has no `{field}`");
        message = message.map(|message| {
            let value = message.get(field);
            value.unwrap_or_else(|| panic!("{path}: no `{field}` in {message}"))
        });
    }
}

#[test]
fn the_layouts_name_only_what_a_recording_of_the_example_holds() {
    let topics = topics();
    assert!(topics["/vtol/records/aircraft_actuators"].1.is_some());
    assert!(topics["/vtol/samples/aircraft_sensors"].1.is_some());

    let layout: Value = serde_json::from_str(FOXGLOVE).unwrap();
    let panels = layout["configById"].as_object().unwrap();
    let mut count = 0;
    for (name, panel) in panels {
        assert!(
            layout["layout"].to_string().contains(name.as_str()),
            "`{name}` is not shown"
        );
        let paths = panel["paths"]
            .as_array()
            .into_iter()
            .flatten()
            .map(|path| &path["value"]);
        for path in paths.chain(panel.get("topicPath")) {
            assert_exists(&topics, path.as_str().unwrap(), '.');
            count += 1;
        }
    }
    assert!(count >= 15, "{count} paths");

    let curves: Vec<&str> = PLOT_JUGGLER
        .split("<curve name=\"")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap())
        .collect();
    assert!(curves.len() >= 15, "{curves:?}");
    for curve in curves {
        assert_exists(&topics, curve, '/');
    }
}
