//! The design that belongs to given gains: everything that is fixed before the first sample (method sheet 3).

use residual_shared::record::MAX_FAULTS;

use nalgebra::DMatrix;

use super::{
    certificate::Certificate,
    decoupling::Decoupling,
    error::ConstructionError,
    gains::{MainGains, ReducedOrderObserverGains},
    isolation_verification::isolation_observers,
    observer::Observer,
    observer_design::ObserverDesign,
    options::{Gains, Mode, NamedM, ObserverM, ReducedOrderObserverOptions},
    plant::Plant,
    source::Source,
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
        warnings.extend(fall_backs(&plant, options, &gains.main)?);
        warnings.extend(rounding_warning(
            &main.observer,
            options.bounds.rounding_tolerance,
        ));
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

/// Where gains of a closed form stand for those of a solver that the options insist on.
fn fall_backs(
    plant: &Plant,
    options: &ReducedOrderObserverOptions,
    gains: &MainGains,
) -> Result<Vec<String>, ConstructionError> {
    let design = &options.design;
    let mut warnings = Vec::new();
    let as_asked = match design.gains {
        Gains::H2 => gains.source == Source::NoiseAware,
        Gains::Lmi => matches!(gains.source, Source::Paper(_)),
        Gains::Auto | Gains::ClosedForm | Gains::Given => true,
    };
    if !as_asked && Decoupling::new(plant, &plant.d)?.has_choice() {
        warnings.push(format!(
            "`design.gains` = \"{}\" is not what K comes from: the gains fell back to {}",
            design.gains.name(),
            gains.source
        ));
    }
    if design.observer_m == ObserverM::Named(NamedM::Lmi) && gains.m.iter().flatten().all(|m| *m == 0.0) {
        warnings.push(
            "`design.observer_M` = \"lmi\" is not what M comes from: the gains fell back to M = 0".to_owned(),
        );
    }
    Ok(warnings)
}

/// ε (|J| + |F||K|)(1 + |A12|), with maximal row sums, is about what rounding in ẑ2, which is as large as K y, adds to
/// a residual per unit of y.
fn rounding_warning(observer: &Observer, tolerance: f64) -> Option<String> {
    let size = |matrix: &DMatrix<f64>| {
        let rows = matrix
            .row_iter()
            .map(|row| row.iter().map(|entry| entry.abs()).sum());
        rows.fold(0.0, f64::max)
    };
    let hidden = size(&observer.j) + size(&observer.f) * size(&observer.k);
    let rounding = f64::EPSILON * hidden * (1.0 + size(&observer.a12));
    (rounding > tolerance).then(|| {
        format!(
            "gains as large as {:.3e} let rounding add about {rounding:.1e} to a residual for each unit of the outputs, \
             more than `bounds.rounding_tolerance` = {tolerance:e}: false alarms are not excluded; scale the states of \
             the model or raise the tolerance",
            observer.k.amax()
        )
    })
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
