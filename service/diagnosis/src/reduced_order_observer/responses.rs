//! The residual y - ẑ1 of the main observer as a transfer matrix (method sheet 2, error system).

use super::{channels::fault_names, design::Design, plant::beside};
use crate::{norms::System, response::Response};
use nalgebra::DMatrix;

/// From disturbance η, measurement noise v and each fault: ε⁺ = A_e ε + D_e η - \[N; J\] v + \[B1; E_z\] f and
/// y - ẑ1 = \[I, 0\] ε + v.
pub(super) fn responses(design: &Design, sample_time_s: f64) -> Vec<Response> {
    let observer = &design.main.observer;
    let (n, p) = (observer.a_e.nrows(), observer.m.nrows());
    let output = beside(&DMatrix::identity(p, p), &DMatrix::zeros(p, n - p));
    let response = |name: String, input: &DMatrix<f64>, direct: DMatrix<f64>| Response {
        name,
        system: System::new(&observer.a_e, input, &output, &direct),
        sample_time_s: Some(sample_time_s),
    };
    let silent = |input: &DMatrix<f64>| DMatrix::zeros(p, input.ncols());
    let noise = -observer.noise_input();
    let mut all = vec![response(
        "measurement noise".to_owned(),
        &noise,
        DMatrix::identity(p, p),
    )];
    if observer.d_e.ncols() > 0 {
        all.insert(
            0,
            response("disturbance".to_owned(), &observer.d_e, silent(&observer.d_e)),
        );
    }
    for (j, name) in fault_names(&design.options.model, observer.input.ncols())
        .into_iter()
        .enumerate()
    {
        let input = observer.input.columns(j, 1).into_owned();
        let direct = silent(&input);
        all.push(response(format!("fault of {name}"), &input, direct));
    }
    all
}
