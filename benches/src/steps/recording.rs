//! What the sensors said, over one period.

use nalgebra::DMatrix;
use residual_diagnosis::diagnoser::PacketSource;
use toml::Value;

/// One period of samples.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The sampling period, nanoseconds.
    pub period_ns: u64,
    /// The samples of every instant.
    pub instants: Vec<Sample>,
}

/// The samples of one instant.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// y(t_k).
    pub measurements: Vec<f64>,
    /// u(t_k).
    pub commands: Vec<f64>,
    /// Packets of the interval that ends at t_k, for methods that take packets.
    pub packets: Vec<SentPacket>,
}

/// A packet of one sensor, or of the commands.
#[derive(Clone, Debug)]
pub struct SentPacket {
    /// Where it comes from.
    pub source: PacketSource,
    /// How long before t_k it was taken, nanoseconds.
    pub before_ns: u64,
    /// Its values.
    pub values: Vec<f64>,
}

impl Recording {
    /// One sample of every column of y and u.
    pub fn new(period_ns: u64, outputs: &DMatrix<f64>, commands: &DMatrix<f64>) -> Self {
        let instants = outputs.column_iter().zip(commands.column_iter());
        let sample = |(y, u): (nalgebra::DVectorView<'_, f64>, nalgebra::DVectorView<'_, f64>)| Sample {
            measurements: y.iter().copied().collect(),
            commands: u.iter().copied().collect(),
            packets: Vec::new(),
        };
        Self {
            period_ns,
            instants: instants.map(sample).collect(),
        }
    }
}

/// A matrix as a list of rows.
pub fn rows(matrix: &DMatrix<f64>) -> Value {
    let row =
        |row: nalgebra::MatrixView<'_, f64, nalgebra::U1, nalgebra::Dyn, nalgebra::U1, nalgebra::Dyn>| {
            list(row.iter().copied())
        };
    Value::Array(matrix.row_iter().map(row).collect())
}

/// Numbers as a list.
pub fn list(numbers: impl IntoIterator<Item = f64>) -> Value {
    Value::Array(numbers.into_iter().map(Value::Float).collect())
}
