//! The choice of K and M for the main observer among candidates, and all gains that follow (method sheet 3.2, 3.6).
//!
//! Candidates come from closed forms here; whoever has a solver adds its own and further test rows.

use super::{
    candidates::{Candidate, closed_forms},
    certificate::Certificate,
    decoupling::Decoupling,
    design::checked_plant,
    directions::{MAX_FACET_OUTPUTS, test_directions},
    error::ConstructionError,
    floors::fault_floors,
    gains::{MainGains, ReducedOrderObserverGains},
    isolation_design::{IsolationGains, find_isolation_gains},
    observer::{Decoupled, Observer},
    observer_design::{ObserverDesign, convergence_limit, convergence_reason, reach},
    options::{Gains, Mode, NamedM, Objective, ObserverM, ReducedOrderObserverOptions, Test},
    plant::Plant,
    reach::Reach,
    source::Source,
};
use crate::{gains::FoundGains, tables::shaped_matrix};
use nalgebra::{DMatrix, DVector};

/// A later candidate must be better by this share: rounding does not choose.
const BETTER: f64 = 1.0 - 1e-9;

/// Further test rows for an observer, unit vectors of length p: method sheet 3.8, rule 4.
pub type Directions<'a> = dyn FnMut(&Observer, &Reach) -> Vec<DVector<f64>> + 'a;

/// A gain after its acceptance.
#[derive(Clone, Debug, PartialEq)]
pub struct Accepted {
    /// Where it comes from.
    pub source: Source,
    /// The observer.
    pub design: ObserverDesign,
}

/// The problem: a plant whose assumptions hold, and what is asked for.
#[derive(Clone, Debug)]
pub struct Synthesis<'a> {
    /// What is asked for.
    pub options: &'a ReducedOrderObserverOptions,
    /// The plant in the coordinates x' = T_c x.
    pub plant: Plant,
    /// All decoupling gains of the main observer.
    pub decoupling: Decoupling,
}

/// Finds all gains without a solver.
///
/// # Errors
/// [`ConstructionError`]: an assumption of method sheet 3.1 does not hold, or no gain is accepted.
pub fn find_gains(
    options: &ReducedOrderObserverOptions,
) -> Result<FoundGains<ReducedOrderObserverGains>, ConstructionError> {
    let synthesis = Synthesis::new(options)?;
    let (accepted, refused) = synthesis.accept_all(
        synthesis.closed_forms(),
        &synthesis.configured_m()?,
        &mut |_, _| Vec::new(),
    );
    let best = synthesis
        .smallest(accepted)
        .ok_or_else(|| synthesis.rejected(&refused))?;
    let mut found = synthesis.complete(best);
    let warnings = synthesis.missed_without_solver();
    found.warnings.splice(0..0, warnings);
    Ok(found)
}

impl<'a> Synthesis<'a> {
    /// Checks the options and the assumptions of method sheet 3.1.
    ///
    /// # Errors
    /// The first [`ConstructionError`] found.
    pub fn new(options: &'a ReducedOrderObserverOptions) -> Result<Self, ConstructionError> {
        let plant = checked_plant(options)?;
        let decoupling = Decoupling::new(&plant, &plant.d)?;
        Ok(Self {
            options,
            plant,
            decoupling,
        })
    }

    /// M as configured; zero where it is to come from the paper's inequality.
    ///
    /// # Errors
    /// [`ConstructionError::Table`].
    pub fn configured_m(&self) -> Result<DMatrix<f64>, ConstructionError> {
        let p = self.plant.outputs();
        match &self.options.design.observer_m {
            ObserverM::Named(NamedM::Zero | NamedM::Lmi) => Ok(DMatrix::zeros(p, p)),
            ObserverM::Matrix(rows) => Ok(shaped_matrix(
                "design.observer_M",
                rows,
                (p, p),
                "outputs x outputs",
            )?),
        }
    }

    /// The gains that need no solver, in the order in which equal ones are preferred.
    pub fn closed_forms(&self) -> Vec<Candidate> {
        closed_forms(&self.plant, &self.decoupling, &self.options.design)
    }

    /// Whether there is more than one decoupling gain; else it is K0.
    pub fn has_choice(&self) -> bool {
        self.decoupling.has_choice()
    }

    /// Whether combinations of outputs are tested by more than facets can say: method sheet 3.8, rule 4.
    pub fn lacks_facets(&self) -> bool {
        let bounds = &self.options.bounds;
        bounds.mode == Mode::Joint
            && bounds.tests.contains(&Test::Set)
            && self.plant.outputs() > MAX_FACET_OUTPUTS
    }

    /// What the options ask for that only a solver finds.
    fn missed_without_solver(&self) -> Vec<String> {
        let design = &self.options.design;
        let mut warnings = Vec::new();
        if design.observer_m == ObserverM::Named(NamedM::Lmi) {
            warnings.push(
                "`design.observer_M` = \"lmi\" needs a solver that is not at hand; M = 0 is used".to_owned(),
            );
        }
        if matches!(design.gains, Gains::H2 | Gains::Lmi) && self.has_choice() {
            warnings.push(format!(
                "`design.gains` = \"{}\" needs a solver that is not at hand; the best closed-form gains are used",
                design.gains.name()
            ));
        }
        if self.lacks_facets() {
            warnings.push(format!(
                "`bounds.tests`: with {} outputs the set is tested by the outputs and the directions blind to the \
                 disturbance only; directions that tell faults best need a solver that is not at hand",
                self.plant.outputs()
            ));
        }
        warnings
    }

    /// Projection, convergence and tables of one candidate (method sheet 3.6); the reason of a refusal.
    ///
    /// # Errors
    /// The condition that does not hold, in words.
    pub fn accept(
        &self,
        candidate: Candidate,
        m: &DMatrix<f64>,
        directions: &mut Directions<'_>,
    ) -> Result<Accepted, String> {
        let k = self.decoupling.project(&candidate.k?);
        if !self.decoupling.is_decoupled(&k) {
            return Err("K D1 + D2 does not vanish after projection".to_owned());
        }
        let decoupled = Decoupled {
            disturbances: true,
            actuator: None,
        };
        let observer = Observer::new(&self.plant, k, m.clone(), decoupled);
        if let Some((_, reason)) = convergence_reason(&observer, convergence_limit(self.options)) {
            return Err(reason);
        }
        let reach = reach(&self.plant, &observer)?;
        let set = self.options.bounds.tests.contains(&Test::Set);
        let further = match set {
            true => directions(&observer, &reach),
            false => Vec::new(),
        };
        let most = self.options.bounds.max_directions;
        let tests = test_directions(&self.plant, &reach, set, &further, most);
        Ok(Accepted {
            source: candidate.source,
            design: ObserverDesign::new(observer, reach, tests, None),
        })
    }

    /// The accepted ones of some candidates, and why the others are not.
    pub fn accept_all(
        &self,
        candidates: Vec<Candidate>,
        m: &DMatrix<f64>,
        directions: &mut Directions<'_>,
    ) -> (Vec<Accepted>, Vec<String>) {
        let (mut accepted, mut refused) = (Vec::new(), Vec::new());
        for candidate in candidates {
            let source = candidate.source.clone();
            match self.accept(candidate, m, directions) {
                Ok(found) => accepted.push(found),
                Err(reason) => refused.push(format!("{source}: {reason}")),
            }
        }
        (accepted, refused)
    }

    /// The error when no candidate is accepted, with the reasons.
    pub fn rejected(&self, reasons: &[String]) -> ConstructionError {
        ConstructionError::SynthesisRejected {
            key: match self.options.design.gains {
                Gains::Given => "design.K",
                Gains::ClosedForm => "design.poles",
                Gains::Auto | Gains::H2 | Gains::Lmi => "design.spectral_radius_max",
            },
            reason: format!(
                "{}; allow a larger `design.spectral_radius_max` below 1 or choose other gains",
                reasons.join("; ")
            ),
        }
    }

    /// The one with the smallest objective; of nearly equal ones the first.
    pub fn smallest(&self, accepted: impl IntoIterator<Item = Accepted>) -> Option<Accepted> {
        let mut best: Option<(f64, Accepted)> = None;
        for found in accepted {
            let value = self.objective(&found.design);
            if best.as_ref().is_none_or(|(least, _)| value < BETTER * *least) {
                best = Some((value, found));
            }
        }
        best.map(|(_, found)| found)
    }

    /// What the choice minimises. Without noise many floors are zero; the rounding tolerance of the test orders them.
    pub fn objective(&self, design: &ObserverDesign) -> f64 {
        match self.options.design.objective {
            Objective::Width => design.hull().sum(),
            Objective::FaultFloor => {
                let steady = design.steady().add_scalar(self.options.bounds.rounding_tolerance);
                let floors = fault_floors(&design.observer, &design.tests, &steady);
                let scale = self.options.design.fault_scale.as_deref().unwrap_or_default();
                let weighted = floors.iter().enumerate();
                weighted
                    .map(|(j, floor)| floor / scale.get(j).copied().unwrap_or(1.0))
                    .fold(0.0, f64::max)
            }
        }
    }

    /// All gains, with the certificate of the chosen ones and with members and estimators.
    pub fn complete(&self, chosen: Accepted) -> FoundGains<ReducedOrderObserverGains> {
        let isolates = self.options.bounds.mode == Mode::Joint && self.options.isolation.enabled;
        let isolation = match isolates {
            true => find_isolation_gains(&self.plant, self.options),
            false => IsolationGains::default(),
        };
        let certificate = Certificate::find(&self.plant, &chosen.design.observer);
        let certificate = certificate.map(|(_, certificate)| certificate);
        FoundGains {
            warnings: isolation.warnings,
            ..FoundGains::closed_form(ReducedOrderObserverGains {
                main: MainGains::new(&chosen.design, chosen.source, certificate.as_ref()),
                members: isolation.members,
                estimators: isolation.estimators,
            })
        }
    }
}
