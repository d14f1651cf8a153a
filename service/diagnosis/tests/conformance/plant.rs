//! Simulated plants: fault-free they keep the assumptions of the method under test.

use nalgebra::{DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::diagnoser::{PacketHeader, PacketSource};

/// A packet before the instants are known.
#[derive(Clone, Copy, Debug)]
pub struct RelativePacket {
    /// Where it comes from.
    pub source: PacketSource,
    /// Its number.
    pub sequence: u64,
    /// When it was taken, as a part of the interval that ends at the instant, in (0, 1]; below 0 it is late.
    pub moment: f64,
    /// Where its values begin.
    pub start: usize,
    /// How many there are.
    pub length: usize,
}

/// What the sensors send for one instant.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// y(t_k), NaN where nothing came.
    pub measurements: Vec<f64>,
    /// u(t_k), NaN where nothing came.
    pub commands: Vec<f64>,
    /// Packets of the interval that ends at t_k, for methods that take packets.
    pub packets: Vec<RelativePacket>,
    /// Their values.
    pub packet_values: Vec<f64>,
}

impl Sample {
    /// The packets with their stamps.
    pub fn headers(&self, instant_ns: u64, period_ns: u64) -> Vec<PacketHeader> {
        let stamp = |moment: f64| {
            let before_ns = ((1.0 - moment) * period_ns as f64) as u64;
            instant_ns - before_ns.min(instant_ns)
        };
        let header = |packet: &RelativePacket| PacketHeader {
            source: packet.source,
            sequence: packet.sequence,
            time_ns: stamp(packet.moment),
            start: packet.start,
            length: packet.length,
        };
        self.packets.iter().map(header).collect()
    }

    /// Nothing at all came.
    pub fn lose_everything(&mut self) {
        self.measurements.fill(f64::NAN);
        self.commands.fill(f64::NAN);
        self.packets.clear();
    }
}

/// A plant with its sensors and its controller.
pub trait Plant {
    /// The next sample; with `faulty` the fault acts on this instant (and on the transition that follows it).
    fn next(&mut self, faulty: bool) -> Sample;
}

/// How noise and disturbance are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Noise {
    /// Uniform or at the corners of ± the given half widths.
    Bounded,
    /// Normal with the given standard deviations.
    Gaussian,
}

/// Random numbers of one seed.
pub struct Draw {
    generator: ChaCha8Rng,
    noise: Noise,
}

impl Draw {
    /// Numbers of this seed.
    pub fn new(seed: u64, noise: Noise) -> Self {
        Self {
            generator: ChaCha8Rng::seed_from_u64(seed),
            noise,
        }
    }

    /// One number of this size (half width or standard deviation).
    pub fn number(&mut self, size: f64) -> f64 {
        match self.noise {
            Noise::Bounded if self.generator.random::<bool>() => {
                self.generator.random_range(-1.0..=1.0) * size
            }
            Noise::Bounded if self.generator.random::<bool>() => size,
            Noise::Bounded => -size,
            Noise::Gaussian => {
                // Box and Muller.
                let radius = (-2.0 * (1.0 - self.generator.random::<f64>()).ln()).sqrt();
                size * radius * (std::f64::consts::TAU * self.generator.random::<f64>()).cos()
            }
        }
    }

    /// One number per size.
    pub fn vector(&mut self, sizes: &[f64]) -> DVector<f64> {
        DVector::from_fn(sizes.len(), |i, _| self.number(sizes[i]))
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.generator.random::<f64>() < probability
    }
}

/// x(k+1) = A x + B (u + f) + D d, y = C x + F u + v + s, u a slow square wave.
pub struct LinearPlant {
    /// A, n x n.
    pub a: DMatrix<f64>,
    /// B, n x m.
    pub b: DMatrix<f64>,
    /// C, p x n.
    pub c: DMatrix<f64>,
    /// F, p x m: feedthrough of the commands.
    pub feedthrough: DMatrix<f64>,
    /// D, n x q.
    pub d: DMatrix<f64>,
    /// Sizes of d.
    pub disturbance: Vec<f64>,
    /// Sizes of v.
    pub noise: Vec<f64>,
    /// Amplitude of the commands.
    pub command: Vec<f64>,
    /// f while faulty.
    pub actuator_fault: Vec<f64>,
    /// s while faulty.
    pub sensor_fault: Vec<f64>,
    /// The state.
    pub state: DVector<f64>,
    /// Its randomness.
    pub draw: Draw,
    /// Probability that one element of y is lost.
    pub loss: f64,
    /// Steps done.
    pub k: usize,
}

impl Plant for LinearPlant {
    fn next(&mut self, faulty: bool) -> Sample {
        let sign = if (self.k / 40).is_multiple_of(2) {
            1.0
        } else {
            -1.0
        };
        let u = DVector::from_column_slice(&self.command) * sign;
        let mut y = &self.c * &self.state + &self.feedthrough * &u + self.draw.vector(&self.noise);
        let mut acting = u.clone();
        if faulty {
            y += DVector::from_column_slice(&self.sensor_fault);
            acting += DVector::from_column_slice(&self.actuator_fault);
        }
        let disturbance = self.draw.vector(&self.disturbance);
        self.state = &self.a * &self.state + &self.b * acting + &self.d * disturbance;
        self.k += 1;
        for value in y.iter_mut() {
            if self.draw.chance(self.loss) {
                *value = f64::NAN;
            }
        }
        Sample {
            measurements: y.as_slice().to_vec(),
            commands: u.as_slice().to_vec(),
            ..Sample::default()
        }
    }
}
