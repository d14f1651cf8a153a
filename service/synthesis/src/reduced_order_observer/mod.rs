//! Gains of the reduced-order observer with a solver (method sheet 3.3 to 3.8).
//!
//! A solver proposes; `residual_diagnosis::reduced_order_observer::synthesis` projects, checks and compares its
//! proposals with the closed forms. A proposal that fails leaves a warning and the closed forms.

// `!(x <= limit)` refuses a number that is not one, `x > limit` accepts it.
#![allow(clippy::neg_cmp_op_on_partial_ord)]

pub mod fault_directions;
pub mod noise_aware;
pub mod paper_inequality;
mod proposals;

use self::{
    fault_directions::fault_directions,
    proposals::{Proposal, Proposals},
};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    gains::FoundGains,
    method::Refusal,
    reduced_order_observer::{
        gains::ReducedOrderObserverGains,
        observer::Observer,
        options::{Gains, ReducedOrderObserverOptions},
        plant::Plant,
        reach::Reach,
        synthesis::{Accepted, Synthesis},
    },
};

/// The noise-aware gain may widen the bounds of the best closed form by this (method sheet 3.6, 4).
const WIDER: f64 = 1.05;

/// Finds the gains as the options ask for them.
///
/// `progress` hears of each longer piece of work before it begins.
///
/// # Errors
/// [`Refusal`]: an assumption of method sheet 3.1 does not hold, or no gain is accepted.
pub fn find_gains(
    options: &ReducedOrderObserverOptions,
    _sample_time_s: f64,
    progress: &mut dyn FnMut(&str),
) -> Result<FoundGains<ReducedOrderObserverGains>, Refusal> {
    let synthesis = Synthesis::new(options)?;
    let mut rows = DirectionSearch::new(&synthesis);
    if rows.needed {
        progress("linear programs for the test directions");
    }
    let proposals = Proposals::new(&synthesis, progress);
    let m = match &proposals.m {
        Some(m) => m.clone(),
        None => synthesis.configured_m()?,
    };
    let mut directions = |observer: &Observer, reach: &Reach| rows.find(observer, reach);
    let (closed, refused) = synthesis.accept_all(synthesis.closed_forms(), &m, &mut directions);

    let mut warnings = proposals.warnings;
    let mut runs = proposals.runs;
    let mut accepted = Vec::new();
    for proposal in proposals.gains {
        let source = proposal.candidate.source.clone();
        match judged(&synthesis, &proposal, &closed, &m, &mut directions) {
            Ok(found) => accepted.push((found, proposal.run)),
            Err(reason) => warnings.push(format!("{source} is not used: {reason}")),
        }
    }
    let insisted = matches!(options.design.gains, Gains::H2 | Gains::Lmi) && synthesis.has_choice();
    if insisted && accepted.is_empty() {
        warnings.push("the best closed-form gains are used instead".to_owned());
    }
    let others = if insisted && !accepted.is_empty() {
        Vec::new()
    } else {
        closed
    };
    let all = others
        .into_iter()
        .chain(accepted.iter().map(|(found, _)| found.clone()));
    let chosen = match synthesis.smallest(all) {
        Some(chosen) => chosen,
        None => return Err(synthesis.rejected(&refused).into()),
    };
    runs.extend(
        accepted
            .into_iter()
            .filter(|(found, _)| found.source == chosen.source)
            .map(|(_, run)| run),
    );
    warnings.extend(rows.warning());
    let mut found = synthesis.complete(chosen);
    found.warnings.splice(0..0, warnings);
    found.solver = runs;
    Ok(found)
}

/// Acceptance of one proposal; the noise-aware one must not be much wider than the closed forms.
fn judged(
    synthesis: &Synthesis<'_>,
    proposal: &Proposal,
    closed: &[Accepted],
    m: &DMatrix<f64>,
    directions: &mut dyn FnMut(&Observer, &Reach) -> Vec<DVector<f64>>,
) -> Result<Accepted, String> {
    let found = synthesis.accept(proposal.candidate.clone(), m, directions)?;
    let width = |found: &Accepted| found.design.hull().sum();
    let narrowest = closed.iter().map(width).fold(f64::INFINITY, f64::min);
    if proposal.noise_aware && !(width(&found) <= WIDER * narrowest) {
        return Err(format!(
            "its half widths add up to {:.6}, those of a closed form to {narrowest:.6}",
            width(&found)
        ));
    }
    Ok(found)
}

/// Test directions by linear programs, where facets are too many.
struct DirectionSearch {
    plant: Plant,
    needed: bool,
    solved: usize,
    failed: usize,
}

impl DirectionSearch {
    fn new(synthesis: &Synthesis<'_>) -> Self {
        Self {
            plant: synthesis.plant.clone(),
            needed: synthesis.lacks_facets(),
            solved: 0,
            failed: 0,
        }
    }

    fn find(&mut self, observer: &Observer, reach: &Reach) -> Vec<DVector<f64>> {
        if !self.needed {
            return Vec::new();
        }
        let found = fault_directions(&self.plant, observer, reach);
        self.solved += found.solved;
        self.failed += found.failed;
        found.directions
    }

    fn warning(&self) -> Option<String> {
        (self.failed > 0).then(|| {
            format!(
                "{} of {} linear programs for test directions have no solution; their directions are left out",
                self.failed,
                self.failed + self.solved
            )
        })
    }
}
