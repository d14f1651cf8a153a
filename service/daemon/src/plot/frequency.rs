//! Singular values against frequency.

use residual_chart::{Chart, Curve};
use residual_diagnosis::decomposition::eigenvalues;
use residual_diagnosis::response::Response;
use std::f64::consts::PI;

/// Points of a curve.
const POINTS: usize = 400;

/// Largest and smallest singular value of each response; `None` if there is no response.
pub(super) fn chart(name: &str, responses: &[Response]) -> Option<Chart> {
    let (low, high) = span(responses)?;
    let step = (high / low).ln() / (POINTS - 1) as f64;
    let frequencies = (0..POINTS).map(|i| low * (step * i as f64).exp());
    let mut curves = Vec::new();
    for response in responses {
        let gains: Vec<(f64, (f64, f64))> = frequencies
            .clone()
            .filter_map(|frequency| Some((frequency, response.singular_values(frequency)?)))
            .collect();
        curves.push(Curve {
            name: format!("{}, largest", response.name),
            points: gains
                .iter()
                .map(|(frequency, gain)| (*frequency, gain.1))
                .collect(),
        });
        let (inputs, outputs) = (response.system.b.ncols(), response.system.c.nrows());
        if inputs > 1 && inputs <= outputs {
            curves.push(Curve {
                name: format!("{}, smallest", response.name),
                points: gains
                    .iter()
                    .map(|(frequency, gain)| (*frequency, gain.0))
                    .collect(),
            });
        }
    }
    Some(Chart {
        title: format!("{name}: gain from disturbance and fault to residual"),
        x: "frequency, rad/s".to_owned(),
        y: "singular value".to_owned(),
        curves,
        ..Chart::default()
    })
}

/// From two decades below the slowest pole to two above the fastest, at most half the sampling frequency.
fn span(responses: &[Response]) -> Option<(f64, f64)> {
    let mut rates = Vec::new();
    let mut limit = f64::INFINITY;
    for response in responses {
        for pole in eigenvalues(&response.system.a).unwrap_or_default() {
            match response.sample_time_s {
                None => rates.push(pole.norm()),
                // A pole at the origin is faster than anything that the samples show.
                Some(period) if pole.norm() > 1e-9 => rates.push(pole.ln().norm() / period),
                Some(period) => rates.push(PI / period),
            }
        }
        if let Some(period) = response.sample_time_s {
            limit = limit.min(PI / period);
            rates.push(PI / period);
        }
    }
    rates.retain(|rate| rate.is_finite() && *rate > 0.0);
    let slowest = rates.iter().copied().fold(f64::INFINITY, f64::min);
    let fastest = rates.iter().copied().fold(0.0, f64::max);
    (fastest > 0.0).then(|| (slowest * 1e-2, (fastest * 1e2).min(limit)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, dmatrix};
    use residual_diagnosis::norms::System;

    fn response(a: DMatrix<f64>, sample_time_s: Option<f64>) -> Response {
        let one = dmatrix![1.0];
        Response {
            name: "fault".to_owned(),
            system: System::new(&a, &one, &one, &dmatrix![0.0]),
            sample_time_s,
        }
    }

    #[test]
    fn a_lag_falls_by_a_factor_of_hundred_two_decades_above_its_pole() {
        let chart = chart("lag", &[response(dmatrix![-2.0], None)]).unwrap();
        let points = &chart.curves[0].points;
        let (first, last) = (points[0], points[POINTS - 1]);
        assert!((first.0 - 0.02).abs() < 1e-12 && (last.0 - 200.0).abs() < 1e-9);
        assert!((first.1 / last.1 - 100.0).abs() < 0.1, "{first:?} {last:?}");
    }

    #[test]
    fn a_sampled_response_is_shown_up_to_half_the_sampling_frequency() {
        let chart = chart("sampled", &[response(dmatrix![0.9], Some(0.01))]).unwrap();
        let last = chart.curves[0].points.last().unwrap().0;
        assert!(last <= PI / 0.01 * (1.0 + 1e-9) && last > 300.0, "{last}");
    }
}
