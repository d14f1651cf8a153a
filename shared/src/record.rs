//! The step record: all that a diagnoser says at one sampling instant.
//!
//! Fixed size, integers and floats only, so that it can lie in memory shared with other processes.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

/// Largest number of channels in one record.
///
/// 64 rows hold a bank of two single-fault filters with every row, parity window and fault estimate (30) and
/// a thermal loop with six modes in its compact form; a record stays within one 4 KiB page.
pub const MAX_CHANNELS: usize = 64;

/// Largest number of faults that the bit sets of a record can name.
pub const MAX_FAULTS: usize = 64;

/// One row of a record: a residual between its bounds.
#[repr(C)]
#[cfg_attr(feature = "transport", derive(ZeroCopySend))]
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Channel {
    /// Lower bound of the residual, in the channel's unit.
    pub lower: f64,
    /// The residual, in the channel's unit.
    pub residual: f64,
    /// Upper bound of the residual, in the channel's unit.
    pub upper: f64,
    /// Normalised distance to alarm: 1 at the bound, above 1 (or infinite) beyond it. NaN: not evaluated at
    /// this instant; the other three are then 0.
    pub ratio: f64,
}

impl Channel {
    /// A channel that was not evaluated at this instant.
    pub const NOT_EVALUATED: Self = Self {
        lower: 0.0,
        residual: 0.0,
        upper: 0.0,
        ratio: f64::NAN,
    };

    /// A channel with the bounds `-half_width` and `half_width` around zero.
    ///
    /// The ratio is `|residual| / half_width`, and infinite when a residual stands against a zero half width.
    pub fn two_sided(residual: f64, half_width: f64) -> Self {
        let ratio = if residual == 0.0 {
            0.0
        } else {
            residual.abs() / half_width
        };
        Self {
            lower: -half_width,
            residual,
            upper: half_width,
            ratio,
        }
    }

    /// An estimate with its guaranteed radius; it has no alarm, its ratio is 0.
    pub fn estimate(centre: f64, radius: f64) -> Self {
        Self {
            lower: centre - radius,
            residual: centre,
            upper: centre + radius,
            ratio: 0.0,
        }
    }

    /// Whether the channel was evaluated at this instant.
    pub fn is_evaluated(&self) -> bool {
        !self.ratio.is_nan()
    }
}

/// What a diagnoser concludes at one sampling instant.
#[repr(u32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Verdict {
    /// No complete input has arrived yet.
    Starting = 0,
    /// Evaluated, no fault.
    Nominal = 1,
    /// A fault is detected but not isolated.
    Fault = 2,
    /// The faulty component is known.
    Isolated = 3,
    /// Nothing could be tested at this instant, for want of a valid input.
    NotEvaluated = 4,
    /// The method can guarantee nothing until it has been reset.
    GuaranteeLost = 5,
}

impl Verdict {
    /// The verdict with this number, if there is one.
    pub fn from_number(number: u32) -> Option<Self> {
        Some(match number {
            0 => Self::Starting,
            1 => Self::Nominal,
            2 => Self::Fault,
            3 => Self::Isolated,
            4 => Self::NotEvaluated,
            5 => Self::GuaranteeLost,
            _ => return None,
        })
    }

    /// The name shown to people and written to files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Starting => "starting",
            Self::Nominal => "nominal",
            Self::Fault => "fault",
            Self::Isolated => "isolated",
            Self::NotEvaluated => "not evaluated",
            Self::GuaranteeLost => "guarantee lost",
        }
    }
}

/// Bits of [`StepRecord::flags`].
pub mod flags {
    /// Instants were skipped between the previous record and this one (see `skipped_instants`).
    pub const INSTANTS_SKIPPED: u32 = 1 << 0;
    /// The step began later than one period after its sampling instant.
    pub const OVERRUN: u32 = 1 << 1;
    /// At least one sample that this step should have used was missing.
    pub const INPUT_MISSING: u32 = 1 << 2;
    /// A sample for an earlier instant arrived after that instant had been stepped.
    pub const LATE_SAMPLE: u32 = 1 << 3;
    /// A test alarmed at this very instant (a latched verdict stays after it).
    pub const ALARM_NOW: u32 = 1 << 4;
    /// The diagnoser was reset, wholly or in part, at this instant.
    pub const RESET: u32 = 1 << 5;
    /// A fault of the configured size could not be detected with the present thresholds.
    pub const THRESHOLD_INERT: u32 = 1 << 6;

    /// The names of the flags that are set, as shown to people and written to files.
    pub fn names(set: u32) -> impl Iterator<Item = &'static str> {
        let names = [
            (INSTANTS_SKIPPED, "instants skipped"),
            (OVERRUN, "overrun"),
            (INPUT_MISSING, "input missing"),
            (LATE_SAMPLE, "late sample"),
            (ALARM_NOW, "alarm now"),
            (RESET, "reset"),
            (THRESHOLD_INERT, "threshold inert"),
        ];
        names
            .into_iter()
            .filter(move |(flag, _)| set & flag != 0)
            .map(|(_, name)| name)
    }
}

/// What a diagnoser says at one sampling instant.
///
/// Faults are counted from 0 in the order of the diagnoser's fault names; bit j of a fault set is fault j.
#[repr(C)]
#[cfg_attr(
    feature = "transport",
    derive(ZeroCopySend),
    type_name("residual.StepRecord.v1")
)]
#[derive(Clone, Copy, Debug)]
pub struct StepRecord {
    /// Number of the sampling instant since the daemon's epoch.
    pub step: u64,
    /// The sampling instant t_k, nanoseconds of the daemon's time.
    pub instant_ns: u64,
    /// Faults that are certainly present while the verdict is [`Verdict::Isolated`] or [`Verdict::Fault`].
    pub certainly_faulty: u64,
    /// Faults that may be present.
    pub possibly_faulty: u64,
    /// Bit i: element i of measurements followed by commands was received for this instant.
    pub inputs_valid: u64,
    /// Estimate of the isolated fault, in the unit of its actuator or sensor; NaN when there is none.
    pub fault_estimate: f64,
    /// Half width of the guaranteed interval, or standard deviation, of the estimate; NaN when there is none.
    pub fault_estimate_half_width: f64,
    /// [`Verdict`] as a number.
    pub verdict: u32,
    /// Bits of [`flags`].
    pub flags: u32,
    /// Instants skipped between the previous record and this one.
    pub skipped_instants: u32,
    /// How many of `channels` are used; constant for one diagnoser.
    pub channel_count: u32,
    /// The channels; those from `channel_count` on are not used.
    pub channels: [Channel; MAX_CHANNELS],
}

impl StepRecord {
    /// An empty record with `channel_count` channels (at most [`MAX_CHANNELS`]), verdict `Starting`.
    pub fn new(channel_count: usize) -> Self {
        Self {
            step: 0,
            instant_ns: 0,
            certainly_faulty: 0,
            possibly_faulty: 0,
            inputs_valid: 0,
            fault_estimate: f64::NAN,
            fault_estimate_half_width: f64::NAN,
            verdict: Verdict::Starting as u32,
            flags: 0,
            skipped_instants: 0,
            channel_count: channel_count.min(MAX_CHANNELS) as u32,
            channels: [Channel::NOT_EVALUATED; MAX_CHANNELS],
        }
    }

    /// The used channels.
    pub fn channels(&self) -> &[Channel] {
        &self.channels[..(self.channel_count as usize).min(MAX_CHANNELS)]
    }

    /// The used channels, to be written.
    pub fn channels_mut(&mut self) -> &mut [Channel] {
        let count = (self.channel_count as usize).min(MAX_CHANNELS);
        &mut self.channels[..count]
    }

    /// The verdict; a number that no verdict has (a foreign writer) reads as `NotEvaluated`.
    pub fn verdict(&self) -> Verdict {
        Verdict::from_number(self.verdict).unwrap_or(Verdict::NotEvaluated)
    }

    /// The evaluated channel with the largest ratio and its index.
    pub fn worst_channel(&self) -> Option<(usize, &Channel)> {
        self.channels()
            .iter()
            .enumerate()
            .filter(|(_, channel)| channel.is_evaluated())
            .max_by(|(_, left), (_, right)| left.ratio.total_cmp(&right.ratio))
    }

    /// Whether two records agree in every bit, unused channels left aside.
    pub fn same_bits(&self, other: &Self) -> bool {
        let head = |r: &Self| {
            (
                [
                    r.step,
                    r.instant_ns,
                    r.certainly_faulty,
                    r.possibly_faulty,
                    r.inputs_valid,
                ],
                [r.fault_estimate.to_bits(), r.fault_estimate_half_width.to_bits()],
                [r.verdict, r.flags, r.skipped_instants, r.channel_count],
            )
        };
        let bits = |c: &Channel| [c.lower, c.residual, c.upper, c.ratio].map(f64::to_bits);
        head(self) == head(other)
            && self
                .channels()
                .iter()
                .map(bits)
                .eq(other.channels().iter().map(bits))
    }
}

/// The names of the faults in a set, of a diagnoser with these faults.
pub fn fault_names(faults: &[String], set: u64) -> impl Iterator<Item = &str> {
    faults
        .iter()
        .take(MAX_FAULTS)
        .enumerate()
        .filter(move |(bit, _)| set >> bit & 1 == 1)
        .map(|(_, name)| name.as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_record_fits_into_one_page() {
        assert!(size_of::<StepRecord>() <= 4096);
    }

    #[test]
    fn every_verdict_survives_its_number() {
        for number in 0..6 {
            assert_eq!(Verdict::from_number(number).map(|v| v as u32), Some(number));
        }
        assert_eq!(Verdict::from_number(6), None);
    }

    #[test]
    fn the_ratio_is_one_at_the_bound_and_infinite_against_a_zero_bound() {
        assert_eq!(Channel::two_sided(-0.5, 0.5).ratio, 1.0);
        assert_eq!(Channel::two_sided(1e-300, 0.0).ratio, f64::INFINITY);
        assert_eq!(Channel::two_sided(0.0, 0.0).ratio, 0.0);
    }
}
