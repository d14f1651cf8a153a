//! What is recomputed of every gain, whatever its origin claims (method sheet 3.5).

use super::{
    checks::describe,
    error::HinfFilterError,
    plant::{Plant, SampledPlant},
    synthesis::discrete_lower_bound,
};
use crate::{
    decomposition::{SingularDecomposition, eigenvalues},
    norms::{Norm, System, h_infinity_continuous, h_infinity_discrete, h_minus_continuous, h_minus_discrete},
};
use nalgebra::{Complex, DMatrix};

/// How far a claimed bound may lie below the truth.
const CLAIM: f64 = 1e-3;
/// And below what no gain can reach: σ_max(Dd), and the discrete optimum.
const BELOW_DIRECT: f64 = 1e-6;
const BELOW_OPTIMUM: f64 = 2e-3;

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

/// What the designer of a gain claims.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Claims {
    /// ‖T_rd‖∞ is at most this.
    pub bound: Option<f64>,
    /// α, 1/s.
    pub pole_decay: Option<f64>,
    /// ρ, 1/s.
    pub pole_radius: Option<f64>,
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
    /// Why the gain is uncertified; `None` if it is certified.
    pub uncertified: Option<String>,
}

/// Recomputes poles and norms of a gain and compares them with the claims.
///
/// # Errors
/// [`HinfFilterError::FilterNotStable`]; every other failure is recorded in [`Certificate::uncertified`].
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
    check_stable(gain.time, &poles)?;
    let system = |input: &DMatrix<f64>, direct: &DMatrix<f64>, v: Option<&DMatrix<f64>>| {
        let driven = input - &gain.matrix * direct;
        match v {
            Some(v) => System::new(&closed, &driven, &(v * &plant.c), &(v * direct)),
            None => System::new(&closed, &driven, &plant.c, direct),
        }
    };
    let largest = |system: &System| match gain.time {
        Time::Continuous => h_infinity_continuous(system),
        Time::Discrete => h_infinity_discrete(system),
    };
    let smallest = |system: &System| match gain.time {
        Time::Continuous => h_minus_continuous(system, None),
        Time::Discrete => h_minus_discrete(system, None),
    };
    let disturbance = largest(&system(bd, &plant.dd, None));
    let weighted_disturbance = largest(&system(bd, &plant.dd, Some(&gain.v)));
    let fault = largest(&system(bf, &plant.df, None));
    let weighted_fault = system(bf, &plant.df, Some(&gain.v));
    let fault_index = smallest(&weighted_fault);
    let unweighted_index = smallest(&system(bf, &plant.df, None));
    let fault_indices: Vec<Norm> = (0..bf.ncols())
        .map(|j| smallest(&weighted_fault.input(j)))
        .collect();
    let direct = SingularDecomposition::new(&plant.dd).largest();
    let optimum = match gain.time {
        Time::Continuous => None,
        Time::Discrete => discrete_lower_bound(sampled, &plant.c, &plant.dd),
    };
    let confirmed = [
        disturbance,
        weighted_disturbance,
        fault,
        fault_index,
        unweighted_index,
    ]
    .iter()
    .chain(&fault_indices)
    .all(|norm| norm.confirmed);
    let mut certificate = Certificate {
        time: gain.time,
        disturbance: disturbance.value,
        weighted_disturbance: weighted_disturbance.value,
        fault: fault.value,
        fault_index: fault_index.value,
        fault_indices: fault_indices.iter().map(|norm| norm.value).collect(),
        gain: SingularDecomposition::new(&gain.matrix).largest(),
        lower_bound: direct.max(optimum.unwrap_or(0.0) * (1.0 - BELOW_OPTIMUM)),
        uncertified: None,
        poles,
    };
    let direct_fault = SingularDecomposition::new(&plant.df);
    certificate.uncertified = if !confirmed {
        Some("a norm could not be confirmed, the eigenvalues of a Hamiltonian did not converge".to_owned())
    } else if certificate.fault < direct_fault.largest() * (1.0 - 1e-9) {
        Some(format!(
            "‖T_rf‖∞ = {} is below σ_max(Df), which is impossible",
            certificate.fault
        ))
    } else if gain.time == Time::Continuous
        && unweighted_index.value > direct_fault.smallest() * (1.0 + 1e-6) + 1e-12
    {
        Some(format!(
            "‖T_rf‖₋ = {} is above σ_min(Df), which is impossible",
            unweighted_index.value
        ))
    } else {
        violated_claim(&certificate, claims, sampled.sample_time_s, direct, optimum)
    };
    Ok(certificate)
}

fn violated_claim(
    certificate: &Certificate,
    claims: &Claims,
    sample_time_s: f64,
    direct: f64,
    optimum: Option<f64>,
) -> Option<String> {
    if let Some(bound) = claims.bound {
        if bound < direct * (1.0 - BELOW_DIRECT) {
            return Some(format!("the claimed bound {bound} is below σ_max(Dd) = {direct}"));
        }
        if let Some(optimum) = optimum.filter(|optimum| bound < optimum * (1.0 - BELOW_OPTIMUM)) {
            return Some(format!(
                "the claimed bound {bound} is below {optimum}, the least of any gain"
            ));
        }
        if !(certificate.disturbance <= bound * (1.0 + CLAIM)) {
            let truth = certificate.disturbance;
            return Some(format!("‖T_rd‖∞ is {truth}, above the claimed bound {bound}"));
        }
    }
    let outside = |inside: &dyn Fn(&Complex<f64>) -> bool, region: String| {
        let pole = certificate.poles.iter().find(|pole| !inside(pole))?;
        Some(format!("the pole {} lies outside {region}", describe(*pole)))
    };
    let decay = claims.pole_decay.and_then(|alpha| match certificate.time {
        Time::Continuous => outside(&|pole| pole.re < -alpha, format!("Re λ < -{alpha}")),
        Time::Discrete => {
            let radius = (-alpha * sample_time_s).exp();
            outside(&|pole| pole.norm() < radius, format!("|λ| < {radius}"))
        }
    });
    decay.or_else(|| {
        let radius = claims.pole_radius?;
        outside(&|pole| pole.norm() < radius, format!("|λ| < {radius}"))
    })
}

fn check_stable(time: Time, poles: &[Complex<f64>]) -> Result<(), HinfFilterError> {
    let measure = |pole: &Complex<f64>| match time {
        Time::Continuous => pole.re,
        Time::Discrete => pole.norm() - 1.0,
    };
    let worst = poles
        .iter()
        .max_by(|left, right| measure(left).total_cmp(&measure(right)));
    match worst {
        Some(pole) if !(measure(pole) < -1e-12) => Err(HinfFilterError::FilterNotStable {
            filter: match time {
                Time::Continuous => "the continuous filter".to_owned(),
                Time::Discrete => "the discrete filter".to_owned(),
            },
            pole: describe(*pole),
        }),
        _ => Ok(()),
    }
}
