//! The whole off-line design: checks, gains, tests and tables (method sheet 3).

use residual_shared::record::MAX_FAULTS;

use super::{
    certificate::Certificate,
    directions::MAX_FACET_OUTPUTS,
    error::ConstructionError,
    isolation_design::{IsolationDesign, design_isolation},
    observer_design::ObserverDesign,
    options::{Mode, ReducedOrderObserverOptions, Test},
    plant::Plant,
    synthesis::synthesise,
};

/// Everything that is fixed before the first sample.
#[derive(Clone, Debug, PartialEq)]
pub struct Design {
    /// The configuration.
    pub options: ReducedOrderObserverOptions,
    /// The plant in the coordinates x' = T_c x.
    pub plant: Plant,
    /// The main observer.
    pub main: ObserverDesign,
    /// Where its gains come from.
    pub source: String,
    /// Members and estimators; none outside the joint mode.
    pub isolation: IsolationDesign,
    /// A Lyapunov certificate of the main observer, if one was found.
    pub certificate: Option<Certificate>,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

impl Design {
    /// Checks the options and designs.
    ///
    /// # Errors
    /// [`ConstructionError`] with the entry of the configuration that is wrong.
    pub fn new(options: &ReducedOrderObserverOptions) -> Result<Self, ConstructionError> {
        let plant = options.checked_plant()?;
        if plant.actuators() > MAX_FAULTS {
            return Err(ConstructionError::TooManyFaults {
                count: plant.actuators(),
                limit: MAX_FAULTS,
            });
        }
        let synthesis = synthesise(&plant, options)?;
        let mut warnings = synthesis.warnings;
        let joint = options.bounds.mode == Mode::Joint;
        if joint && options.bounds.tests.contains(&Test::Set) && plant.outputs() > MAX_FACET_OUTPUTS {
            warnings.push(format!(
                "`bounds.tests`: with {} outputs the set is tested by the outputs and the directions blind to the \
                 disturbance only, not by its facets",
                plant.outputs()
            ));
        }
        let isolation = match joint && options.isolation.enabled {
            true => design_isolation(&plant, options),
            false => IsolationDesign::default(),
        };
        warnings.extend(isolation.warnings.iter().cloned());
        let certificate = Certificate::new(&plant, &synthesis.design.observer);
        if certificate.is_none() {
            warnings.push(
                "no Lyapunov certificate was found for the chosen gains; F or M is nearly unstable"
                    .to_owned(),
            );
        }
        Ok(Self {
            options: options.clone(),
            plant,
            main: synthesis.design,
            source: synthesis.source,
            isolation,
            certificate,
            warnings,
        })
    }
}
