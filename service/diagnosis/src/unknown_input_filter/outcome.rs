//! What one filter concludes at one instant, and the evaluation of its test rows (method sheet 4.2 step 6, 4.8).

use super::{
    decoupling::Decoupling,
    modes::FaultMode,
    options::Form,
    outward::Outward,
    plant::{Measured, Plant},
    prediction::Prediction,
};
use crate::matrix::{Matrix, absolute_dot, dot, product_row_sums};

/// A residual against its bound.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct TestRow {
    pub residual: f64,
    pub half_width: f64,
    /// False for a blind row and for one that could not be computed at this instant.
    pub evaluated: bool,
}

impl TestRow {
    /// Whether the residual lies outside its bound; a value that is not a number is never silent.
    #[expect(clippy::neg_cmp_op_on_partial_ord, reason = "NaN must count as outside")]
    pub fn alarm(&self) -> bool {
        self.evaluated && !(self.residual.abs() <= self.half_width)
    }
}

/// Estimate of an own fault over the last transition, valid while the mode holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FaultEstimate {
    pub centre: f64,
    pub radius: f64,
}

impl FaultEstimate {
    /// An estimate of finite numbers, else none.
    pub fn finite(centre: f64, radius: f64) -> Option<Self> {
        (centre.is_finite() && radius.is_finite()).then_some(Self { centre, radius })
    }
}

/// All that one filter says at one instant.
#[derive(Clone, Debug)]
pub(crate) struct Outcome {
    /// The ny projector rows.
    pub outputs: Vec<TestRow>,
    /// One row matched to each actuator outside the mode, in ascending order.
    pub matched: Vec<TestRow>,
    /// The norm of the residual against its threshold, in the Kalman-type baseline.
    pub norm: Option<TestRow>,
    /// One estimate for each actuator of the mode; `None` when there is none at this instant.
    pub estimates: Vec<Option<FaultEstimate>>,
    /// For each actuator the smallest fault that some row of this instant certainly sees; infinite if none.
    pub floors: Vec<f64>,
    /// Whether the set was lost at this instant because a number was not finite or a command was missing.
    pub lost: bool,
}

impl Outcome {
    /// Room for a filter of this mode; only the coupled form has matched rows and estimates, only the baseline a
    /// norm.
    pub fn new(plant: &Plant, mode: FaultMode, form: Form) -> Self {
        let (own, nu) = (mode.len(), plant.nu());
        let coupled = form == Form::Coupled;
        Self {
            outputs: vec![TestRow::default(); plant.ny()],
            matched: vec![TestRow::default(); if coupled { nu - own } else { 0 }],
            norm: (form == Form::Kalman3Sigma).then(TestRow::default),
            estimates: vec![None; if coupled { own } else { 0 }],
            floors: vec![f64::INFINITY; nu],
            lost: false,
        }
    }

    /// Forgets the last instant.
    pub fn clear(&mut self) {
        self.outputs.fill(TestRow::default());
        self.matched.fill(TestRow::default());
        self.norm = self.norm.map(|_| TestRow::default());
        self.estimates.fill(None);
        self.floors.fill(f64::INFINITY);
        self.lost = false;
    }

    /// All rows.
    pub fn rows(&self) -> impl Iterator<Item = &TestRow> {
        self.outputs.iter().chain(&self.matched).chain(&self.norm)
    }

    /// Whether any row was tested.
    pub fn tested(&self) -> bool {
        self.rows().any(|row| row.evaluated)
    }

    /// Whether any row alarms.
    pub fn alarm(&self) -> bool {
        self.rows().any(TestRow::alarm)
    }

    /// Lowers the floors by a test row with this half width and these responses to unit faults.
    pub fn note_sensitivity(&mut self, half_width: f64, responses: impl Iterator<Item = f64>) {
        for (floor, response) in self.floors.iter_mut().zip(responses) {
            let smallest = 2.0 * half_width / response.abs();
            if smallest < *floor {
                *floor = smallest;
            }
        }
    }
}

/// What the rows of one instant are evaluated with.
pub(crate) struct RowContext<'a> {
    pub plant: &'a Plant,
    pub measured: &'a Measured,
    pub prediction: &'a Prediction,
    pub outward: Option<Outward<'a>>,
}

impl RowContext<'_> {
    /// Residual w e and half width R(wΓ) + |w|v of the test row `row` (length m), given `spread` = R(wΓ).
    pub fn test(&self, row: &[f64], spread: f64) -> TestRow {
        let residual = dot(row, &self.prediction.innovation[..row.len()]);
        let mut half_width = spread + absolute_dot(row, &self.measured.noise);
        if let Some(outward) = &self.outward {
            half_width = outward.half_width(half_width, row);
        }
        TestRow {
            residual,
            half_width,
            evaluated: residual.is_finite() && half_width.is_finite(),
        }
    }

    /// Estimate of the own fault `own` with the coefficients `row` of φ, given `spread` = R(φΓ).
    pub fn estimate(&self, row: &[f64], own: usize, spread: f64) -> Option<FaultEstimate> {
        let centre = dot(row, &self.prediction.innovation[..row.len()]);
        let mut radius = spread + absolute_dot(row, &self.measured.noise);
        if let Some(outward) = &self.outward {
            radius = outward.estimate_radius(radius, row, own, centre);
        }
        FaultEstimate::finite(centre, radius)
    }

    /// w C B_j for every actuator j.
    pub fn responses<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        (0..self.plant.nu()).map(move |j| {
            row.iter()
                .zip(&self.measured.received)
                .map(|(weight, &output)| weight * self.plant.cb[(output, j)])
                .sum()
        })
    }

    /// Tests the projector rows and notes what they would see.
    pub fn test_outputs(&self, decoupling: &Decoupling, spreads: &mut [f64], outcome: &mut Outcome) {
        let rows: &Matrix = &decoupling.test_rows;
        product_row_sums(rows, &self.prediction.spread, spreads);
        for (k, &output) in self.measured.received.iter().enumerate() {
            if decoupling.blind[k] {
                continue;
            }
            let test = self.test(rows.row(k), spreads[k]);
            outcome.lost |= !test.evaluated;
            outcome.outputs[output] = test;
            outcome.note_sensitivity(test.half_width, self.responses(rows.row(k)));
        }
    }
}
