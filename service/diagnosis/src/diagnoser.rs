//! What every diagnosis method offers to the scheduler.

pub use crate::packets::{Packet, PacketHeader, PacketRules, PacketSource, Packets};
pub use crate::state::RestoreError;
pub use residual_shared::record::{Channel, StepRecord, Verdict, flags};

/// What one step sees. NaN stands for an element that was not received.
#[derive(Clone, Copy, Debug)]
pub struct StepInput<'a> {
    /// The sampling instant t_k, nanoseconds of the clock that stamps the packets.
    pub instant_ns: u64,
    /// y(t_k): the measured outputs of this instant, in the order and units of the model.
    pub measurements: &'a [f64],
    /// u(t_k): the commands received for this instant, in the order and units of the model; they act from t_k
    /// until t_{k+1}.
    pub commands: &'a [f64],
    /// Every packet that arrived since the last step, for methods that asked for them
    /// ([`Description::packets`]).
    pub packets: Packets<'a>,
}

impl<'a> StepInput<'a> {
    /// The input of a method that needs neither time nor packets.
    pub fn new(measurements: &'a [f64], commands: &'a [f64]) -> Self {
        Self {
            instant_ns: 0,
            measurements,
            commands,
            packets: Packets::default(),
        }
    }
}

/// Name and unit of one channel of a diagnoser's records.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ChannelDescription {
    /// Name, unique within the diagnoser.
    pub name: String,
    /// Unit of the bounds and the residual; empty when the model states none.
    pub unit: String,
}

/// What stays constant over a diagnoser's life.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Description {
    /// The method, as written in the configuration.
    pub method: &'static str,
    /// The channels of every record, in order; at most [`residual_shared::record::MAX_CHANNELS`].
    pub channels: Vec<ChannelDescription>,
    /// The faults that the fault sets of a record speak of, in the order of their bits; at most 64.
    pub faults: Vec<String>,
    /// Number of measured outputs a step expects.
    pub measurement_count: usize,
    /// Number of commands a step expects.
    pub command_count: usize,
    /// Which packets a step expects; `None` for methods that use the samples of the sampling instant only.
    pub packets: Option<PacketRules>,
}

/// Bit i: element i of the measurements followed by the commands was received; bits beyond 63 are left out.
///
/// A slice of a wrong length counts as missing as a whole.
pub fn inputs_valid(description: &Description, measurements: &[f64], commands: &[f64]) -> u64 {
    let (ny, nu) = (description.measurement_count, description.command_count);
    let measured = measurements
        .iter()
        .filter(|_| measurements.len() == ny)
        .enumerate();
    let commanded = commands
        .iter()
        .filter(|_| commands.len() == nu)
        .enumerate()
        .map(|(j, value)| (ny + j, value));
    measured
        .chain(commanded)
        .filter(|(bit, value)| *bit < 64 && value.is_finite())
        .fold(0, |bits, (bit, _)| bits | 1 << bit)
}

/// A configured diagnosis method on one plant.
///
/// The scheduler calls [`Diagnoser::step`] once per sampling instant, in order and without gaps unless it says
/// so with [`Diagnoser::skip`]. After construction no method allocates, blocks or panics.
pub trait Diagnoser: Send {
    /// What stays constant: channels, faults, dimensions.
    fn description(&self) -> &Description;

    /// Does the step of one sampling instant and writes everything it concludes into `record`.
    ///
    /// The implementation writes verdict, fault sets, fault estimate, channels and the flags that it knows of
    /// (ALARM_NOW, RESET, THRESHOLD_INERT, INPUT_MISSING are set with `|=`); step number, instant and
    /// scheduling flags are the caller's. Slices of a wrong length count as missing as a whole.
    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord);

    /// Tells that one sampling instant passes without a step, as if every sample of it were missing.
    fn skip(&mut self, record: &mut StepRecord);

    /// Returns to the state right after construction.
    fn reset(&mut self);

    /// A second diagnoser with the same configuration and the same state.
    fn boxed_clone(&self) -> Box<dyn Diagnoser>;

    /// Appends the whole state to `state`; restored into a diagnoser of the same configuration it goes on exactly
    /// as this one. Allocates only if `state` has no room for [`Diagnoser::state_size`] more bytes.
    fn save(&self, state: &mut Vec<u8>);

    /// How many bytes [`Diagnoser::save`] would append now.
    fn state_size(&self) -> usize;

    /// Takes over a saved state.
    ///
    /// # Errors
    /// [`RestoreError`] if the bytes are not a state of a diagnoser with this configuration; nothing has changed
    /// then.
    fn restore(&mut self, state: &[u8]) -> Result<(), RestoreError>;
}
