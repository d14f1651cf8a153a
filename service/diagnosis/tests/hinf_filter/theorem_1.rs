//! Theorem 1 of the paper does not bound the filter that it recovers (method sheet 3.6): one exact point that satisfies
//! its conditions (13), (14) and whose filter violates the claim. No solver is needed to see it.

use crate::kernels::{assert_matrix, matrix};
use crate::paper::paper_plant;
use crate::support::reference_of;
use nalgebra::{DMatrix, SymmetricEigen};
use residual_diagnosis::norms::{System, h_infinity_continuous};
use serde_json::Value;

fn file() -> Value {
    reference_of("hinf_filter", "paper_facts.json")
}

/// The symmetric matrix (13) in block rows \[n, n, m, l, q\], with -I in the blocks of d and f.
fn condition_13(variable: impl Fn(&str) -> DMatrix<f64>, gamma: f64) -> DMatrix<f64> {
    let plant = paper_plant();
    let [r, x, z, y, m, k, n, t] = ["R", "X", "Z", "Y", "M", "K", "N", "T"].map(variable);
    let (zc, cy) = (&z * &plant.c, plant.c.tr_mul(&y));
    let c = plant.c.transpose();
    let e11 = &r * &plant.a + plant.a.tr_mul(&r) - &zc - zc.transpose();
    let e12 = &r * &plant.a - &zc + plant.a.tr_mul(&x) - &cy + &m;
    let e22 = plant.a.tr_mul(&x) + &x * &plant.a - &cy - cy.transpose();
    let (e13, e14) = (&r * &plant.bd - &z * &plant.dd, &r * &plant.bf - &z * &plant.df);
    let e23 = &x * &plant.bd - y.tr_mul(&plant.dd);
    let e24 = &x * &plant.bf - y.tr_mul(&plant.df) + &k;
    let identity = |size: usize, factor: f64| DMatrix::<f64>::identity(size, size) * factor;
    let blocks = [
        (0, 0, e11),
        (0, 1, e12),
        (0, 2, e13),
        (0, 3, e14),
        (0, 4, &c - n),
        (1, 1, e22),
        (1, 2, e23),
        (1, 3, e24),
        (1, 4, c),
        (2, 2, identity(1, -1.0)),
        (2, 4, plant.dd.transpose()),
        (3, 3, identity(2, -1.0)),
        (3, 4, plant.df.transpose() - t.transpose()),
        (4, 4, identity(2, -gamma)),
    ];
    let start = [0, 2, 4, 5, 7];
    let mut out = DMatrix::zeros(9, 9);
    for (row, column, block) in blocks {
        let place = (start[row], start[column]);
        out.view_mut(place, block.shape()).copy_from(&block);
        out.view_mut((place.1, place.0), (block.ncols(), block.nrows()))
            .copy_from(&block.transpose());
    }
    out
}

#[test]
fn the_counterexample_satisfies_13_and_14_and_its_filter_violates_the_claim() {
    let file = file();
    let fact = &file["counterexample"];
    let number = |key: &str| fact[key].as_f64().unwrap();
    let variable = |key: &str| matrix(&fact[key]);
    let lmi = condition_13(variable, number("gamma"));
    assert_matrix("(13)", &lmi, &fact["lmi13_matrix"], 1e-12);
    let eigenvalues = SymmetricEigen::new(lmi).eigenvalues;
    assert!((eigenvalues.max() - number("lmi13_max_eigenvalue")).abs() < 1e-9);
    assert!(eigenvalues.max() < -5.7e-5, "(13) holds strictly");
    let (r, x) = (variable("R"), variable("X"));
    assert!(
        r.clone().cholesky().is_some() && (&x - &r).cholesky().is_some(),
        "(14) holds"
    );

    let plant = paper_plant();
    let inverse = (&r - &x).try_inverse().unwrap();
    let h = r.try_inverse().unwrap() * variable("Z");
    assert_eq!(h, DMatrix::zeros(2, 2));
    let reference = System {
        a: &inverse * variable("M").transpose(),
        b: &inverse * variable("K"),
        c: variable("N").transpose(),
        d: variable("T"),
    };
    assert_matrix("A_F", &reference.a, &fact["AF"], 1e-12);
    assert_matrix("B_F", &reference.b, &fact["BF"], 1e-12);
    let closed = |b: &DMatrix<f64>, d: &DMatrix<f64>| System::new(&plant.a, b, &plant.c, d);
    let disturbance = h_infinity_continuous(&closed(&plant.bd, &plant.dd)).value;
    assert!((disturbance - number("true_hinf_Trd")).abs() < 1e-9);

    // J = ‖[-T_rd, W_F - T_rf]‖ of the joint system with states (x of the filter, x of the reference model).
    let mut joint = System {
        a: DMatrix::zeros(4, 4),
        b: DMatrix::zeros(4, 3),
        c: DMatrix::zeros(2, 4),
        d: DMatrix::zeros(2, 3),
    };
    joint.a.view_mut((0, 0), (2, 2)).copy_from(&plant.a);
    joint.a.view_mut((2, 2), (2, 2)).copy_from(&reference.a);
    joint.b.view_mut((0, 0), (2, 1)).copy_from(&plant.bd);
    joint.b.view_mut((0, 1), (2, 2)).copy_from(&plant.bf);
    joint.b.view_mut((2, 1), (2, 2)).copy_from(&reference.b);
    joint.c.view_mut((0, 0), (2, 2)).copy_from(&-&plant.c);
    joint.c.view_mut((0, 2), (2, 2)).copy_from(&reference.c);
    joint.d.view_mut((0, 0), (2, 1)).copy_from(&-&plant.dd);
    joint
        .d
        .view_mut((0, 1), (2, 2))
        .copy_from(&(&reference.d - &plant.df));
    let objective = h_infinity_continuous(&joint).value;
    assert!((objective - number("true_J")).abs() < 2e-6, "{objective}");
    let claim = number("gamma").sqrt();
    assert!((claim - 0.03).abs() < 1e-15);
    assert!(objective > 4.8 * claim && disturbance > 1.16 * claim);
}

#[test]
fn condition_13_is_assembled_as_in_the_reference() {
    let kernels = reference_of("hinf_filter", "kernels.json");
    let assembly = &kernels["lmi_assembly"];
    let variable = |key: &str| matrix(&assembly["variables"][key]);
    let lmi = condition_13(variable, assembly["gamma"].as_f64().unwrap());
    assert_matrix("(13)", &lmi, &assembly["lmi13_printed"], 1e-14);
}
