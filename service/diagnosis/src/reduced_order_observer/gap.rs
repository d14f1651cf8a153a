//! One instant with lost samples (method sheet 4, step 7).

use super::{
    filter::{Filter, FilterState, shifted},
    inputs::{Commands, Inputs},
    workspace::Workspace,
};
use crate::matrix::{Matrix, multiply};

impl Filter {
    /// With a gap: H ← R_d(\[A_S H, D_e H_η, -\[N; J\] S V, \[B1; E_z\] diag(r_u)\]), c ← A_S c + D_e p_η, after the
    /// zero-start set has been put into H.
    pub(super) fn advance_set_over_gap(
        &self,
        state: &mut FilterState,
        inputs: &Inputs,
        work: &mut Workspace,
    ) {
        if state.age > 0 {
            state.generators.append(&self.steady);
            work.reducer.reduce(&mut state.generators, self.order);
            state.age = 0;
        }
        if let Some(fault) = &self.fault {
            state.generators.append(fault);
        }
        self.gap_dynamics(&inputs.valid, &mut work.dynamics);
        shifted(&work.dynamics, &self.shift, &mut state.centre, &mut work.centre);
        multiply(&work.dynamics, &state.generators, &mut work.product);
        work.product.append(&self.disturbance);
        for (mask, valid) in work.mask.iter_mut().zip(&inputs.valid) {
            *mask = f64::from(u8::from(*valid));
        }
        work.product.append_scaled(&self.noise, &work.mask);
        if inputs.commands == Commands::Bridged {
            work.product
                .append_scaled(&self.observers.input, &inputs.u_radius);
        }
        work.reducer.reduce(&mut work.product, self.order);
        state.generators.copy_from(&work.product);
        if !inputs.all_valid {
            state.unguaranteed = self.memory;
        } else {
            state.unguaranteed = state.unguaranteed.saturating_sub(1);
        }
    }

    /// A_S = \[\[A1 - N S, A12\], \[J (I - S), F\]\].
    fn gap_dynamics(&self, valid: &[bool], out: &mut Matrix) {
        out.copy_from(&self.a_e);
        let p = valid.len();
        for i in 0..self.a_e.rows() {
            for (column, valid) in valid.iter().enumerate() {
                out[(i, column)] = match (i < p, valid) {
                    (true, true) => self.observers.a1[(i, column)] - self.observers.n[(i, column)],
                    (true, false) => self.observers.a1[(i, column)],
                    (false, true) => 0.0,
                    (false, false) => self.observers.j[(i - p, column)],
                };
            }
        }
    }
}
