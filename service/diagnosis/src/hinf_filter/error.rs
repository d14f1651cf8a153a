//! Why a configuration of the filter is refused, and what to do about it.

use crate::{riccati::RiccatiError, tables::TableError};
use thiserror::Error;

/// Why the filter cannot run as configured.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum HinfFilterError {
    /// A list with a wrong shape or an entry that is not finite.
    #[error(transparent)]
    Table(#[from] TableError),
    /// A matrix without entries where one is needed.
    #[error("`{key}` is empty; it needs at least one {what}")]
    Empty {
        /// Dotted path of the entry.
        key: String,
        /// What is missing.
        what: &'static str,
    },
    /// A number outside its range.
    #[error("`{key}` is {value}; {allowed}")]
    OutOfRange {
        /// Dotted path of the entry.
        key: String,
        /// The configured value.
        value: f64,
        /// What is allowed.
        allowed: &'static str,
    },
    /// An entry without which the others cannot work.
    #[error("`{key}` is missing; {reason}")]
    Missing {
        /// Dotted path of the entry.
        key: &'static str,
        /// Why it is needed and what to do.
        reason: &'static str,
    },
    /// Entries that do not fit together.
    #[error("`{key}` cannot be used {reason}")]
    Conflict {
        /// Dotted path of the entry.
        key: &'static str,
        /// With what, and what to do.
        reason: &'static str,
    },
    /// A name that is not among the faults, or occurs twice.
    #[error("`{key}` has \"{name}\", which {reason}")]
    FaultName {
        /// Dotted path of the entry.
        key: String,
        /// The name.
        name: String,
        /// What is wrong and what to do.
        reason: &'static str,
    },
    /// A slow or unstable mode that no output shows.
    #[error(
        "the eigenvalue {eigenvalue} of {matrix} does not decay and is not observable in `model.C`; measure \
         something that shows this mode, or take it out of the model{hint}"
    )]
    NotDetectable {
        /// A or its sampled form.
        matrix: &'static str,
        /// The eigenvalue.
        eigenvalue: String,
        /// More for the sampled form.
        hint: &'static str,
    },
    /// A plant that is not stable although that is required.
    #[error(
        "`model.A` has the eigenvalue {eigenvalue}, which does not decay; set `model.require_stable` = false if the \
         plant is unstable, the filter needs observable unstable modes only"
    )]
    NotStable {
        /// The eigenvalue.
        eigenvalue: String,
    },
    /// A listed model that is not stable.
    #[error(
        "`model.listed_models` has in entry {index} an A with the eigenvalue {eigenvalue}; the bound over a listed \
         model needs a stable one, remove it"
    )]
    ListedModelNotStable {
        /// Position, from 0.
        index: usize,
        /// The eigenvalue.
        eigenvalue: String,
    },
    /// A design whose optimum is 0 and not reached by any gain.
    #[error(
        "`model.Dd` is zero and `synthesis.noise_weight` as well: larger and larger gains would be better; give a \
         noise weight"
    )]
    Unbounded,
    /// A window that is not a multiple of the period.
    #[error(
        "`evaluation.window` is {window} s, {samples} periods; it must be a whole number of periods, at least 1"
    )]
    Window {
        /// s.
        window: f64,
        /// Window by period.
        samples: f64,
    },
    /// A continuous design by matrix inequalities whose optimum is 0 and not reached by any gain.
    #[error(
        "`model.Dd` is zero: larger and larger gains would be better; bound the poles by `synthesis.pole_radius`, or use \
         a Riccati design with a noise weight"
    )]
    UnboundedInequalities,
    /// A design that needs a solver where there is none.
    #[error(
        "`synthesis.type` = \"{design}\" needs a solver for matrix inequalities; run `residuald design` and configure \
         its gains file, or use \"riccati_dt\""
    )]
    NeedsSolver {
        /// The design.
        design: &'static str,
    },
    /// Gains of another design.
    #[error("the gains come from the design \"{found}\", not \"{wanted}\"; design the gains again")]
    OtherDesign {
        /// The gains' design.
        found: &'static str,
        /// The configured one.
        wanted: &'static str,
    },
    /// Gains that differ from those of the configuration.
    #[error("the gains are not those that `synthesis` gives; design the gains again")]
    NotTheGivenGains,
    /// A label that the certificate does not bear out.
    #[error(
        "the gains are labelled \"{stated}\", their certificate says \"{found}\"; design the gains again"
    )]
    Label {
        /// The gains' label.
        stated: String,
        /// The certificate's.
        found: String,
    },
    /// Gains of another number of filters, or of other filters.
    #[error("the gains are for {found}, the configuration asks for {wanted}; design the gains again")]
    OtherFilters {
        /// Dotted path of the entry.
        key: String,
        /// The gains' filters.
        found: String,
        /// The configured ones.
        wanted: String,
    },
    /// An estimating filter whose residual does not pass the faults unchanged.
    #[error(
        "the filter of the fault estimate does not give T_rf = Df: Bfd - L Df has a part {rest:e} of Bfd, 1e-9 is \
         allowed (margin {margin:e}); design the gains again"
    )]
    NotTheEstimate {
        /// Largest entry of Bfd - L Df relative to Bfd.
        rest: f64,
        /// 1e-9 less that.
        margin: f64,
    },
    /// Gains that fail a condition.
    #[error("{source}")]
    Gains {
        /// Dotted path of the entry.
        key: String,
        /// Why.
        source: Box<HinfFilterError>,
    },
    /// The Riccati equation has no usable solution.
    #[error("the design of {filter} failed: {source}; increase `synthesis.noise_weight`")]
    Riccati {
        /// Which filter.
        filter: String,
        /// Why.
        source: RiccatiError,
    },
    /// There is no matched gain.
    #[error(
        "`synthesis.type` = \"matched\" needs Bd (I - Dd⁺Dd) = 0, but some disturbance acts on the state without being \
         seen in the outputs; use \"riccati_dt\""
    )]
    NotMatched,
    /// A gain that is too large.
    #[error(
        "the norm of the gain is {norm}, above `synthesis.max_gain` = {limit}; increase the noise weight or the limit"
    )]
    GainTooLarge {
        /// σ_max of the gain.
        norm: f64,
        /// The limit.
        limit: f64,
    },
    /// A filter that does not decay.
    #[error("{filter} is not stable: its pole of largest growth is {pole}; use another gain")]
    FilterNotStable {
        /// Which filter, in which form.
        filter: String,
        /// The pole.
        pole: String,
    },
    /// A gain that fails its certificate.
    #[error(
        "the gain is uncertified: {reason} (margin {margin:.3e}); use another gain, or set \
         `synthesis.allow_uncertified` = true and do without a guarantee"
    )]
    Certificate {
        /// Which condition does not hold.
        reason: String,
        /// By how much, negative.
        margin: f64,
    },
    /// A response that does not decay in any useful time.
    #[error("{filter} decays too slowly for a threshold to be computed; use a gain with faster poles")]
    TooSlow {
        /// Which filter.
        filter: String,
    },
    /// A fault that no filter blind to the others can see.
    #[error(
        "entry {index} of `isolation.blind_sets` cannot be told from the fault \"{fault}\": both reach the outputs in \
         the same directions; blind the filter to fewer faults"
    )]
    NotIsolable {
        /// Position, from 0.
        index: usize,
        /// The fault.
        fault: String,
    },
    /// A filter that is not blind enough.
    #[error(
        "entry {index} of `isolation.blind_sets` still passes its blind faults with gain {gain}; increase \
         `isolation.blind_weight`"
    )]
    NotBlind {
        /// Position, from 0.
        index: usize,
        /// ‖V T_blind‖∞.
        gain: f64,
    },
    /// No filter estimates the faults.
    #[error("`isolation.fault_estimate` is impossible: {reason}; set it to false")]
    NoEstimate {
        /// Why.
        reason: String,
    },
    /// More channels than a record holds.
    #[error("the filters have {count} channels, a record holds {limit}; use fewer `isolation.blind_sets`")]
    TooManyChannels {
        /// How many there would be.
        count: usize,
        /// How many fit.
        limit: usize,
    },
    /// The eigenvalues of a matrix could not be computed.
    #[error("the eigenvalues of {matrix} could not be computed; scale the states to similar sizes")]
    Eigenvalues {
        /// Which matrix.
        matrix: &'static str,
    },
}

impl HinfFilterError {
    /// The same about gains at `key`; errors that name an entry of the gains keep it.
    pub(super) fn of_gains(self, key: impl Into<String>) -> Self {
        if self.key().starts_with("gains.") {
            return self;
        }
        Self::Gains {
            key: key.into(),
            source: Box::new(self),
        }
    }

    /// Dotted path, inside the diagnoser's table, of the entry to look at.
    pub fn key(&self) -> String {
        match self {
            Self::Table(error) => return error.key(),
            Self::OutOfRange { key, .. } | Self::FaultName { key, .. } | Self::Empty { key, .. } => {
                return key.clone();
            }
            Self::Missing { key, .. } | Self::Conflict { key, .. } => key,
            Self::NotDetectable { .. } => "model.C",
            Self::NotStable { .. } | Self::Eigenvalues { .. } => "model.A",
            Self::ListedModelNotStable { index, .. } => return format!("model.listed_models.{index}.A"),
            Self::Unbounded | Self::Riccati { .. } => "synthesis.noise_weight",
            Self::UnboundedInequalities => "synthesis.type",
            Self::OtherFilters { key, .. } | Self::Gains { key, .. } => return key.clone(),
            Self::OtherDesign { .. } | Self::NotTheGivenGains => "gains.main.design",
            Self::Label { .. } => "gains.main.label",
            Self::NotTheEstimate { .. } => "gains.estimator.L",
            Self::Window { .. } => "evaluation.window",
            Self::NotMatched
            | Self::NeedsSolver { .. }
            | Self::FilterNotStable { .. }
            | Self::Certificate { .. }
            | Self::TooSlow { .. } => "synthesis.type",
            Self::GainTooLarge { .. } => "synthesis.max_gain",
            Self::NotIsolable { index, .. } | Self::NotBlind { index, .. } => {
                return format!("isolation.blind_sets.{index}");
            }
            Self::NoEstimate { .. } => "isolation.fault_estimate",
            Self::TooManyChannels { .. } => "isolation.blind_sets",
        }
        .to_owned()
    }
}
