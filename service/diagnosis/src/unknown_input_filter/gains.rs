//! What a synthesis finds for a bank: fixed gains, decoupling pairs, parity certificates (method sheet 3.3, 3.2, 3.4).
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | L_fix | nx x ny | gain of the coupled form with L_fix C F = F |
//! | T, N, S | nx x nx, nx x ny, nx x ny | decoupling pair of the paper's form: N = L0 + S P, T = I - NC, TF = 0 |
//! | λ, μ | nx, ny | multipliers of a parity certificate |

use super::{
    certificate::ParityCertificate,
    checks::check_modes,
    construction::design_filter,
    error::ConstructionError,
    fixed_gain::{FixedGain, Nominal},
    modes::FaultMode,
    options::{Form, GainRule, UnknownInputFilterOptions},
    options_error::OptionsError,
    paper::UnknownInputObserver,
    plant::Plant,
};
use crate::choice::choice;
use crate::model::LinearModel;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// The numbers that a bank runs on beside its model and options.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct UnknownInputFilterGains {
    /// Modes with numbers of their own, each at most once.
    #[serde(rename = "mode", skip_serializing_if = "Vec::is_empty")]
    pub modes: Vec<ModeGains>,
    /// The parity certificates, in the order of their tests.
    #[serde(rename = "certificate", skip_serializing_if = "Vec::is_empty")]
    pub certificates: Vec<ParityCertificate>,
    /// The windows of `parity.lengths` that a design found no certificate for.
    #[serde(rename = "untested", skip_serializing_if = "Vec::is_empty")]
    pub untested: Vec<Untested>,
}

/// A window over which no parity test runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Untested {
    /// The mode that is not falsified.
    pub mode: FaultMode,
    /// The foreign actuator whose fault is not seen.
    pub fault: usize,
    /// L.
    #[serde(rename = "L")]
    pub length: usize,
    /// Why.
    pub reason: WhyUntested,
}

choice! {
    /// Why a window has no certificate.
    WhyUntested {
        /// No fault, however large, can be told from the mode within it.
        NotSeparable = "not_separable",
        /// The solver failed.
        NotComputed = "not_computed",
    }
}

/// The numbers of one mode; matrices row by row.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeGains {
    /// The mode, as a list of actuators.
    pub mode: FaultMode,
    /// L_fix, nx x ny: the gain, or a candidate for its rows, in the coupled form.
    #[serde(rename = "L_fix", default, skip_serializing_if = "Option::is_none")]
    pub fixed: Option<Vec<Vec<f64>>>,
    /// S, nx x ny, in the forms of the paper; none: zero.
    #[serde(rename = "S", default, skip_serializing_if = "Option::is_none")]
    pub s: Option<Vec<Vec<f64>>>,
    /// T, nx x nx, in the forms of the paper.
    #[serde(rename = "T", default, skip_serializing_if = "Option::is_none")]
    pub t: Option<Vec<Vec<f64>>>,
    /// N, nx x ny, in the forms of the paper.
    #[serde(rename = "N", default, skip_serializing_if = "Option::is_none")]
    pub n: Option<Vec<Vec<f64>>>,
}

impl ModeGains {
    /// A mode without numbers yet.
    fn new(mode: FaultMode) -> Self {
        Self {
            mode,
            fixed: None,
            s: None,
            t: None,
            n: None,
        }
    }
}

impl UnknownInputFilterGains {
    /// Finds all that needs no solver: fixed gains and decoupling pairs, and the certificates that the options bring.
    ///
    /// # Errors
    /// [`ConstructionError`]: options that do not fit, a mode that can never be falsified, no stable gain where
    /// `filter.gain` = "fixed" demands one.
    pub fn find(model: &LinearModel, options: &UnknownInputFilterOptions) -> Result<Self, ConstructionError> {
        options.validate(model)?;
        let plant = Plant::of(model, &options.filter);
        let nominal = Nominal::new(model, &plant, &options.filter);
        let modes = options.bank.modes(plant.nu());
        let report = check_modes(model, options, &modes)?;
        let testable = modes
            .iter()
            .zip(&report.testable)
            .filter(|(_, testable)| **testable);
        let testable: Vec<FaultMode> = testable.map(|(mode, _)| *mode).collect();
        let certificates = options.parity.certificates.clone().unwrap_or_default();
        let of_tested = |certificate: &ParityCertificate| testable.contains(&certificate.mode);
        if let Some(index) = certificates
            .iter()
            .position(|certificate| !of_tested(certificate))
        {
            let mode = certificates[index].mode;
            return Err(OptionsError::CertificateOfUnlistedMode { index, mode }.into());
        }
        let mut modes = Vec::new();
        for &mode in &testable {
            modes.extend(find_mode(model, &plant, mode, options, &nominal)?);
        }
        Ok(Self {
            modes,
            certificates,
            untested: Vec::new(),
        })
    }

    /// The numbers of a mode, with their place in the list.
    pub(super) fn of(&self, mode: FaultMode) -> Option<(usize, &ModeGains)> {
        self.modes
            .iter()
            .enumerate()
            .find(|(_, gains)| gains.mode == mode)
    }
}

fn find_mode(
    model: &LinearModel,
    plant: &Plant,
    mode: FaultMode,
    options: &UnknownInputFilterOptions,
    nominal: &Nominal,
) -> Result<Option<ModeGains>, ConstructionError> {
    let mut gains = ModeGains::new(mode);
    match (options.filter.form, options.filter.gain) {
        (Form::Coupled, GainRule::Frobenius) => return Ok(None),
        (Form::Coupled, rule) => {
            let filter = design_filter(model, plant, mode, options);
            let Some(fixed) = FixedGain::design(plant, &filter, nominal) else {
                return match rule {
                    GainRule::Fixed => Err(ConstructionError::NoStableFixedGain { mode }),
                    _ => Ok(None),
                };
            };
            gains.fixed = Some(rows(&fixed.to_dense()));
        }
        (Form::Paper | Form::Kalman3Sigma, _) => {
            gains.s = options.filter.s.clone().filter(|_| !mode.is_empty());
            let s = gains.s.as_ref().map(|s| from_rows(s, (plant.nx(), plant.ny())));
            let observer = UnknownInputObserver::new(plant, mode, s.as_ref());
            gains.t = Some(rows(&observer.t.to_dense()));
            gains.n = Some(rows(&observer.n.to_dense()));
        }
    }
    Ok(Some(gains))
}

/// A matrix row by row, without negative zeros.
fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix
        .row_iter()
        .map(|row| row.iter().map(|value| value + 0.0).collect())
        .collect()
}

/// The matrix of these rows, of a shape that was checked before.
pub(super) fn from_rows(rows: &[Vec<f64>], shape: (usize, usize)) -> DMatrix<f64> {
    let entry = |i: usize, j: usize| rows.get(i).and_then(|row| row.get(j)).copied();
    DMatrix::from_fn(shape.0, shape.1, |i, j| entry(i, j).unwrap_or(0.0))
}
