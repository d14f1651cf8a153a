//! Two-stage bounded-real synthesis: the smallest norm, then the smallest gain that nearly reaches it
//! (method sheet 3.3).

use super::{
    ErrorPlant, LmiError, Region, Time,
    certificate::{check_norm, check_poles, strict_lyapunov},
    scaling::ScaledPlant,
    stages::Conditions,
};
use nalgebra::DMatrix;
use residual_diagnosis::{gains::SolverRun, hinf_filter::bounded_real};

/// The returned bound is larger than the level γ₂ by this part (method sheet 3.5).
pub(super) const CLAIM: f64 = 1e-3;
/// A level below σ_max(Dd) by more than this part is a failure of the solver (method sheet 3.5).
const BELOW_DIRECT: f64 = 1e-6;

/// A larger δ, tried where the solver fails: with a small Dd and a region the smallest γ is far above σ_max(Dd).
const LARGER_UNIT: f64 = 30.0;

/// A gain with its proof.
#[derive(Clone, Debug, PartialEq)]
pub struct LmiGain {
    /// H (1/s) or L, n x q, in original units and coordinates.
    pub gain: DMatrix<f64>,
    /// γ₁, in original units: the smallest level with a common Lyapunov matrix.
    pub stage_one: f64,
    /// γ₂ (1 + 1e-3), in original units; the strict bounded-real inequality holds at this level.
    pub bound: f64,
    /// X ≻ 0 in original coordinates and units, with γ = `bound` and this gain:
    ///
    /// - continuous: \[\[He(X(A-HC)), X(Bd-H Dd), C'\], \[·, -γI, Dd'\], \[·, ·, -γI\]\] ≺ 0,
    /// - discrete: \[\[X, X(A-LC), X(Bd-L Dd), 0\], \[·, X, 0, C'\], \[·, ·, γI, Dd'\], \[·, ·, ·, γI\]\] ≻ 0.
    pub lyapunov: DMatrix<f64>,
    /// The solver's words in stage 1 and stage 2.
    pub runs: Vec<SolverRun>,
}

/// The two-stage gain H of a continuous-time observer.
///
/// # Errors
/// [`LmiError`]: a plant or region without a gain, a failure of the solver, or a gain that fails its verification.
pub fn two_stage_continuous(
    plant: &ErrorPlant<'_>,
    region: &Region,
    slack: f64,
) -> Result<LmiGain, LmiError> {
    two_stage(Time::Continuous, plant, region, slack)
}

/// The two-stage gain L of a discrete-time observer.
///
/// # Errors
/// As [`two_stage_continuous`].
pub fn two_stage_discrete(plant: &ErrorPlant<'_>, region: &Region, slack: f64) -> Result<LmiGain, LmiError> {
    two_stage(Time::Discrete, plant, region, slack)
}

fn two_stage(time: Time, plant: &ErrorPlant<'_>, region: &Region, slack: f64) -> Result<LmiGain, LmiError> {
    plant.check()?;
    region.check(time, plant)?;
    let size = plant.disturbance_size()?;
    if time == Time::Continuous && plant.is_silent() && region.radius.is_none() {
        return Err(LmiError::Unbounded);
    }
    let in_units = |delta: f64| {
        let scaled = ScaledPlant::new(time, plant, delta);
        region.within(|tightened| attempt(time, plant, &scaled, (region, tightened), slack))
    };
    match in_units(size) {
        Err(LmiError::Solver { .. } | LmiError::ImpossibleLevel { .. } | LmiError::Recovery { .. }) => {
            in_units(LARGER_UNIT * size)
        }
        result => result,
    }
}

/// Both stages in a region within the one that is checked.
fn attempt(
    time: Time,
    plant: &ErrorPlant<'_>,
    scaled: &ScaledPlant,
    (region, tightened): (&Region, &Region),
    slack: f64,
) -> Result<LmiGain, LmiError> {
    let conditions = Conditions {
        time,
        plant: scaled.plant(),
        asked: region,
        region: *tightened,
    };
    let one = conditions.stage_one()?;
    let stage_one = scaled.delta * one.level;
    let least = plant.direct();
    if !(stage_one >= least * (1.0 - BELOW_DIRECT) && stage_one > 0.0) {
        return Err(LmiError::ImpossibleLevel {
            problem: "two-stage bounded-real, stage 1".to_owned(),
            level: stage_one,
            least,
        });
    }
    let two = conditions.stage_two(one.level.max(least / scaled.delta) * (1.0 + slack))?;
    let level = two.level * (1.0 + CLAIM);
    let closed = conditions.plant.closed(&two.gain);
    check_poles(time, &closed, region)?;
    check_norm(time, &closed, level)?;
    let not_strict = |margin: f64| LmiError::Recovery {
        condition: "bounded-real inequality".to_owned(),
        margin,
    };
    let start = bounded_real::margin(&closed, time, &two.x, level);
    let x = strict_lyapunov(time, &closed, level, &two.x).ok_or_else(|| not_strict(-start))?;

    let (gain, bound) = (scaled.gain(&two.gain), level * scaled.delta);
    let lyapunov = scaled.lyapunov(&x) / scaled.delta;
    // Once more in original units: this is what the user relies on.
    let closed = plant.closed(&gain);
    check_poles(time, &closed, region)?;
    check_norm(time, &closed, bound)?;
    let margin = bounded_real::margin(&closed, time, &lyapunov, bound);
    if !(margin > 0.0) {
        return Err(not_strict(-margin));
    }
    Ok(LmiGain {
        gain,
        stage_one,
        bound,
        lyapunov,
        runs: vec![one.run, two.run],
    })
}
