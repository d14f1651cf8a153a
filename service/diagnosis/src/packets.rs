//! Single packets with their own time stamps, for methods that fuse sensors without a common clock.

/// Where a packet comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PacketSource {
    /// The sensor of this number, in the order of [`PacketRules::sensor_rows`].
    Sensor(usize),
    /// The commands, all of them, in the order of the model.
    Commands,
}

/// Head of one packet; its values lie in a common list.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PacketHeader {
    /// Where the packet comes from.
    pub source: PacketSource,
    /// Number given by its publisher; a step above 1 is a loss.
    pub sequence: u64,
    /// When the sample was taken, nanoseconds of the clock of the sampling instants.
    pub time_ns: u64,
    /// Where the values begin.
    pub start: usize,
    /// How many values there are.
    pub length: usize,
}

/// One packet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Packet<'a> {
    /// Where the packet comes from.
    pub source: PacketSource,
    /// Number given by its publisher.
    pub sequence: u64,
    /// When the sample was taken, nanoseconds of the clock of the sampling instants.
    pub time_ns: u64,
    /// The values; possibly of a wrong length or not finite.
    pub values: &'a [f64],
}

/// Packets in the order of their arrival.
#[derive(Clone, Copy, Debug, Default)]
pub struct Packets<'a> {
    headers: &'a [PacketHeader],
    values: &'a [f64],
}

impl<'a> Packets<'a> {
    /// Packets whose values lie in `values`; what lies outside of it reads as an empty packet.
    pub fn new(headers: &'a [PacketHeader], values: &'a [f64]) -> Self {
        Self { headers, values }
    }

    /// The packets, one after the other.
    pub fn iter(&self) -> impl Iterator<Item = Packet<'a>> + use<'a> {
        let values = self.values;
        self.headers.iter().map(move |header| Packet {
            source: header.source,
            sequence: header.sequence,
            time_ns: header.time_ns,
            values: values
                .get(header.start..header.start.saturating_add(header.length))
                .unwrap_or(&[]),
        })
    }
}

/// Which packets a method expects.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PacketRules {
    /// Rows of each sensor: sensor 0 measures the first of the diagnoser's measurements, and so on.
    pub sensor_rows: Vec<usize>,
    /// Largest number of packets of one sensor (or of the commands) that one step takes.
    pub max_packets_per_step: usize,
    /// For how many periods a late packet is still used.
    pub rollback_steps: usize,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_outside_of_the_list_read_as_an_empty_packet() {
        let header = |start, length| PacketHeader {
            source: PacketSource::Sensor(0),
            sequence: 0,
            time_ns: 0,
            start,
            length,
        };
        let headers = [header(0, 2), header(1, 2), header(usize::MAX, 2)];
        let packets = Packets::new(&headers, &[1.0, 2.0]);
        let values: Vec<_> = packets.iter().map(|packet| packet.values).collect();
        assert_eq!(values, [&[1.0, 2.0][..], &[], &[]]);
    }
}
