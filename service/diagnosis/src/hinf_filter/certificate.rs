//! What is recomputed of every gain, whatever its origin claims (method sheet 3.5).

use super::{
    checks::describe,
    claims::{BoundOf, Claims, PaperFilter, PaperNorms, of_faults},
    conditions::Condition,
    error::HinfFilterError,
    lower_bound::discrete_lower_bound,
    plant::{Plant, SampledPlant},
};
use crate::{
    decomposition::{SingularDecomposition, eigenvalues},
    norms::{Norm, System, h_infinity_continuous, h_infinity_discrete, h_minus_continuous, h_minus_discrete},
};
use nalgebra::{Complex, DMatrix};

/// The time domain of a gain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Time {
    /// H of x̂' = A x̂ + B u + H r.
    Continuous,
    /// L of x̂⁺ = Ad x̂ + Bud u + L r.
    Discrete,
}

/// A gain with its post-filter r̃ = V r.
#[derive(Clone, Debug, PartialEq)]
pub struct Gain {
    /// Time domain.
    pub time: Time,
    /// H or L, n x q.
    pub matrix: DMatrix<f64>,
    /// V, s x q.
    pub v: DMatrix<f64>,
}

/// Norms and poles of a gain.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// Time domain of poles and norms.
    pub time: Time,
    /// Eigenvalues of A - HC or Ad - LC.
    pub poles: Vec<Complex<f64>>,
    /// ‖T_rd‖∞.
    pub disturbance: f64,
    /// ‖V T_rd‖∞.
    pub weighted_disturbance: f64,
    /// ‖T_rf‖∞.
    pub fault: f64,
    /// ‖V T_rf‖₋.
    pub fault_index: f64,
    /// ‖V T_rf‖₋ of each fault alone.
    pub fault_indices: Vec<f64>,
    /// σ_max of the gain.
    pub gain: f64,
    /// No gain has a smaller ‖T_rd‖∞.
    pub lower_bound: f64,
    /// ‖W_F‖∞ and J, where the paper's bound of J is claimed.
    pub paper: Option<PaperNorms>,
    /// What must hold, with margins.
    pub conditions: Vec<Condition>,
}

impl Certificate {
    /// The first condition that does not hold; `None` if the gain is certified.
    pub fn violated(&self) -> Option<&Condition> {
        self.conditions.iter().find(|condition| !condition.holds())
    }

    /// `certified`, or `uncertified(word)` with the word of the first condition that does not hold.
    pub fn label(&self) -> String {
        match self.violated() {
            None => "certified".to_owned(),
            Some(condition) => format!("uncertified({})", condition.code),
        }
    }
}

/// Recomputes poles and norms of a gain and compares them with the claims.
///
/// # Errors
/// [`HinfFilterError::FilterNotStable`]; every other failure is recorded in [`Certificate::conditions`].
pub fn certify(
    plant: &Plant,
    sampled: &SampledPlant,
    gain: &Gain,
    claims: &Claims,
) -> Result<Certificate, HinfFilterError> {
    let (a, bd, bf) = match gain.time {
        Time::Continuous => (&plant.a, &plant.bd, &plant.bf),
        Time::Discrete => (&sampled.ad, &sampled.bdd, &sampled.bfd),
    };
    let closed = a - &gain.matrix * &plant.c;
    let poles = eigenvalues(&closed).ok_or(HinfFilterError::Eigenvalues { matrix: "the filter" })?;
    let stable = stability(gain.time, &poles)?;
    let system = |input: &DMatrix<f64>, direct: &DMatrix<f64>| {
        System::new(&closed, &(input - &gain.matrix * direct), &plant.c, direct)
    };
    let largest = |system: &System| match gain.time {
        Time::Continuous => h_infinity_continuous(system),
        Time::Discrete => h_infinity_discrete(system),
    };
    let smallest = |system: &System| match gain.time {
        Time::Continuous => h_minus_continuous(system, None),
        Time::Discrete => h_minus_discrete(system, None),
    };
    let (t_rd, t_rf) = (system(bd, &plant.dd), system(bf, &plant.df));
    let (filtered_rd, filtered_rf) = (t_rd.filtered(&gain.v), t_rf.filtered(&gain.v));
    let (disturbance, weighted_disturbance) = (largest(&t_rd), largest(&filtered_rd));
    let (fault, fault_index) = (largest(&t_rf), smallest(&filtered_rf));
    let fault_indices: Vec<Norm> = (0..bf.ncols()).map(|j| smallest(&filtered_rf.input(j))).collect();
    let paper = claims.paper_norms(&PaperFilter {
        disturbance: &t_rd,
        fault: &t_rf,
    });
    let lower_bound = match gain.time {
        Time::Continuous => SingularDecomposition::new(&plant.dd).largest(),
        Time::Discrete => discrete_lower_bound(sampled, &plant.c, &plant.dd),
    };
    let (mut conditions, index_confirmed) = of_faults(plant, gain.time, fault.value, &t_rf);
    let confirmed = [disturbance, weighted_disturbance, fault, fault_index]
        .iter()
        .chain(&fault_indices)
        .all(|norm| norm.confirmed)
        && index_confirmed
        && paper.is_none_or(|(_, confirmed)| confirmed);
    if !confirmed {
        conditions.insert(0, unconfirmed());
    }
    conditions.insert(0, stable);
    conditions.extend(claims.of_poles(gain.time, &poles, sampled.sample_time_s));
    let mut certificate = Certificate {
        time: gain.time,
        disturbance: disturbance.value,
        weighted_disturbance: weighted_disturbance.value,
        fault: fault.value,
        fault_index: fault_index.value,
        fault_indices: fault_indices.iter().map(|norm| norm.value).collect(),
        gain: SingularDecomposition::new(&gain.matrix).largest(),
        lower_bound,
        paper: paper.map(|(norms, _)| norms),
        conditions: Vec::new(),
        poles,
    };
    let bounded = match claims.bound {
        Some((BoundOf::FilteredDisturbance, _)) => &filtered_rd,
        _ => &t_rd,
    };
    conditions.extend(claims.of_bounds(plant, gain, bounded, &certificate));
    certificate.conditions = conditions;
    Ok(certificate)
}

fn unconfirmed() -> Condition {
    Condition {
        name: "every norm is confirmed by a level set".to_owned(),
        margin: -1.0,
        sharp: false,
        code: "norm_not_confirmed",
        violation: "a norm could not be confirmed, the eigenvalues of a Hamiltonian did not converge"
            .to_owned(),
    }
}

/// The condition that all poles are stable, or the refusal.
fn stability(time: Time, poles: &[Complex<f64>]) -> Result<Condition, HinfFilterError> {
    let measure = |pole: &Complex<f64>| match time {
        Time::Continuous => -pole.re,
        Time::Discrete => 1.0 - pole.norm(),
    };
    let (filter, name) = match time {
        Time::Continuous => ("the continuous filter", "Re λ < 0"),
        Time::Discrete => ("the discrete filter", "|λ| < 1"),
    };
    let worst = poles.iter().min_by(|x, y| measure(x).total_cmp(&measure(y)));
    let margin = worst.map_or(1.0, measure);
    match worst {
        Some(pole) if !(margin > 1e-12) => Err(HinfFilterError::FilterNotStable {
            filter: filter.to_owned(),
            pole: describe(*pole),
        }),
        _ => Ok(Condition {
            name: name.to_owned(),
            margin,
            sharp: false,
            code: "not_stable",
            violation: format!("{filter} is not stable"),
        }),
    }
}
