//! Width of the bounds against time: the diagnoser is stepped from its start with all signals at zero.

use residual_chart::{Chart, Curve};
use residual_diagnosis::diagnoser::{
    Channel, Description, Diagnoser, PacketHeader, PacketSource, Packets, StepInput, StepRecord,
};
use residual_diagnosis::method::Designed;

/// Instants that are shown.
const INSTANTS: usize = 200;
/// More curves would hide each other: the widest at the end are shown.
const CURVES: usize = 12;

/// Upper minus lower bound of each channel from the start on.
pub(super) fn chart(name: &str, sample_time_s: f64, designed: &Designed) -> Option<Chart> {
    let mut diagnoser = designed.diagnoser.boxed_clone();
    diagnoser.reset();
    let records = stepped(diagnoser.as_mut(), sample_time_s);
    let channels = &designed.diagnoser.description().channels;
    let mut curves: Vec<Curve> = channels
        .iter()
        .enumerate()
        .map(|(index, channel)| Curve {
            name: match channel.unit.as_str() {
                "" => channel.name.clone(),
                unit => format!("{} [{unit}]", channel.name),
            },
            points: records
                .iter()
                .enumerate()
                .filter(|(_, channels)| channels.get(index).is_some_and(Channel::is_evaluated))
                .map(|(k, channels)| {
                    (
                        k as f64 * sample_time_s,
                        channels[index].upper - channels[index].lower,
                    )
                })
                .collect(),
        })
        .filter(|curve| curve.points.iter().any(|(_, width)| *width > 0.0))
        .collect();
    let settled = |curve: &Curve| curve.points.last().map_or(0.0, |point| point.1);
    curves.sort_by(|a, b| settled(b).total_cmp(&settled(a)));
    curves.truncate(CURVES);
    (!curves.is_empty()).then(|| Chart {
        title: format!("{name}: width of the bounds, all signals at zero"),
        x: "time from the start, s".to_owned(),
        y: "upper minus lower bound".to_owned(),
        curves,
        ..Chart::default()
    })
}

/// The channels of each instant.
fn stepped(diagnoser: &mut dyn Diagnoser, sample_time_s: f64) -> Vec<Vec<Channel>> {
    let description = diagnoser.description().clone();
    let measurements = vec![0.0; description.measurement_count];
    let commands = vec![0.0; description.command_count];
    let mut record = StepRecord::new(description.channels.len());
    let mut all = Vec::with_capacity(INSTANTS);
    for k in 0..INSTANTS {
        let instant_ns = ((k + 1) as f64 * sample_time_s * 1e9).round() as u64;
        let (headers, values) = packets(&description, k as u64, instant_ns);
        let input = StepInput {
            instant_ns,
            measurements: &measurements,
            commands: &commands,
            packets: Packets::new(&headers, &values),
        };
        diagnoser.step(&input, &mut record);
        all.push(record.channels().to_vec());
    }
    all
}

/// One packet of zeros of every sensor, and one of the commands, for methods that take packets.
fn packets(description: &Description, sequence: u64, time_ns: u64) -> (Vec<PacketHeader>, Vec<f64>) {
    let Some(rules) = &description.packets else {
        return (Vec::new(), Vec::new());
    };
    let mut sources: Vec<(PacketSource, usize)> = rules
        .sensor_rows
        .iter()
        .enumerate()
        .map(|(sensor, rows)| (PacketSource::Sensor(sensor), *rows))
        .collect();
    if description.command_count > 0 {
        sources.insert(0, (PacketSource::Commands, description.command_count));
    }
    let longest = sources.iter().map(|(_, length)| *length).max().unwrap_or(0);
    let headers = sources.into_iter().map(|(source, length)| PacketHeader {
        source,
        sequence,
        time_ns,
        start: 0,
        length,
    });
    (headers.collect(), vec![0.0; longest])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Configuration;

    fn chart_of(text: &str) -> Chart {
        let loaded = Configuration::from_text("example", text).unwrap();
        let designed = loaded.design(&mut |_, _| ()).unwrap().diagnosers.remove(0);
        chart(
            "example",
            loaded.configuration.diagnosers[0].sample_time_s(),
            &designed,
        )
        .unwrap()
    }

    #[test]
    fn widths_start_large_where_the_initial_state_is_uncertain_and_settle() {
        let servo = chart_of(include_str!("../../../../deploy/config/servo.toml"));
        let outputs = servo
            .curves
            .iter()
            .filter(|curve| curve.name.starts_with("output"));
        for curve in outputs {
            let (first, last) = (curve.points[0].1, curve.points.last().unwrap().1);
            assert!(first > last && last > 0.0, "{curve:?}");
        }
    }

    #[test]
    fn a_method_that_takes_packets_is_stepped_with_packets() {
        let target = chart_of(include_str!("../../../../deploy/config/turning_target.toml"));
        assert!(target.shows_anything());
    }
}
