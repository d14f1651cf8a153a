//! Prediction of the state and of the outputs (method sheet 4.2, steps 1 to 3).
//!
//! | symbol | here |
//! |---|---|
//! | c = A0p + Bu | `centre` |
//! | G | `generators` |
//! | κ | `size` |
//! | e = y - Cc, Γ = CG | `innovation`, `spread` |
//! | \|y\| + \|C\|κ + v | `output_size` |

use super::{
    plant::{Command, Measured, Plant},
    state::SetState,
};
use crate::matrix::{Matrix, absolute_dot, absolute_sum, dot, multiply, subtract_product};

/// Room for one prediction.
#[derive(Clone, Debug)]
pub(crate) struct Prediction {
    pub centre: Vec<f64>,
    pub generators: Matrix,
    pub size: Vec<f64>,
    pub innovation: Vec<f64>,
    pub spread: Matrix,
    pub output_size: Vec<f64>,
    magnitude: Vec<f64>,
    /// Radius of the box that uncertainty (and diagonal disturbance) add.
    pub box_radius: Vec<f64>,
}

impl Prediction {
    pub fn new(plant: &Plant, columns: usize) -> Self {
        let (nx, ny) = (plant.nx(), plant.ny());
        Self {
            centre: vec![0.0; nx],
            generators: Matrix::with_capacity(nx, columns),
            size: vec![0.0; nx],
            innovation: vec![0.0; ny],
            spread: Matrix::with_capacity(ny, columns),
            output_size: vec![0.0; ny],
            magnitude: vec![0.0; nx],
            box_radius: vec![0.0; nx],
        }
    }

    /// Predicts c and G; `fault_generators` (F diag(fault bound)) are added while own faults are bounded.
    pub fn predict(
        &mut self,
        plant: &Plant,
        state: &SetState,
        command: &Command,
        fault_generators: Option<&Matrix>,
    ) {
        self.predict_centre(plant, state, command, fault_generators);
        let generators = &mut self.generators;
        multiply(&plant.a0, &state.generators, generators);
        generators.append_diagonal(&self.box_radius);
        if let Some(disturbance) = &plant.disturbance_generators {
            generators.append(disturbance);
        }
        if let Some(faults) = fault_generators {
            generators.append(faults);
        }
        if !command.exact {
            generators.append_scaled(&plant.b, &command.radius);
        }
    }

    /// Predicts c, κ and the box of G only.
    pub fn predict_centre(
        &mut self,
        plant: &Plant,
        state: &SetState,
        command: &Command,
        fault_generators: Option<&Matrix>,
    ) {
        let nx = plant.nx();
        let enlarge = 1.0 + plant.epsilon;
        for i in 0..nx {
            self.magnitude[i] = state.centre[i].abs() + state.radius[i] * enlarge;
        }
        if let Some(few) = &plant.few_states {
            let parts = few.predict(&state.centre, &self.magnitude, command, enlarge);
            self.box_radius.copy_from_slice(&parts.uncertainty[..nx]);
            self.centre.copy_from_slice(&parts.centre[..nx]);
            self.size.copy_from_slice(&parts.size[..nx]);
        } else {
            for i in 0..nx {
                self.box_radius[i] = dot(plant.a_plus.row(i), &self.magnitude) * enlarge;
                self.centre[i] = dot(plant.a0.row(i), &state.centre) + dot(plant.b.row(i), &command.centre);
                self.size[i] = absolute_dot(plant.a0.row(i), &self.magnitude) + command.influence(plant, i);
            }
        }
        let merged = plant.disturbance_generators.is_none();
        let boxes = self.size.iter_mut().zip(&mut self.box_radius);
        for (i, ((size, uncertainty), disturbance)) in boxes.zip(&plant.disturbance_radius).enumerate() {
            let faults = fault_generators.map_or(0.0, |matrix| absolute_sum(matrix.row(i)));
            *size = *size + *uncertainty + disturbance + faults;
            *uncertainty += if merged { *disturbance } else { 0.0 };
        }
    }

    /// Compares with what was received.
    pub fn observe(&mut self, plant: &Plant, measured: &Measured) {
        self.observe_centre(plant, measured);
        multiply(&measured.c, &self.generators, &mut self.spread);
    }

    /// Innovation and output size only.
    pub fn observe_centre(&mut self, plant: &Plant, measured: &Measured) {
        if let Some(few) = plant.few_states.as_ref().filter(|_| measured.is_complete(plant)) {
            let [outputs, sizes] = few.outputs(&self.centre, &self.size);
            let predicted = outputs.iter().zip(&sizes);
            let received = measured.y.iter().zip(&measured.noise).zip(predicted);
            let found = self.innovation.iter_mut().zip(&mut self.output_size);
            for ((innovation, total), ((y, noise), (output, size))) in found.zip(received) {
                *innovation = y - output;
                *total = y.abs() + size + noise;
            }
            return;
        }
        for j in 0..measured.count() {
            let row = measured.c.row(j);
            self.innovation[j] = measured.y[j] - dot(row, &self.centre);
            self.output_size[j] = measured.y[j].abs() + absolute_dot(row, &self.size) + measured.noise[j];
        }
    }

    /// Writes H = \[G - LΓ, LV\] for the correction with `gain`.
    pub fn correct(&self, gain: &Matrix, noise: &[f64], out: &mut Matrix) {
        subtract_product(&self.generators, gain, &self.spread, out);
        out.append_scaled(gain, noise);
    }
}
