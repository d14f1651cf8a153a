//! The plant as the online step needs it: constants of the model in row-major form, and the data of one instant.
//!
//! | symbol | here | shape |
//! |---|---|---|
//! | A0, B, C, D, A⁺ | `a0`, `b`, `c`, `d`, `a_plus` | nx x nx, nx x nu, ny x nx, nx x nd, nx x nx |
//! | w, v | `disturbance`, `noise` | nd, ny |
//! | C⁺ | `strip.gain` | nx x ny |
//! | ε, δ | `epsilon`, [`UNIT_ROUNDOFF`] | |

use super::{
    few_states::FewStates,
    options::{FilterOptions, Form},
    strip_reset::Strip,
};
use crate::buffer::Buffer;
use crate::{
    matrix::{Matrix, absolute_dot, multiply},
    model::{Bounds, LinearModel},
};

/// δ = 2⁻⁵³, the unit roundoff of double precision.
pub(crate) const UNIT_ROUNDOFF: f64 = f64::EPSILON / 2.0;

/// Constants of the plant, shared by all filters of a bank.
#[derive(Clone, Debug)]
pub(crate) struct Plant {
    pub a0: Matrix,
    pub b: Matrix,
    pub c: Matrix,
    pub a_plus: Matrix,
    /// C B, the signatures of the actuator faults in the outputs.
    pub cb: Matrix,
    pub noise: Vec<f64>,
    /// |D| w.
    pub disturbance_radius: Vec<f64>,
    /// D diag(w); `None` if D is square and diagonal, then `disturbance_radius` says it all.
    pub disturbance_generators: Option<Matrix>,
    pub strip: Option<Strip>,
    pub state_box: Option<IntervalBox>,
    pub input_box: Option<IntervalBox>,
    /// ε of the outward rounding (method sheet 4.9), 0 when it is switched off.
    pub epsilon: f64,
    /// A0, A⁺, B and C by columns, if they are small.
    pub few_states: Option<FewStates>,
}

/// A box as centre and radius.
#[derive(Clone, Debug)]
pub(crate) struct IntervalBox {
    pub centre: Vec<f64>,
    pub radius: Vec<f64>,
}

impl From<&Bounds> for IntervalBox {
    fn from(bounds: &Bounds) -> Self {
        Self {
            centre: bounds.center().as_slice().to_vec(),
            radius: bounds.radius().as_slice().to_vec(),
        }
    }
}

impl Plant {
    /// Takes over a validated model; `generator_order` enters the constant of the outward rounding.
    pub fn new(model: &LinearModel, generator_order: usize, outward: bool) -> Self {
        let (nx, ny) = (model.state_count(), model.output_count());
        let (c, b, d) = (Matrix::from(model.c()), Matrix::from(model.b()), model.d());
        let noise = model.v().as_slice().to_vec();
        let diagonal = d.is_square() && (0..nx).all(|i| (0..nx).all(|j| i == j || d[(i, j)] == 0.0));
        let weighted = Matrix::from(&(d * nalgebra::DMatrix::from_diagonal(model.w())));
        let mut cb = Matrix::zeros(ny, model.actuator_count());
        multiply(&c, &b, &mut cb);
        let strip = Strip::new(model, outward);
        let order = (generator_order + 4 * nx + ny + 16) as f64;
        let (a0, a_plus) = (Matrix::from(model.a0()), Matrix::from(model.a_plus()));
        Self {
            few_states: FewStates::new(&a0, &a_plus, &b, &c),
            a0,
            a_plus,
            cb,
            disturbance_radius: (d.abs() * model.w()).as_slice().to_vec(),
            disturbance_generators: (!diagonal).then_some(weighted),
            strip,
            state_box: model.state_box().map(IntervalBox::from),
            input_box: model.input_box().map(IntervalBox::from),
            epsilon: if outward { 4.0 * order * UNIT_ROUNDOFF } else { 0.0 },
            b,
            c,
            noise,
        }
    }

    /// The plant of a bank with these options.
    pub fn of(model: &LinearModel, options: &FilterOptions) -> Self {
        let outward = options.outward_rounding && options.form == Form::Coupled;
        Self::new(model, options.effective_generator_order(), outward)
    }

    /// D diag(w), nx x nd.
    pub fn disturbance_matrix(&self) -> Matrix {
        match &self.disturbance_generators {
            Some(generators) => generators.clone(),
            None => {
                let mut diagonal = Matrix::with_capacity(self.nx(), self.nx());
                diagonal.append_diagonal(&self.disturbance_radius);
                diagonal
            }
        }
    }

    pub fn nx(&self) -> usize {
        self.a0.rows()
    }

    pub fn nu(&self) -> usize {
        self.b.columns()
    }

    pub fn ny(&self) -> usize {
        self.c.rows()
    }

    /// Columns that a generator matrix can have at any time of a step, for generator order s and nf own faults.
    pub fn column_capacity(&self, generator_order: usize, own_faults: usize) -> usize {
        let nd = self.disturbance_generators.as_ref().map_or(0, Matrix::columns);
        let carried = generator_order.max(self.ny() + self.nx());
        carried + 3 * self.nx() + nd + 2 * self.ny() + own_faults + self.nu()
    }
}

/// The measurements received at one instant: rows of C, elements of v and y.
#[derive(Clone, Debug)]
pub(crate) struct Measured {
    /// Indices of the received elements, ascending.
    pub received: Buffer<usize>,
    pub c: Matrix,
    pub noise: Buffer<f64>,
    pub y: Buffer<f64>,
}

impl Measured {
    pub fn new(plant: &Plant) -> Self {
        let ny = plant.ny();
        let mut out = Self {
            received: Buffer::with_capacity(ny),
            c: plant.c.clone(),
            noise: Buffer::with_capacity(ny),
            y: Buffer::with_capacity(ny),
        };
        out.clear();
        out
    }

    /// Nothing received.
    pub fn clear(&mut self) {
        self.received.clear();
        self.noise.clear();
        self.y.clear();
        let nx = self.c.columns();
        self.c.reshape(0, nx);
    }

    /// Takes the finite elements of `y`; a slice of the wrong length is missing as a whole.
    pub fn receive(&mut self, plant: &Plant, y: &[f64]) {
        self.clear();
        if y.len() != plant.ny() {
            return;
        }
        for (j, value) in y.iter().enumerate().filter(|(_, value)| value.is_finite()) {
            self.received.push(j);
            self.noise.push(plant.noise[j]);
            self.y.push(*value);
            let count = self.received.len();
            self.c.reshape(count, plant.nx());
            self.c.row_mut(count - 1).copy_from_slice(plant.c.row(j));
        }
    }

    pub fn count(&self) -> usize {
        self.y.len()
    }

    pub fn is_complete(&self, plant: &Plant) -> bool {
        self.count() == plant.ny()
    }
}

/// What is known of the command held over the last transition.
#[derive(Clone, Debug)]
pub(crate) struct Command {
    pub centre: Vec<f64>,
    pub radius: Vec<f64>,
    /// Whether every element was received (`radius` is zero).
    pub exact: bool,
    /// Whether every element was received or has a configured box.
    pub known: bool,
}

impl Command {
    pub fn new(plant: &Plant) -> Self {
        let nu = plant.nu();
        Self {
            centre: vec![0.0; nu],
            radius: vec![0.0; nu],
            exact: false,
            known: false,
        }
    }

    /// Takes the elements of `u`, NaN standing for a missing one.
    pub fn receive(&mut self, plant: &Plant, u: &[f64]) {
        self.exact = u.iter().all(|value| value.is_finite());
        self.known = self.exact || plant.input_box.is_some();
        for (j, value) in u.iter().enumerate() {
            (self.centre[j], self.radius[j]) = match &plant.input_box {
                _ if value.is_finite() => (*value, 0.0),
                Some(bounds) => (bounds.centre[j], bounds.radius[j]),
                None => (0.0, 0.0),
            };
        }
    }

    /// |B| (|u| + r_u) of state row `i`.
    pub fn influence(&self, plant: &Plant, i: usize) -> f64 {
        let row = plant.b.row(i);
        let size: f64 = row.iter().zip(&self.centre).map(|(b, u)| (b * u).abs()).sum();
        size + absolute_dot(row, &self.radius)
    }
}
