//! Where a gain K of the main observer comes from, in the words of a gains file (method sheet 3.2 to 3.6).

use super::{closed_form::closed_form, decoupling::Decoupling, options::DesignOptions};
use crate::tables::shaped_matrix;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A gain of a closed form may differ by this from the same one of another machine, relative to 1 + |K|.
const SAME: f64 = 1e-6;

const GIVEN: &str = "given K";
const PARTICULAR: &str = "K0";
const POLES: &str = "closed form with poles ";
const NOISE_AWARE: &str = "the gain of the noise-aware inequality";
const PAPER: &str = "the gain of the paper's inequality with decay rate ";

/// The design that a gain K comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Source {
    /// `design.K`.
    Given,
    /// K0 = -D2 D1⁺, the decoupling gain of least norm.
    Particular,
    /// Eigenvalues of F, by a closed form.
    Poles(Vec<f64>),
    /// The noise-aware inequality, by a solver.
    NoiseAware,
    /// The paper's inequality with this decay rate, by a solver.
    Paper(f64),
}

impl Source {
    /// Whether K is the gain of this source, which only a solver can tell of its own.
    pub(super) fn is_of(&self, k: &DMatrix<f64>, decoupling: &Decoupling, design: &DesignOptions) -> bool {
        let stated = match self {
            Self::NoiseAware | Self::Paper(_) => return true,
            Self::Particular => Some(decoupling.k0.clone()),
            Self::Poles(poles) => closed_form(decoupling, poles).ok(),
            Self::Given => {
                let rows = design.k.as_deref().unwrap_or_default();
                shaped_matrix("design.K", rows, k.shape(), "unmeasured states x outputs").ok()
            }
        };
        stated.is_some_and(|stated| {
            let stated = decoupling.project(&stated);
            (k - &stated).norm() <= SAME * (1.0 + stated.norm())
        })
    }

    /// Whether a solver finds it, so that nothing short of solving again can check it.
    pub(super) fn is_of_solver(&self) -> bool {
        matches!(self, Self::NoiseAware | Self::Paper(_))
    }
}

impl fmt::Display for Source {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Given => formatter.write_str(GIVEN),
            Self::Particular => formatter.write_str(PARTICULAR),
            Self::Poles(poles) => write!(formatter, "{POLES}{poles:?}"),
            Self::NoiseAware => formatter.write_str(NOISE_AWARE),
            Self::Paper(rate) => write!(formatter, "{PAPER}{rate}"),
        }
    }
}

impl From<Source> for String {
    fn from(source: Source) -> Self {
        source.to_string()
    }
}

impl TryFrom<String> for Source {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let poles = |text: &str| -> Option<Vec<f64>> {
            let inner = text.strip_prefix(POLES)?.strip_prefix('[')?.strip_suffix(']')?;
            let numbers = inner
                .split(',')
                .map(str::trim)
                .filter(|number| !number.is_empty());
            numbers.map(|number| number.parse().ok()).collect()
        };
        let rate = |text: &str| text.strip_prefix(PAPER)?.parse().ok();
        match text.as_str() {
            GIVEN => Ok(Self::Given),
            PARTICULAR => Ok(Self::Particular),
            NOISE_AWARE => Ok(Self::NoiseAware),
            other => poles(other)
                .map(Self::Poles)
                .or_else(|| rate(other).map(Self::Paper))
                .ok_or_else(|| format!("`{other}` is no source of a gain; design the gains again")),
        }
    }
}
