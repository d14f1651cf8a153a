//! The plant of the error, the region of its poles, and what can be said of both before anything is solved.

use super::{LmiError, Time};
use nalgebra::{Complex, DMatrix};
use residual_diagnosis::{
    decomposition::{SingularDecomposition, eigenvalues},
    norms::System,
    spectrum::observability_gap,
};

/// σ_max(Dd) at or below this part of σ_max(Bd) counts as zero (method sheet 3.1).
const SILENT: f64 = 1e-12;
/// σ_min at or below this part of σ_max: the mode is not observable (method sheet 3.1).
const UNOBSERVABLE: f64 = 1e-9;

/// Parts by which the region is tightened: at first, and where that does not suffice.
const TIGHTENING: f64 = 1e-6;
const WIDER_TIGHTENINGS: [f64; 2] = [1e-4, 1e-2];

/// Plant of the error in one time domain, in original units: (A, Bd, C, Dd) or the sampled (Ad, Bdd, C, Dd).
#[derive(Clone, Copy, Debug)]
pub struct ErrorPlant<'a> {
    /// A, n x n.
    pub a: &'a DMatrix<f64>,
    /// Bd, n x m.
    pub bd: &'a DMatrix<f64>,
    /// C, q x n.
    pub c: &'a DMatrix<f64>,
    /// Dd, q x m.
    pub dd: &'a DMatrix<f64>,
}

impl ErrorPlant<'_> {
    /// Fails unless the shapes fit and all entries are finite.
    pub(super) fn check(&self) -> Result<(), LmiError> {
        let (n, q, m) = (self.a.nrows(), self.c.nrows(), self.bd.ncols());
        for (matrix, entries, shape) in [
            ("A", self.a, (n, n)),
            ("Bd", self.bd, (n, m)),
            ("C", self.c, (q, n)),
            ("Dd", self.dd, (q, m)),
        ] {
            check_matrix(matrix, entries, shape)?;
        }
        Ok(())
    }

    /// σ_max(Dd), or σ_max(Bd) if Dd is zero: δ, the size of the disturbance.
    pub(super) fn disturbance_size(&self) -> Result<f64, LmiError> {
        match (self.direct(), SingularDecomposition::new(self.bd).largest()) {
            (0.0, 0.0) => Err(LmiError::NoDisturbance),
            (direct, state) if direct <= SILENT * state => Ok(state),
            (direct, _) => Ok(direct),
        }
    }

    /// Dd counts as zero beside Bd.
    pub(super) fn is_silent(&self) -> bool {
        self.direct() <= SILENT * SingularDecomposition::new(self.bd).largest()
    }

    /// σ_max(Dd): no gain attenuates the disturbance further.
    pub(super) fn direct(&self) -> f64 {
        SingularDecomposition::new(self.dd).largest()
    }

    /// From d to r with this gain in force: (A - LC, Bd - L Dd, C, Dd).
    pub(super) fn closed(&self, gain: &DMatrix<f64>) -> System {
        System {
            a: self.a - gain * self.c,
            b: self.bd - gain * self.dd,
            c: self.c.clone(),
            d: self.dd.clone(),
        }
    }
}

/// Fails unless a matrix has this shape and finite entries.
pub(super) fn check_matrix(
    matrix: &'static str,
    entries: &DMatrix<f64>,
    shape: (usize, usize),
) -> Result<(), LmiError> {
    let (rows, columns) = entries.shape();
    if entries.shape() != shape || entries.is_empty() {
        return Err(LmiError::Shape {
            matrix,
            rows,
            columns,
        });
    }
    match entries.iter().all(|entry| entry.is_finite()) {
        true => Ok(()),
        false => Err(LmiError::NotFinite { matrix }),
    }
}

/// Where the poles must lie. Continuous time: Re λ < -decay and |λ| < radius (1/s). Discrete time: |λ| < radius
/// (dimensionless), decay is not used.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Region {
    /// α.
    pub decay: Option<f64>,
    /// ρ or r.
    pub radius: Option<f64>,
}

impl Region {
    /// The region in symbols.
    pub(super) fn describe(&self, time: Time) -> String {
        let decay = self.decay.filter(|_| time == Time::Continuous);
        let decay = decay.map(|alpha| format!("Re λ < -{alpha}"));
        let radius = self.radius.map(|rho| format!("|λ| < {rho}"));
        let stable = match time {
            Time::Continuous => "Re λ < 0",
            Time::Discrete => "|λ| < 1",
        };
        match (decay, radius) {
            (Some(decay), Some(radius)) => format!("{decay} and {radius}"),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => stable.to_owned(),
        }
    }

    /// A slightly smaller region, so that a pole on its edge is still inside this one.
    fn tightened(&self, part: f64) -> Self {
        Self {
            decay: self.decay.map(|alpha| alpha * (1.0 + part)),
            radius: self.radius.map(|rho| rho * (1.0 - part)),
        }
    }

    /// The first success among slightly smaller and smaller regions within this one, tried while a pole lies
    /// outside this one: solutions prefer the edge of the region.
    pub(super) fn within<T>(&self, attempt: impl Fn(&Self) -> Result<T, LmiError>) -> Result<T, LmiError> {
        let mut result = attempt(&self.tightened(TIGHTENING));
        for part in WIDER_TIGHTENINGS {
            let given = self.decay.is_some() || self.radius.is_some();
            if given && matches!(result, Err(LmiError::OutsideRegion { .. })) {
                result = attempt(&self.tightened(part));
            }
        }
        result
    }

    /// How far a pole lies inside the region and the stable one; negative outside.
    pub(super) fn margin(&self, time: Time, pole: Complex<f64>) -> f64 {
        let stable = match time {
            Time::Continuous => -self.decay.unwrap_or(0.0) - pole.re,
            Time::Discrete => 1.0 - pole.norm(),
        };
        self.radius.map_or(stable, |rho| stable.min(rho - pole.norm()))
    }

    /// Fails if no gain puts all poles into the region: it is empty, or a mode outside it is not observable.
    pub(super) fn check(&self, time: Time, plant: &ErrorPlant<'_>) -> Result<(), LmiError> {
        let region = self.describe(time);
        let decay = self.decay.filter(|_| time == Time::Continuous).unwrap_or(0.0);
        let radius = self.radius.unwrap_or(f64::INFINITY);
        if !(decay >= 0.0 && decay.is_finite() && radius > decay) {
            return Err(LmiError::EmptyRegion { region });
        }
        for pole in eigenvalues(plant.a).unwrap_or_default() {
            let fixed = !observability_gap(plant.a, plant.c, pole).has_full_rank(UNOBSERVABLE);
            if fixed && self.margin(time, pole) <= UNOBSERVABLE * (1.0 + pole.norm()) {
                let pole = match pole.im == 0.0 {
                    true => format!("{}", pole.re),
                    false => format!("{} {:+}i", pole.re, pole.im),
                };
                return Err(LmiError::FixedPole { pole, region });
            }
        }
        Ok(())
    }
}
