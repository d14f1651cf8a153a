//! What is claimed of a gain, and whether it is true (method sheet 3.5).

use super::{
    bounded_real,
    certificate::{Certificate, Gain, Time},
    checks::describe,
    conditions::Condition,
    paper_objective::objective_system,
    plant::Plant,
};
use crate::{
    decomposition::SingularDecomposition,
    norms::{System, h_infinity_continuous, h_minus_continuous},
};
use nalgebra::{Complex, DMatrix};

/// How far a bound may lie below what no gain can reach, relative: rounding.
const BELOW_POSSIBLE: f64 = 1e-6;
/// How far a pole may lie outside a region, relative to its size: the accuracy of a solver.
const REGION: f64 = 1e-6;

/// What a claimed bound speaks of, and how far it may lie below the truth, relative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BoundOf {
    /// ‖T_rd‖∞ of a given gain: 1e-3.
    Disturbance,
    /// ‖T_rd‖∞ of a gain whose bound has room already: 1e-9.
    ProvenDisturbance,
    /// ‖V T_rd‖∞: 1e-3.
    FilteredDisturbance,
    /// J = ‖\[-T_rd, W_F - T_rf\]‖∞ of the paper: 1e-6.
    Objective,
}

impl BoundOf {
    fn tolerance(self) -> f64 {
        match self {
            Self::Disturbance | Self::FilteredDisturbance => 1e-3,
            Self::ProvenDisturbance => 1e-9,
            Self::Objective => 1e-6,
        }
    }
}

/// Where the poles must lie.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Region {
    /// α, 1/s: Re λ < -α, or |λ| < e^{-αTs} in discrete time.
    pub decay: Option<f64>,
    /// Largest modulus: 1/s in continuous time, 1 in discrete time.
    pub radius: Option<f64>,
}

/// What is claimed of a gain.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Claims {
    /// A norm is at most this.
    pub bound: Option<(BoundOf, f64)>,
    /// The optimum of the first stage: no larger than the bound, no smaller than what any gain reaches.
    pub stage_one: Option<f64>,
    /// β: ‖V T_rf‖₋ is at least this, up to 1e-3.
    pub fault_index: Option<f64>,
    /// The poles lie here.
    pub region: Region,
    /// X of the bounded-real inequality at the bound, n x n.
    pub lyapunov: Option<DMatrix<f64>>,
    /// W_F of the paper; without it W_F = T_rf.
    pub reference: Option<System>,
}

/// ‖W_F‖∞ and J of the paper's problem.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperNorms {
    /// ‖W_F‖∞.
    pub reference: f64,
    /// J.
    pub objective: f64,
}

impl Claims {
    /// The region's radius in the time domain of a gain.
    fn radius(&self, time: Time, sample_time_s: f64) -> Option<f64> {
        let decay = self.region.decay.filter(|_| time == Time::Discrete);
        let from_decay = decay.map(|alpha| (-alpha * sample_time_s).exp());
        match (self.region.radius, from_decay) {
            (Some(radius), Some(other)) => Some(radius.min(other)),
            (radius, other) => radius.or(other),
        }
    }

    /// The conditions that the poles lie in the region.
    pub(super) fn of_poles(&self, time: Time, poles: &[Complex<f64>], sample_time_s: f64) -> Vec<Condition> {
        let mut found = Vec::new();
        let mut add = |name: String, margin: &dyn Fn(&Complex<f64>) -> f64| {
            let worst = poles.iter().min_by(|x, y| margin(x).total_cmp(&margin(y)));
            if let Some(pole) = worst {
                found.push(Condition {
                    margin: margin(pole),
                    sharp: false,
                    code: "pole_region",
                    violation: format!("the pole {} lies outside {name}", describe(*pole)),
                    name,
                });
            }
        };
        if let (Time::Continuous, Some(alpha)) = (time, self.region.decay) {
            add(format!("Re λ < -{alpha}"), &|pole| {
                -alpha * (1.0 - REGION) - pole.re
            });
        }
        if let Some(radius) = self.radius(time, sample_time_s) {
            add(format!("|λ| < {radius}"), &|pole| {
                radius * (1.0 + REGION) - pole.norm()
            });
        }
        found
    }

    /// The conditions on bounds.
    pub(super) fn of_bounds(
        &self,
        plant: &Plant,
        gain: &Gain,
        disturbance: &System,
        certificate: &Certificate,
    ) -> Vec<Condition> {
        let mut found = Vec::new();
        let Some((of, bound)) = self.bound else {
            return found;
        };
        let (what, truth, direct) = match of {
            BoundOf::FilteredDisturbance => (
                "‖V T_rd‖∞",
                certificate.weighted_disturbance,
                SingularDecomposition::new(&(&gain.v * &plant.dd)).largest(),
            ),
            BoundOf::Objective => (
                "J = ‖[-T_rd, W_F - T_rf]‖∞",
                certificate.paper.map_or(f64::INFINITY, |norms| norms.objective),
                SingularDecomposition::new(&plant.dd).largest(),
            ),
            BoundOf::Disturbance | BoundOf::ProvenDisturbance => (
                "‖T_rd‖∞",
                certificate.disturbance,
                SingularDecomposition::new(&plant.dd).largest(),
            ),
        };
        let stated = [
            ("the claimed bound", Some(bound)),
            ("the optimum of the first stage", self.stage_one),
        ];
        for (name, value) in stated {
            let Some(value) = value else { continue };
            found.push(Condition {
                name: format!("{name} >= σ_max of the direct term"),
                margin: value - direct * (1.0 - BELOW_POSSIBLE),
                sharp: false,
                code: "below_lower_bound",
                violation: format!("{name} {value} is below σ_max(Dd) = {direct}"),
            });
            if gain.time == Time::Discrete && of != BoundOf::FilteredDisturbance {
                let least = certificate.lower_bound;
                found.push(Condition {
                    name: format!("{name} >= what no discrete gain can undercut"),
                    margin: value - least * (1.0 - BELOW_POSSIBLE),
                    sharp: false,
                    code: "below_lower_bound",
                    violation: format!("{name} {value} is below {least}, the least of any gain"),
                });
            }
        }
        if let Some(stage_one) = self.stage_one {
            found.push(Condition {
                name: "the optimum of the first stage <= the claimed bound".to_owned(),
                margin: bound - stage_one,
                sharp: false,
                code: "claimed_bound_violated",
                violation: format!(
                    "the optimum of the first stage {stage_one} is above the claimed bound {bound}"
                ),
            });
        }
        found.push(Condition {
            name: format!("{what} <= the claimed bound"),
            margin: bound * (1.0 + of.tolerance()) - truth,
            sharp: of == BoundOf::Objective,
            code: match of {
                BoundOf::Objective => "theorem1_bound_violated",
                _ => "claimed_bound_violated",
            },
            violation: format!("{what} is {truth}, above the claimed bound {bound}"),
        });
        if let Some(index) = self.fault_index {
            let truth = certificate.fault_index;
            found.push(Condition {
                name: "‖V T_rf‖₋ >= the claimed index".to_owned(),
                margin: truth - index * (1.0 - 1e-3),
                sharp: true,
                code: "claimed_index_violated",
                violation: format!("‖V T_rf‖₋ is {truth}, below the claimed index {index}"),
            });
        }
        if let Some(lyapunov) = &self.lyapunov {
            let margin = bounded_real::margin(disturbance, gain.time, lyapunov, bound);
            found.push(Condition {
                name: "bounded-real inequality at X".to_owned(),
                margin,
                sharp: false,
                code: "no_lyapunov_matrix",
                violation: format!(
                    "the bounded-real inequality does not hold with X at the bound {bound}, its smallest scaled \
                     eigenvalue is {margin:e}"
                ),
            });
        }
        found
    }

    /// ‖W_F‖∞ and J, if J is claimed; false beside them if a norm was not confirmed.
    pub(super) fn paper_norms(&self, filter: &PaperFilter<'_>) -> Option<(PaperNorms, bool)> {
        self.bound.filter(|(of, _)| *of == BoundOf::Objective)?;
        let reference = self.reference.as_ref().unwrap_or(filter.fault);
        let objective = match &self.reference {
            Some(reference) => {
                h_infinity_continuous(&objective_system(filter.disturbance, filter.fault, reference))
            }
            None => h_infinity_continuous(filter.disturbance),
        };
        let size = h_infinity_continuous(reference);
        let norms = PaperNorms {
            reference: size.value,
            objective: objective.value,
        };
        Some((norms, size.confirmed && objective.confirmed))
    }
}

/// T_rd and T_rf of the filter whose J is asked for.
pub(super) struct PaperFilter<'a> {
    pub disturbance: &'a System,
    pub fault: &'a System,
}

/// The conditions that no correct computation violates: ‖T_rf‖∞ >= σ_max(Df) and, in continuous time,
/// ‖T_rf‖₋ <= σ_min(Df).
pub(super) fn of_faults(plant: &Plant, time: Time, largest: f64, fault: &System) -> (Vec<Condition>, bool) {
    let direct = SingularDecomposition::new(&plant.df);
    let mut found = vec![Condition {
        name: "‖T_rf‖∞ >= σ_max(Df)".to_owned(),
        margin: largest - direct.largest() * (1.0 - 1e-9),
        sharp: true,
        code: "impossible_norm",
        violation: format!("‖T_rf‖∞ = {largest} is below σ_max(Df), which is impossible"),
    }];
    if time == Time::Discrete {
        return (found, true);
    }
    let index = h_minus_continuous(fault, None);
    found.push(Condition {
        name: "‖T_rf‖₋ <= σ_min(Df)".to_owned(),
        margin: direct.smallest() * (1.0 + 1e-6) + 1e-12 - index.value,
        sharp: true,
        code: "impossible_norm",
        violation: format!(
            "‖T_rf‖₋ = {} is above σ_min(Df), which is impossible",
            index.value
        ),
    });
    (found, index.confirmed)
}
