//! Standard deviations of disturbances and noise, from the factors that the search found.
//!
//! With Q = L L' the deviation of row i is √Q_ii = |row i of L|. Where row i has its diagonal entry alone, which is so
//! for a diagonal Q and for the first row of any, it is L_ii itself, and an error and a limit of ln L_ii are the
//! deviation's.

use super::{FoundDeviation, disturbance_name, measurement_name};
use crate::identify::likelihood::Likelihood;
use crate::identify::likelihood::maximise::Maximum;
use crate::identify::likelihood::noise::NoiseForm;
use nalgebra::DMatrix;

/// The deviations that were sought, of the disturbances and then of the noise.
pub(super) fn deviations(
    likelihood: &Likelihood<'_>,
    maximum: &Maximum,
    (q, r): (&DMatrix<f64>, &DMatrix<f64>),
) -> Vec<FoundDeviation> {
    let of = |form: &NoiseForm, first: usize, covariance: &DMatrix<f64>, name: fn(usize) -> String| {
        let found = |(unknown, (row, column)): (usize, (usize, usize))| {
            let i = first + unknown;
            let alone = row == 0 || !form.is_full();
            let at_lower_limit =
                alone && maximum.at_limit[i] && maximum.theta[i] <= likelihood.unknowns[i].range.0;
            (row == column).then(|| FoundDeviation {
                name: name(row),
                value: if alone {
                    maximum.theta[i].exp()
                } else {
                    covariance[(row, row)].sqrt()
                },
                relative_error: alone.then_some(maximum.standard_errors[i]),
                at_lower_limit,
            })
        };
        form.entries()
            .into_iter()
            .enumerate()
            .filter_map(found)
            .collect::<Vec<_>>()
    };
    let of_q = likelihood.model_count;
    let of_r = of_q + likelihood.disturbance.count();
    let mut all = of(&likelihood.disturbance, of_q, q, disturbance_name);
    all.extend(of(&likelihood.measurement, of_r, r, measurement_name));
    all
}
