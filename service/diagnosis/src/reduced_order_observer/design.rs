//! The design that belongs to given gains: everything that is fixed before the first sample (method sheet 3).

use residual_shared::record::MAX_FAULTS;

use super::{
    certificate::Certificate,
    error::ConstructionError,
    gains::ReducedOrderObserverGains,
    isolation_verification::isolation_observers,
    observer_design::ObserverDesign,
    options::{Mode, ReducedOrderObserverOptions},
    plant::Plant,
    synthesis::find_gains,
    verification::main_observer,
};

/// Everything that is fixed before the first sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// The configuration.
    pub options: ReducedOrderObserverOptions,
    /// The gains that all the rest follows from.
    pub gains: ReducedOrderObserverGains,
    /// The plant in the coordinates x' = T_c x.
    pub plant: Plant,
    /// The main observer.
    pub main: ObserverDesign,
    /// Members and estimators; none outside the joint mode.
    pub isolation: IsolationDesign,
    /// The Lyapunov certificate of the main observer, if there is one.
    pub certificate: Option<Certificate>,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

/// The observers beside the main one.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct IsolationDesign {
    /// At most one per actuator: its rows do not react to that actuator's fault.
    pub members: Vec<ObserverDesign>,
    /// At most one per actuator: one row φ, φ (y - ẑ1) is the fault one sample ago, up to the row's half width.
    pub estimators: Vec<ObserverDesign>,
}

impl Design {
    /// Finds gains without a solver and designs with them.
    ///
    /// # Errors
    /// [`ConstructionError`] with the entry of the configuration that is wrong.
    pub fn new(options: &ReducedOrderObserverOptions) -> Result<Self, ConstructionError> {
        let found = find_gains(options)?;
        let mut design = Self::with_gains(options, &found.gains)?;
        design.warnings.extend(found.warnings);
        Ok(design)
    }

    /// Checks the options and the gains, and computes all tables.
    ///
    /// # Errors
    /// [`ConstructionError`]: the entry that is wrong, or the condition that the gains violate.
    pub fn with_gains(
        options: &ReducedOrderObserverOptions,
        gains: &ReducedOrderObserverGains,
    ) -> Result<Self, ConstructionError> {
        let plant = checked_plant(options)?;
        let (main, certificate) = main_observer(&plant, options, &gains.main)?;
        let isolates = options.bounds.mode == Mode::Joint && options.isolation.enabled;
        let beside = gains.members.len() + gains.estimators.len();
        if !isolates && beside > 0 {
            return Err(ConstructionError::GainsRefused {
                key: "gains".to_owned(),
                reason: "they have members or estimators, but the configuration asks for none".to_owned(),
            });
        }
        let [members, estimators] = match isolates {
            true => isolation_observers(&plant, options, &gains.members, &gains.estimators)?,
            false => [Vec::new(), Vec::new()],
        };
        let mut warnings = Vec::new();
        if certificate.is_none() {
            warnings.push(
                "no Lyapunov certificate of the gains is found; F or M is nearly unstable, or their entries differ too \
                 much in size"
                    .to_owned(),
            );
        }
        Ok(Self {
            options: options.clone(),
            gains: gains.clone(),
            plant,
            main,
            isolation: IsolationDesign { members, estimators },
            certificate,
            warnings,
        })
    }
}

/// The plant of options without a mistake.
pub(super) fn checked_plant(options: &ReducedOrderObserverOptions) -> Result<Plant, ConstructionError> {
    let plant = options.checked_plant()?;
    match plant.actuators() {
        count if count > MAX_FAULTS => Err(ConstructionError::TooManyFaults {
            count,
            limit: MAX_FAULTS,
        }),
        _ => Ok(plant),
    }
}
