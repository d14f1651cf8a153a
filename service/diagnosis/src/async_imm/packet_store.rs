//! Packets kept in the order of their sampling times, in room allocated once.

use serde::{Deserialize, Serialize};

/// One packet: key (sampling time, source, sequence number) and values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct StoredPacket {
    /// Sampling time, ns.
    pub time_ns: i64,
    /// Number of the sensor.
    pub source: usize,
    /// Sequence number of its publisher.
    pub sequence: u64,
    length: usize,
    values: Box<[f64]>,
}

impl StoredPacket {
    /// The values.
    pub fn values(&self) -> &[f64] {
        self.values.get(..self.length).unwrap_or(&[])
    }

    fn key(&self) -> (i64, usize, u64) {
        (self.time_ns, self.source, self.sequence)
    }
}

/// A list of packets sorted by key, with a fixed capacity.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PacketStore {
    entries: Vec<StoredPacket>,
    used: usize,
}

impl PacketStore {
    /// Room for `capacity` packets of up to `width` values.
    pub fn new(capacity: usize, width: usize) -> Self {
        let empty = StoredPacket {
            time_ns: 0,
            source: 0,
            sequence: 0,
            length: 0,
            values: vec![0.0; width].into_boxed_slice(),
        };
        Self {
            entries: vec![empty; capacity],
            used: 0,
        }
    }

    /// The packets in order.
    pub fn packets(&self) -> &[StoredPacket] {
        self.entries.get(..self.used).unwrap_or(&[])
    }

    /// The packets with `after` < time <= `up_to`, in order.
    pub fn between(&self, after: i64, up_to: i64) -> &[StoredPacket] {
        let packets = self.packets();
        let begin = packets.partition_point(|packet| packet.time_ns <= after);
        let end = packets.partition_point(|packet| packet.time_ns <= up_to);
        packets.get(begin..end).unwrap_or(&[])
    }

    /// Keeps a packet; false if there is no room for it.
    #[must_use]
    pub fn insert(&mut self, time_ns: i64, source: usize, sequence: u64, values: &[f64]) -> bool {
        let Some(entry) = self.entries.get_mut(self.used) else {
            return false;
        };
        let Some(room) = entry.values.get_mut(..values.len()) else {
            return false;
        };
        room.copy_from_slice(values);
        (entry.time_ns, entry.source, entry.sequence) = (time_ns, source, sequence);
        entry.length = values.len();
        let key = entry.key();
        let place = self.packets().partition_point(|packet| packet.key() <= key);
        self.used += 1;
        if let Some(moved) = self.entries.get_mut(place..self.used) {
            moved.rotate_right(1);
        }
        true
    }

    /// Forgets the packets with time <= `time_ns`.
    pub fn remove_until(&mut self, time_ns: i64) {
        let gone = self.packets().partition_point(|packet| packet.time_ns <= time_ns);
        if let Some(used) = self.entries.get_mut(..self.used) {
            used.rotate_left(gone);
        }
        self.used -= gone;
    }

    /// Becomes as it was at first, to the last bit.
    pub fn clear(&mut self) {
        self.used = 0;
        for entry in &mut self.entries {
            (entry.time_ns, entry.source, entry.sequence, entry.length) = (0, 0, 0, 0);
            entry.values.fill(0.0);
        }
    }

    /// Whether a saved store has the room of another, and its packets the number of values that `lengths` gives
    /// for their source.
    pub fn fits(&self, other: &Self, lengths: &[usize]) -> bool {
        let width = |entry: &StoredPacket| entry.values.len();
        self.entries.len() == other.entries.len()
            && self.used <= self.entries.len()
            && self.entries.first().map(width) == other.entries.first().map(width)
            && self
                .entries
                .iter()
                .all(|entry| entry.values.len() == self.entries.first().map_or(0, width))
            && self
                .packets()
                .iter()
                .all(|packet| lengths.get(packet.source) == Some(&packet.length))
            && self
                .packets()
                .windows(2)
                .all(|pair| pair[0].key() <= pair[1].key())
    }
}
