//! The last samples of one mode, kept for its parity tests (method sheet 4.4).

use crate::matrix::Matrix;
use crate::model::LinearModel;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A ring of the last n + 1 samples: measurements, commands and bounds of the state.
///
/// Every sample is stored twice, one capacity apart, so that any run of recent samples is one slice. Nothing is
/// allocated after construction.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ParityWindow {
    capacity: usize,
    /// Where the newest sample lies, below `capacity`.
    newest: usize,
    /// Number of consecutive complete samples up to the newest, at most `capacity`.
    complete: usize,
    /// Whether the newest measurement was complete, its state bound left aside.
    newest_measured: bool,
    measurements: Rows,
    commands: Rows,
    state_bounds: Rows,
    /// Constant, so that a saved window has none; [`Self::keep_constants_of`] brings it back.
    #[serde(skip)]
    strip: Option<StripBound>,
}

/// The part of a window that a certificate of n transitions needs, oldest sample first.
pub(crate) struct WindowSamples<'a> {
    /// y_0..=y_n, each of length ny.
    pub measurements: &'a [f64],
    /// u_0..u_{n-1}, each of length nu.
    pub commands: &'a [f64],
    /// x̄_0..=x̄_n, each of length nx.
    pub state_bounds: &'a [f64],
}

impl ParityWindow {
    /// An empty window for certificates of at most `transitions` transitions.
    pub fn new(model: &LinearModel, transitions: usize, outward_rounding: bool) -> Self {
        let capacity = transitions + 1;
        Self {
            capacity,
            newest: 0,
            complete: 0,
            newest_measured: false,
            measurements: Rows::new(capacity, model.output_count()),
            commands: Rows::new(capacity, model.actuator_count()),
            state_bounds: Rows::new(capacity, model.state_count()),
            strip: model
                .strip_gain()
                .map(|gain| StripBound::new(model, gain, outward_rounding)),
        }
    }

    /// Whether a saved window has the room of another.
    pub(super) fn fits(&self, other: &Self) -> bool {
        self.capacity == other.capacity
            && self.newest < self.capacity
            && self.complete <= self.capacity
            && [&self.measurements, &self.commands, &self.state_bounds]
                .iter()
                .zip([&other.measurements, &other.commands, &other.state_bounds])
                .all(|(rows, other)| rows.width == other.width && rows.values.len() == other.values.len())
    }

    /// Takes over what is not saved.
    pub(super) fn keep_constants_of(&mut self, other: &mut Self) {
        self.strip = other.strip.take();
    }

    /// Adds the sample of one instant.
    ///
    /// `y` (ny): the measurement; `u` (nu): the command held over the period that *ends* at this instant; `x_bar`
    /// (nx): a guaranteed bound of the absolute state at this instant, infinite where there is none. Where one
    /// measurement encloses the state the smaller of the two bounds is kept. A measurement that is not finite
    /// or has the wrong length empties the window; so does such a command, but then this sample begins a new
    /// one.
    pub fn push(&mut self, y: &[f64], u: &[f64], x_bar: &[f64]) {
        let finite =
            |values: &[f64], length| values.len() == length && values.iter().all(|value| value.is_finite());
        self.newest_measured = finite(y, self.measurements.width);
        if !self.newest_measured {
            self.complete = 0;
            return;
        }
        if finite(u, self.commands.width) {
            self.newest = (self.newest + 1) % self.capacity;
            self.commands.write(self.newest, self.capacity, u);
        } else {
            self.complete = 0;
        }
        self.measurements.write(self.newest, self.capacity, y);
        if self.write_bound(x_bar) {
            self.complete = (self.complete + 1).min(self.capacity);
        } else {
            self.complete = 0;
        }
    }

    /// Replaces the state bound of the newest sample, after the filter was reset at that instant.
    pub fn replace_state_bound(&mut self, x_bar: &[f64]) {
        if !self.newest_measured {
            return;
        }
        self.complete = if self.write_bound(x_bar) {
            self.complete.max(1)
        } else {
            0
        };
    }

    /// Forgets all samples.
    pub fn restart(&mut self) {
        self.complete = 0;
        self.newest_measured = false;
    }

    /// Returns to the window right after construction.
    pub(super) fn reset(&mut self) {
        self.restart();
        self.newest = 0;
        for rows in [&mut self.measurements, &mut self.commands, &mut self.state_bounds] {
            rows.values.fill(0.0);
        }
    }

    /// Number of complete transitions up to the newest sample.
    pub fn complete_transitions(&self) -> usize {
        self.complete.saturating_sub(1)
    }

    /// The samples of the last `transitions` transitions, if there are that many.
    pub(crate) fn latest(&self, transitions: usize) -> Option<WindowSamples<'_>> {
        if self.complete <= transitions {
            return None;
        }
        let end = self.newest + self.capacity + 1;
        let start = end - transitions - 1;
        Some(WindowSamples {
            measurements: self.measurements.slice(start, end),
            commands: self.commands.slice(start + 1, end),
            state_bounds: self.state_bounds.slice(start, end),
        })
    }

    /// Stores the bound of the newest sample; false if it is not finite or has the wrong length.
    fn write_bound(&mut self, x_bar: &[f64]) -> bool {
        if x_bar.len() != self.state_bounds.width {
            return false;
        }
        self.state_bounds.write(self.newest, self.capacity, x_bar);
        if let Some(strip) = &mut self.strip {
            let bound = strip.evaluate(self.measurements.slice(self.newest, self.newest + 1));
            for offset in [self.newest, self.newest + self.capacity] {
                for (stored, limit) in self.state_bounds.row_mut(offset).iter_mut().zip(bound.iter()) {
                    *stored = limit.min(*stored);
                }
            }
        }
        self.state_bounds
            .slice(self.newest, self.newest + 1)
            .iter()
            .all(|value| value.is_finite())
    }
}

/// Twice `capacity` rows of one width, contiguous.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Rows {
    width: usize,
    values: Vec<f64>,
}

impl Rows {
    fn new(capacity: usize, width: usize) -> Self {
        Self {
            width,
            values: vec![0.0; 2 * capacity * width],
        }
    }

    fn row_mut(&mut self, row: usize) -> &mut [f64] {
        &mut self.values[row * self.width..(row + 1) * self.width]
    }

    fn write(&mut self, row: usize, capacity: usize, values: &[f64]) {
        self.row_mut(row).copy_from_slice(values);
        self.row_mut(row + capacity).copy_from_slice(values);
    }

    fn slice(&self, start: usize, end: usize) -> &[f64] {
        &self.values[start * self.width..end * self.width]
    }
}

/// Bound of the absolute state from one measurement: |C⁺y| + |C⁺|v, enlarged by the error of C⁺ and of the
/// rounding under outward rounding (method sheet 4.6).
#[derive(Clone, Debug)]
struct StripBound {
    gain: Matrix,
    gain_abs: Matrix,
    /// 1.01 (|I - C⁺C| + 4 ny δ (I + |C⁺||C|)); zero without outward rounding.
    relative_error: Matrix,
    /// 4 ny δ, zero without outward rounding.
    rounding: f64,
    v: Vec<f64>,
    bound: Vec<f64>,
    scratch: Vec<f64>,
}

impl StripBound {
    fn new(model: &LinearModel, gain: DMatrix<f64>, outward_rounding: bool) -> Self {
        let (nx, ny) = (model.state_count(), model.output_count());
        let rounding = if outward_rounding {
            4.0 * ny as f64 * f64::EPSILON / 2.0
        } else {
            0.0
        };
        let gain_abs = gain.abs();
        let identity = DMatrix::identity(nx, nx);
        let relative_error = if outward_rounding {
            ((&identity - &gain * model.c()).abs() + (&identity + &gain_abs * model.c().abs()) * rounding)
                * 1.01
        } else {
            DMatrix::zeros(nx, nx)
        };
        Self {
            gain: Matrix::from(&gain),
            gain_abs: Matrix::from(&gain_abs),
            relative_error: Matrix::from(&relative_error),
            rounding,
            v: model.v().as_slice().to_vec(),
            bound: vec![0.0; nx],
            scratch: vec![0.0; nx],
        }
    }

    fn evaluate(&mut self, y: &[f64]) -> &[f64] {
        for i in 0..self.bound.len() {
            let (mut center, mut radius, mut size) = (0.0, 0.0, 0.0);
            let gains = self.gain.row(i).iter().zip(self.gain_abs.row(i));
            for ((gain, size_of_gain), (y, v)) in gains.zip(y.iter().zip(&self.v)) {
                center += gain * y;
                radius += size_of_gain * v;
                size += size_of_gain * (y.abs() + v);
            }
            self.scratch[i] = center.abs() + radius;
            self.bound[i] = self.rounding * size;
        }
        for i in 0..self.bound.len() {
            let terms = self.relative_error.row(i).iter().zip(&self.scratch);
            let error = terms.fold(self.bound[i], |sum, (share, x)| sum + share * x);
            self.bound[i] = error + self.scratch[i];
        }
        &self.bound
    }
}
