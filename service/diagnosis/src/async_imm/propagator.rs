//! From one time to another: pieces of constant plant and constant command, put together.

use super::{
    dyadic::DyadicTable,
    inputs::InputHistory,
    interval::{Interval, IntervalWork},
    plant::{LinearPlant, Plant},
    semidefinite::SemidefiniteRoot,
    time_varying::{RandomWalk, RungeKutta},
};
use crate::matrix::{Matrix, dot};
use nalgebra::DMatrix;

/// Φ, \[Υu, Ξ\] and Ω between any two times, for the plant or for the filter state of one mode.
#[derive(Clone)]
pub struct Propagator {
    source: Source,
    inputs: usize,
    piece: Interval,
    total: Interval,
    work: IntervalWork,
    /// Ω^{1/2}, for the square-root form only.
    root: Option<SemidefiniteRoot>,
}

#[derive(Clone)]
enum Source {
    Constant(DyadicTable),
    /// (from which time on, µs; table).
    Schedule(Vec<(i64, DyadicTable)>),
    Function(Box<RungeKutta>),
}

impl Propagator {
    /// For the plant state x, n_x states and n_f channels: serves every mode without random walk.
    pub fn of_plant(plant: &Plant, with_root: bool) -> Self {
        let (states, inputs, channels) = plant.sizes();
        let source = match plant {
            Plant::Constant(plant) => Source::Constant(DyadicTable::new(plant)),
            Plant::Schedule(plants) => schedule(plants, LinearPlant::clone),
            Plant::Function { function, .. } => Source::Function(Box::new(RungeKutta::new(
                function.clone(),
                states,
                channels,
                None,
            ))),
        };
        Self::new(source, states, inputs, channels, with_root)
    }

    /// For the filter state \[x; φ\] of a mode with direction D and random walk q_φ.
    pub fn of_mode(plant: &Plant, direction: &DMatrix<f64>, density: &[f64], with_root: bool) -> Self {
        let (states, inputs, channels) = plant.sizes();
        let augment = |plant: &LinearPlant| plant.augmented(direction, density);
        let source = match plant {
            Plant::Constant(plant) => Source::Constant(DyadicTable::new(&augment(plant))),
            Plant::Schedule(plants) => schedule(plants, augment),
            Plant::Function { function, .. } => Source::Function(Box::new(RungeKutta::new(
                function.clone(),
                states,
                channels,
                Some(RandomWalk {
                    direction: Matrix::from(direction),
                    density: density.to_vec(),
                }),
            ))),
        };
        Self::new(source, states + direction.ncols(), inputs, 0, with_root)
    }

    fn new(source: Source, n: usize, inputs: usize, channels: usize, with_root: bool) -> Self {
        let interval = Interval::empty(n, 1 + channels);
        Self {
            source,
            inputs,
            piece: interval.clone(),
            total: interval,
            work: IntervalWork::new(n, 1 + channels),
            root: with_root.then(|| SemidefiniteRoot::new(n)),
        }
    }

    /// Computes the interval from `begin_us` to `end_us`, split where command or plant change.
    pub fn go(&mut self, begin_us: i64, end_us: i64, commands: &InputHistory) {
        let mut time = begin_us;
        if begin_us >= end_us || matches!(self.source, Source::Function(_)) {
            self.total.clear();
        }
        while time < end_us {
            // The first piece is the whole so far.
            let piece = if time == begin_us {
                &mut self.total
            } else {
                &mut self.piece
            };
            let (command, next_command) = commands.at(time);
            let mut end = next_command.unwrap_or(end_us).min(end_us);
            match &mut self.source {
                Source::Constant(table) => apply_command(table.over(end - time), self.inputs, command, piece),
                Source::Schedule(tables) => {
                    let known = tables.partition_point(|(from, _)| *from <= time);
                    if let Some((from, _)) = tables.get(known.max(1)) {
                        end = end.min(*from);
                    }
                    if let Some((_, table)) = tables.get_mut(known.saturating_sub(1)) {
                        apply_command(table.over(end - time), self.inputs, command, piece);
                    }
                }
                Source::Function(integrator) => {
                    let seconds = |microseconds: i64| microseconds as f64 * 1e-6;
                    integrator.continue_over(seconds(time), seconds(end), command, &mut self.total);
                    time = end;
                    continue;
                }
            }
            if time > begin_us {
                self.total.follow(&self.piece, &mut self.work);
            }
            time = end;
        }
        if let Some(root) = &mut self.root {
            root.factor(&self.total.omega);
        }
    }

    /// What [`Self::go`] computed last; its gain is \[Υu, Ξ\].
    pub fn interval(&self) -> &Interval {
        &self.total
    }

    /// Ω^{1/2} of that interval; `None` unless built with it.
    pub fn noise_root(&self) -> Option<&Matrix> {
        self.root.as_ref().map(SemidefiniteRoot::root)
    }
}

fn schedule(plants: &[(i64, LinearPlant)], convert: impl Fn(&LinearPlant) -> LinearPlant) -> Source {
    let table = |(from, plant): &(i64, LinearPlant)| {
        (
            super::inputs::microseconds(*from),
            DyadicTable::new(&convert(plant)),
        )
    };
    Source::Schedule(plants.iter().map(table).collect())
}

/// \[Υ, Ξ\] → \[Υu, Ξ\].
fn apply_command(table: &Interval, inputs: usize, command: &[f64], out: &mut Interval) {
    out.phi.copy_from(&table.phi);
    out.omega.copy_from(&table.omega);
    for i in 0..out.gain.rows() {
        let (upsilon, xi) = table.gain.row(i).split_at(inputs);
        let row = out.gain.row_mut(i);
        row[0] = dot(upsilon, command);
        row[1..].copy_from_slice(xi);
    }
}
