//! The filtered residual r̃ = V r of the main filter as transfer matrices (method sheet 2, sampled form).

use super::{options::RealisationType, problem::Problem, report::Report};
use crate::{norms::System, response::Response};

/// V T_rd and V T_rf: e⁺ = (Ad - LC) e + (Bdd - L Dd) d + (Bfd - L Df) f, r̃ = V (C e + Dd d + Df f). Empty where the
/// filter holds the samples: there commands leak into the residual as well.
pub(super) fn responses(problem: &Problem, realisation: RealisationType, report: &Report) -> Vec<Response> {
    if realisation != RealisationType::DiscreteObserver {
        return Vec::new();
    }
    let (plant, sampled) = (&problem.plant, &problem.sampled);
    let (gain, v) = (&report.gain, &report.v);
    let closed = &sampled.ad - gain * &plant.c;
    let response = |name: &str, input, direct| Response {
        name: name.to_owned(),
        system: System::new(&closed, &(input - gain * direct), &(v * &plant.c), &(v * direct)),
        sample_time_s: Some(sampled.sample_time_s),
    };
    vec![
        response("disturbance (V T_rd)", &sampled.bdd, &plant.dd),
        response("fault (V T_rf)", &sampled.bfd, &plant.df),
    ]
}
