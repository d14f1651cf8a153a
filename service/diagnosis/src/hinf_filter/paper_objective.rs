//! The objective of the paper, J = ‖\[-T_rd, W_F - T_rf\]‖∞ (paper equations (7), (12)).

use super::plant::{beside, stacked};
use crate::norms::System;
use nalgebra::DMatrix;

/// \[-T_rd, W_F - T_rf\] with the joint state (error of the filter, state of W_F). T_rd and T_rf share A and C.
pub fn objective_system(disturbance: &System, fault: &System, reference: &System) -> System {
    let (n, nf) = (fault.a.nrows(), reference.a.nrows());
    let m = disturbance.b.ncols();
    let zero = DMatrix::zeros;
    System {
        a: stacked(&[
            &beside(&[&fault.a, &zero(n, nf)]),
            &beside(&[&zero(nf, n), &reference.a]),
        ]),
        b: stacked(&[
            &beside(&[&disturbance.b, &fault.b]),
            &beside(&[&zero(nf, m), &reference.b]),
        ]),
        c: beside(&[&-&fault.c, &reference.c]),
        d: beside(&[&-&disturbance.d, &(&reference.d - &fault.d)]),
    }
}
