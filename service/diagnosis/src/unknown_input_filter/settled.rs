//! A filter in its settled state: on nominal data without innovation, until its set no longer changes.
//!
//! The half widths then depend on the size of the state alone, for which x_nom stands (method sheet 4.8). Reductions
//! can let a set cycle instead of settling, so that the widest of the last instants count.

use super::{
    fixed_gain::{Nominal, transition},
    mode_filter::ModeFilter,
    modes::FaultMode,
    options::Form,
    outcome::Outcome,
    plant::{Command, Measured, Plant},
    state::SetState,
    workspace::Workspace,
};
use nalgebra::{DMatrix, DVector};

/// Longest run, in steps.
const STEPS: usize = 2000;
/// Last steps whose widest bounds count.
const WATCHED: usize = 100;
/// Relative change of the radius at which it counts as constant, and the steps for which it must be.
const CONSTANT: f64 = 1e-12;
const CONSTANT_STEPS: usize = 10;
/// Growth over the second half of the run that is no settling.
const GROWTH: f64 = 1.1;

/// The bounds of one settled filter.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    /// Half widths of the projector rows, of the matched rows and of the norm; `None` where nothing is tested.
    pub outputs: Vec<Option<f64>>,
    pub matched: Vec<Option<f64>>,
    pub norm: Option<f64>,
    /// For each actuator the smallest constant fault that some row certainly sees one step later; infinite if none.
    pub floors: Vec<f64>,
    /// Radius of the set (standard deviations in the Kalman-type baseline), length nx.
    pub radius: Vec<f64>,
    /// Whether the set kept growing to the end.
    pub grows: bool,
    /// What moves the errors from step to step: (I - LC)A0, or (I - KC)TA0 in the forms of the paper.
    pub transition: DMatrix<f64>,
}

/// Runs the filter of a mode until it has settled; `None` if its set is lost on the way.
pub(super) fn settle(
    plant: &Plant,
    mode: FaultMode,
    filter: &ModeFilter,
    form: Form,
    nominal: &Nominal,
) -> Option<Settled> {
    let mut state = SetState::new(plant.nx(), plant.column_capacity(nominal.order, mode.len()));
    let mut work = Workspace::new(plant, nominal.order, mode.len(), nominal.reduction);
    let mut outcome = Outcome::new(plant, mode, form);
    let mut command = Command::new(plant);
    command.receive(plant, &vec![0.0; plant.nu()]);
    let centre = DVector::from_column_slice(&nominal.state);
    let output = plant.c.to_dense() * (plant.a0.to_dense() * &centre);
    let mut measured = Measured::new(plant);
    measured.receive(plant, output.as_slice());
    match filter {
        ModeFilter::Kalman(kalman) => kalman.start(&mut state),
        _ => state.set_box(&nominal.state, &nominal.radius),
    }
    let size = |state: &SetState| match filter {
        ModeFilter::Kalman(_) => deviations(state),
        _ => state.radius.clone(),
    };
    let (mut last, mut half_way, mut constant) = (size(&state), f64::INFINITY, 0);
    let mut widest: Option<Settled> = None;
    for step in 0..STEPS {
        state.centre.copy_from_slice(&nominal.state);
        filter.step(plant, &command, &measured, &mut state, &mut work, &mut outcome);
        if state.void || outcome.lost {
            return None;
        }
        let radius = size(&state);
        let largest = radius.iter().copied().fold(0.0, f64::max);
        let pairs = radius.iter().zip(&last);
        let change = pairs
            .map(|(now, before)| (now - before).abs())
            .fold(0.0, f64::max);
        constant = if change <= CONSTANT * largest {
            constant + 1
        } else {
            0
        };
        last = radius;
        if step == STEPS / 2 {
            half_way = largest;
        }
        if step + WATCHED >= STEPS || constant >= CONSTANT_STEPS {
            let now = Settled {
                outputs: half_widths(&outcome.outputs),
                matched: half_widths(&outcome.matched),
                norm: outcome.norm.map(|row| row.half_width),
                floors: outcome.floors.clone(),
                radius: last.clone(),
                grows: largest > GROWTH * half_way,
                transition: match filter {
                    ModeFilter::Paper(paper) => paper.transition(plant, &work),
                    ModeFilter::Kalman(kalman) => kalman.transition(plant, &work.kalman),
                    ModeFilter::Fixed(fixed) => transition(plant, fixed.gain()),
                    ModeFilter::Coupled(_) => transition(plant, &work.gain),
                },
            };
            widest = Some(match widest {
                Some(before) => now.widened_by(&before),
                None => now,
            });
        }
        if constant >= CONSTANT_STEPS {
            break;
        }
    }
    widest
}

impl Settled {
    fn widened_by(mut self, other: &Self) -> Self {
        let rows = self.outputs.iter_mut().chain(&mut self.matched);
        for (row, other) in rows.zip(other.outputs.iter().chain(&other.matched)) {
            *row = row.zip(*other).map(|(a, b)| a.max(b));
        }
        let values = self.floors.iter_mut().chain(&mut self.radius);
        for (value, other) in values.zip(other.floors.iter().chain(&other.radius)) {
            *value = value.max(*other);
        }
        self
    }
}

fn half_widths(rows: &[super::outcome::TestRow]) -> Vec<Option<f64>> {
    rows.iter()
        .map(|row| row.evaluated.then_some(row.half_width))
        .collect()
}

fn deviations(state: &SetState) -> Vec<f64> {
    let entry = |i| state.covariance[(i, i)];
    (0..state.centre.len())
        .map(|i| f64::max(entry(i), 0.0).sqrt())
        .collect()
}
