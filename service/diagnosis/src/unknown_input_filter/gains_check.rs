//! Whether gains fulfil all that a filter relies on: nothing is taken on trust (method sheet 3.2 to 3.4).

use super::{
    certificate::CertificateError,
    fixed_gain::{FixedGain, FixedGainError, Nominal},
    gains::{ModeGains, UnknownInputFilterGains},
    modes::FaultMode,
    options::{Form, GainRule, UnknownInputFilterOptions},
    paper::UnknownInputObserver,
    plant::Plant,
};
use crate::tables::{TableError, shaped_matrix};
use nalgebra::DMatrix;
use thiserror::Error;

/// Largest difference to what an equality demands, relative to the terms in it.
const ROUNDING: f64 = 1e-9;

/// Why gains are refused; each says which condition does not hold.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GainsError {
    /// A matrix of the wrong shape, or with an entry that is not finite.
    #[error(transparent)]
    Table(#[from] TableError),
    /// Numbers for a mode without filter.
    #[error(
        "the bank has no filter for the mode {mode}; the gains belong to another bank, design them again"
    )]
    UnknownMode {
        /// Position in the list of modes.
        index: usize,
        /// The mode.
        mode: FaultMode,
    },
    /// A mode that is listed twice.
    #[error("the mode {mode} is listed twice; design the gains again")]
    RepeatedMode {
        /// Position in the list of modes.
        index: usize,
        /// The mode.
        mode: FaultMode,
    },
    /// A matrix that this form of the filter does not run without.
    #[error("the mode {mode} has no {matrix}, which this filter runs on; design the gains again")]
    Missing {
        /// The mode.
        mode: FaultMode,
        /// Which matrix.
        matrix: &'static str,
    },
    /// A matrix that this form of the filter has no use for.
    #[error("the mode {mode} has {matrix}, but its filter has no use for it; design the gains again")]
    Unused {
        /// Position in the list of modes.
        index: usize,
        /// The mode.
        mode: FaultMode,
        /// Which matrix.
        matrix: &'static str,
    },
    /// A fixed gain that fails a condition.
    #[error(
        "L_fix of the mode {mode}: {source}; the gains were altered or belong to another plant, design them again"
    )]
    Fixed {
        /// Position in the list of modes.
        index: usize,
        /// The mode.
        mode: FaultMode,
        /// Which condition.
        source: FixedGainError,
    },
    /// A decoupling pair that fails an equality.
    #[error(
        "the equality {equality} of the mode {mode} is missed by {residual:e} (relative), more than 1e-9; the gains \
         were altered or belong to another plant, design them again"
    )]
    Decoupling {
        /// Position in the list of modes.
        index: usize,
        /// The mode.
        mode: FaultMode,
        /// Which equality.
        equality: &'static str,
        /// Largest miss, relative to the terms.
        residual: f64,
    },
    /// A certificate that does not belong to the model.
    #[error("{source}")]
    Certificate {
        /// Position in the list of certificates.
        index: usize,
        /// Why.
        source: CertificateError,
    },
    /// A certificate of a mode without filter, or in a form without parity tests.
    #[error(
        "the certificate is for the mode {mode}, which has no parity tests in this bank; the gains belong to another \
         bank, design them again"
    )]
    CertificateOfUntestedMode {
        /// Position in the list of certificates.
        index: usize,
        /// Its mode.
        mode: FaultMode,
    },
    /// A window that is asked for but has no test.
    #[error(
        "mode {mode}, fault {fault} and L = {length} have no certificate, nor are they among the windows without test; \
         design the gains again"
    )]
    NoTest {
        /// The mode.
        mode: FaultMode,
        /// The fault.
        fault: usize,
        /// L.
        length: usize,
    },
    /// A window that is said to have no test, but has one or is not asked for.
    #[error(
        "mode {mode}, fault {fault} and L = {length} are said to have no test, but they have one or the configuration \
         does not ask for it; design the gains again"
    )]
    Tested {
        /// Position in the list of windows without test.
        index: usize,
        /// The mode.
        mode: FaultMode,
        /// The fault.
        fault: usize,
        /// L.
        length: usize,
    },
    /// Two certificates for the same test.
    #[error("mode {mode}, fault {fault} and L = {length} have two certificates; leave one of them out")]
    RepeatedCertificate {
        /// Position in the list of certificates.
        index: usize,
        /// Their mode.
        mode: FaultMode,
        /// Their fault.
        fault: usize,
        /// L.
        length: usize,
    },
}

impl GainsError {
    /// Dotted path of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::Table(error) => error.key(),
            Self::Missing { .. } => "gains.mode".to_owned(),
            Self::UnknownMode { index, .. } | Self::RepeatedMode { index, .. } => {
                format!("gains.mode.{index}.mode")
            }
            Self::Unused { index, matrix, .. } => format!("gains.mode.{index}.{matrix}"),
            Self::Fixed { index, .. } => format!("gains.mode.{index}.L_fix"),
            Self::Decoupling { index, .. } => format!("gains.mode.{index}"),
            Self::NoTest { .. } => "gains.certificate".to_owned(),
            Self::Tested { index, .. } => format!("gains.untested.{index}"),
            Self::Certificate { index, .. }
            | Self::CertificateOfUntestedMode { index, .. }
            | Self::RepeatedCertificate { index, .. } => format!("gains.certificate.{index}"),
        }
    }
}

/// Checks that every entry has a place in a bank with these modes that have a filter.
pub(super) fn check_places(
    gains: &UnknownInputFilterGains,
    modes: &[FaultMode],
    form: Form,
) -> Result<(), GainsError> {
    for (index, entry) in gains.modes.iter().enumerate() {
        let mode = entry.mode;
        if !modes.contains(&mode) {
            return Err(GainsError::UnknownMode { index, mode });
        }
        if gains.modes[..index].iter().any(|before| before.mode == mode) {
            return Err(GainsError::RepeatedMode { index, mode });
        }
    }
    for (index, certificate) in gains.certificates.iter().enumerate() {
        let mode = certificate.mode;
        if form != Form::Coupled || !modes.contains(&mode) {
            return Err(GainsError::CertificateOfUntestedMode { index, mode });
        }
        let (fault, length) = (certificate.fault, certificate.length);
        let same = |before: &super::certificate::ParityCertificate| {
            (before.mode, before.fault, before.length) == (mode, fault, length)
        };
        if gains.certificates[..index].iter().any(same) {
            return Err(GainsError::RepeatedCertificate {
                index,
                mode,
                fault,
                length,
            });
        }
    }
    Ok(())
}

/// L_fix of a mode in the coupled form, after all its conditions were checked; none where the rule needs none.
pub(super) fn fixed_gain(
    plant: &Plant,
    filter: &super::filter::CoupledFilter,
    gains: &UnknownInputFilterGains,
    options: &UnknownInputFilterOptions,
    nominal: &Nominal,
) -> Result<Option<FixedGain>, GainsError> {
    let (mode, rule) = (filter.mode, options.filter.gain);
    let entry = gains.of(mode);
    if let Some((index, entry)) = entry {
        let unused = [("S", &entry.s), ("T", &entry.t), ("N", &entry.n)];
        refuse_unused(index, mode, &unused)?;
        if rule == GainRule::Frobenius {
            refuse_unused(index, mode, &[("L_fix", &entry.fixed)])?;
        }
    }
    let Some((index, rows)) = entry.and_then(|(index, entry)| Some((index, entry.fixed.as_ref()?))) else {
        return match rule {
            GainRule::Fixed => Err(GainsError::Missing {
                mode,
                matrix: "L_fix",
            }),
            GainRule::RowWise | GainRule::Frobenius => Ok(None),
        };
    };
    let key = format!("gains.mode.{index}.L_fix");
    let gain = shaped_matrix(&key, rows, (plant.nx(), plant.ny()), "states x outputs")?;
    let fixed = FixedGain::check(plant, filter, &(&gain).into(), nominal);
    fixed
        .map(Some)
        .map_err(|source| GainsError::Fixed { index, mode, source })
}

/// The decoupling pair of a mode in the forms of the paper, after all its conditions were checked.
pub(super) fn observer(
    plant: &Plant,
    mode: FaultMode,
    gains: &UnknownInputFilterGains,
) -> Result<UnknownInputObserver, GainsError> {
    let (index, entry) = gains.of(mode).ok_or(GainsError::Missing {
        mode,
        matrix: "T and N",
    })?;
    let ModeGains { s, t, n, fixed, .. } = entry;
    refuse_unused(index, mode, &[("L_fix", fixed)])?;
    if mode.is_empty() {
        refuse_unused(index, mode, &[("S", s)])?;
    }
    let (nx, ny) = (plant.nx(), plant.ny());
    let read = |name: &'static str, rows: &Option<Vec<Vec<f64>>>, shape, meaning| {
        let key = format!("gains.mode.{index}.{name}");
        let rows = rows.as_ref().ok_or(GainsError::Missing { mode, matrix: name })?;
        Ok::<_, GainsError>(shaped_matrix(&key, rows, shape, meaning)?)
    };
    let t = read("T", t, (nx, nx), "states x states")?;
    let n = read("N", n, (nx, ny), "states x outputs")?;
    let s = match s {
        Some(_) => Some(read("S", s, (nx, ny), "states x outputs")?),
        None => None,
    };
    let c = plant.c.to_dense();
    let f = mode.unknown_input_matrix(&plant.b.to_dense());
    let observer = UnknownInputObserver::new(plant, mode, s.as_ref());
    let expected = observer.n.to_dense();
    let identity = DMatrix::identity(nx, nx);
    let product = &n * &c;
    // T may vanish: what rounds in it are the terms of I - N C.
    let terms = product.amax().max(1.0);
    for (equality, miss, size) in [
        ("N = L0 + S P", &n - &expected, expected.amax().max(n.amax())),
        ("T + N C = I", &t + &product - &identity, terms),
        ("T F = 0", &t * &f, terms * f.amax()),
    ] {
        let residual = relative(&miss, size);
        let holds = residual <= ROUNDING;
        if !holds {
            return Err(GainsError::Decoupling {
                index,
                mode,
                equality,
                residual,
            });
        }
    }
    Ok(observer)
}

fn relative(miss: &DMatrix<f64>, size: f64) -> f64 {
    match miss.is_empty() {
        true => 0.0,
        false => miss.amax() / size.max(f64::MIN_POSITIVE),
    }
}

fn refuse_unused(
    index: usize,
    mode: FaultMode,
    matrices: &[(&'static str, &Option<Vec<Vec<f64>>>)],
) -> Result<(), GainsError> {
    match matrices.iter().find(|(_, rows)| rows.is_some()) {
        Some(&(matrix, _)) => Err(GainsError::Unused { index, mode, matrix }),
        None => Ok(()),
    }
}
