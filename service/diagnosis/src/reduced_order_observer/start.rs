//! Where a pair of observers starts, and how far it may be off (method sheet 4).

use super::{
    interval_box::IntervalBox,
    observer::Observer,
    plant::{Plant, beside, stack},
};
use crate::matrix::{Matrix, apply};
use nalgebra::{DMatrix, DVector};

/// A start from a box of x.
#[derive(Clone, Debug)]
pub(super) enum Start {
    /// ẑ1 = y(0), ẑ2 = K y(0) + x2c.
    MeasuredOutput {
        /// K.
        gain: Matrix,
        /// x2c, the lower part of T_c x_c.
        hidden: Vec<f64>,
        /// \[A_e \[0; R2\], A_e \[-V; -K V\] - \[N; J\] V, D_e H_η\]: H at the second instant. Keeps the correlation of
        /// v(0) in the start with v(0) in the first step.
        generators: Matrix,
    },
    /// ẑ = T T_c x_c.
    PriorBox {
        /// ẑ, length n.
        z: Vec<f64>,
        /// T T_c diag(radius): H at the first instant.
        generators: Matrix,
    },
}

impl Start {
    /// A start at the first complete sample; x is in `states` then.
    pub fn measured_output(plant: &Plant, observer: &Observer, states: &IntervalBox) -> Self {
        let (p, nz) = (plant.outputs(), plant.hidden());
        let (centre, radius) = plant.transformed(states);
        let hidden = stack(
            &DMatrix::zeros(p, plant.states()),
            &radius.rows(p, nz).into_owned(),
        );
        let noise = DMatrix::from_diagonal(&plant.noise_bound);
        let first_noise = stack(&(-&noise), &(-&observer.k * &noise));
        let noise = &observer.a_e * first_noise - observer.noise_input() * noise;
        let disturbance = &observer.d_e * DMatrix::from_diagonal(&plant.disturbance.radius);
        Self::MeasuredOutput {
            gain: Matrix::from(&observer.k),
            hidden: centre.rows(p, nz).iter().copied().collect(),
            generators: Matrix::from(&beside(&beside(&(&observer.a_e * hidden), &noise), &disturbance)),
        }
    }

    /// A start at the centre of `states`, which holds x at the first instant.
    pub fn prior_box(plant: &Plant, observer: &Observer, states: &IntervalBox) -> Self {
        let (p, nz) = (plant.outputs(), plant.hidden());
        let t = stack(
            &DMatrix::identity(p, plant.states()),
            &beside(&observer.k, &DMatrix::identity(nz, nz)),
        );
        let (centre, radius) = plant.transformed(states);
        let z: DVector<f64> = &t * centre;
        Self::PriorBox {
            z: z.as_slice().to_vec(),
            generators: Matrix::from(&(t * radius)),
        }
    }

    /// Whether the first sample is the start, so that it cannot be tested.
    pub fn is_at_output(&self) -> bool {
        matches!(self, Self::MeasuredOutput { .. })
    }

    /// H at the first instant that can be tested.
    pub fn generators(&self) -> &Matrix {
        match self {
            Self::MeasuredOutput { generators, .. } | Self::PriorBox { generators, .. } => generators,
        }
    }

    /// The observers at the first instant.
    pub fn observers(&self, y: &[f64], z1: &mut [f64], z2: &mut [f64]) {
        match self {
            Self::MeasuredOutput { gain, hidden, .. } => {
                z1.copy_from_slice(y);
                apply(gain, y, z2);
                z2.iter_mut().zip(hidden).for_each(|(z2, centre)| *z2 += centre);
            }
            Self::PriorBox { z, .. } => {
                let targets = z1.iter_mut().chain(z2);
                targets.zip(z).for_each(|(target, value)| *target = *value);
            }
        }
    }
}
