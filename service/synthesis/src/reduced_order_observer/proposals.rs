//! What a solver proposes for the main observer (method sheet 3.6).

use super::{
    noise_aware::{self, NoiseAwareSolution},
    paper_inequality::{self, PaperSolution},
};
use nalgebra::DMatrix;
use residual_diagnosis::{
    gains::SolverRun,
    reduced_order_observer::{
        candidates::Candidate,
        closed_form::is_free,
        options::{Gains, NamedM, ObserverM},
        source::Source,
        synthesis::Synthesis,
    },
    spectrum::spectral_radius,
};

/// Decay rates of the paper's inequality that `gains = "auto"` tries.
const TRIED_RATES: [f64; 3] = [0.9, 0.5, 0.2];
/// A bound of |eig F| is asked for with this reserve, which the solver's accuracy uses up.
const RESERVE: f64 = 1.0 - 1e-6;

/// A gain that a solver proposes.
pub(super) struct Proposal {
    /// K and where it comes from.
    pub candidate: Candidate,
    /// What the solver said.
    pub run: SolverRun,
    /// It comes from the noise-aware inequality.
    pub noise_aware: bool,
}

/// All that a solver proposes.
pub(super) struct Proposals {
    /// Gains, in the order in which equal ones are preferred.
    pub gains: Vec<Proposal>,
    /// M of the paper's inequality, where it is asked for and Schur.
    pub m: Option<DMatrix<f64>>,
    /// What the solver said of M.
    pub runs: Vec<SolverRun>,
    /// What failed.
    pub warnings: Vec<String>,
}

impl Proposals {
    /// Solves what the options ask for.
    pub fn new(synthesis: &Synthesis<'_>, progress: &mut dyn FnMut(&str)) -> Self {
        let mut all = Self {
            gains: Vec::new(),
            m: None,
            runs: Vec::new(),
            warnings: Vec::new(),
        };
        let design = &synthesis.options.design;
        let wants_k = synthesis.has_choice();
        let wants_m = design.observer_m == ObserverM::Named(NamedM::Lmi);
        if design.gains == Gains::Lmi && wants_k || wants_m {
            let rate = design.lmi_decay_rate.unwrap_or(design.spectral_radius_max);
            match all.paper(synthesis, rate, progress) {
                Ok(solution) => {
                    if wants_m {
                        all.take_m(&solution);
                    }
                    if design.gains == Gains::Lmi && wants_k {
                        all.gains.push(proposal_of(solution, rate));
                    }
                }
                Err(reason) => all.warnings.push(reason),
            }
            if wants_m && all.m.is_none() {
                all.warnings
                    .push("M = 0 is used instead of the paper's".to_owned());
            }
        }
        let tries = design.gains == Gains::Auto && wants_k;
        let noisy = synthesis.plant.noise_bound.max() > 0.0;
        if design.gains == Gains::H2 && wants_k || tries && noisy {
            all.noise_aware(synthesis, progress);
        }
        if tries && is_free(&synthesis.decoupling) {
            all.try_rates(synthesis, progress);
        }
        all
    }

    fn paper(
        &self,
        synthesis: &Synthesis<'_>,
        rate: f64,
        progress: &mut dyn FnMut(&str),
    ) -> Result<PaperSolution, String> {
        progress(&format!("the paper's inequality with decay rate {rate}"));
        paper_inequality::solve(&synthesis.plant, rate)
            .map_err(|reason| format!("{} is not used: {reason}", Source::Paper(rate)))
    }

    fn take_m(&mut self, solution: &PaperSolution) {
        match spectral_radius(&solution.m) {
            Some(radius) if radius < 1.0 => {
                self.m = Some(solution.m.clone());
                self.runs.push(solution.run.clone());
            }
            _ => self
                .warnings
                .push("the M of the paper's inequality is not Schur".to_owned()),
        }
    }

    /// The paper's gains at the tried rates; a rate that some invariant zero exceeds has no solution, and a gain whose F
    /// is slower than allowed is no candidate.
    fn try_rates(&mut self, synthesis: &Synthesis<'_>, progress: &mut dyn FnMut(&str)) {
        let zeros = synthesis.decoupling.zeros.iter().map(|zero| zero.norm());
        let slowest = zeros.fold(0.0, f64::max);
        for rate in TRIED_RATES.into_iter().filter(|rate| *rate > slowest) {
            match self.paper(synthesis, rate, progress) {
                Ok(solution)
                    if radius_of_f(synthesis, &solution.k)
                        <= synthesis.options.design.spectral_radius_max =>
                {
                    self.gains.push(proposal_of(solution, rate));
                }
                Ok(_) => {}
                Err(reason) => self.warnings.push(reason),
            }
        }
    }

    /// The noise-aware gain; once more with a bound of |eig F| if it is slower than allowed.
    fn noise_aware(&mut self, synthesis: &Synthesis<'_>, progress: &mut dyn FnMut(&str)) {
        let (plant, decoupling) = (&synthesis.plant, &synthesis.decoupling);
        let limit = synthesis.options.design.spectral_radius_max;
        progress("the noise-aware inequality");
        let solution = noise_aware::solve(plant, decoupling, None).and_then(|solution| {
            if radius_of_f(synthesis, &solution.k) <= limit {
                return Ok(solution);
            }
            progress("the noise-aware inequality with bounded eigenvalues");
            noise_aware::solve(plant, decoupling, Some(limit * RESERVE))
        });
        match solution {
            Ok(NoiseAwareSolution { k, run, .. }) => self.gains.push(Proposal {
                candidate: Candidate {
                    source: Source::NoiseAware,
                    k: Ok(k),
                },
                run,
                noise_aware: true,
            }),
            Err(reason) => self
                .warnings
                .push(format!("{} is not used: {reason}", Source::NoiseAware)),
        }
    }
}

fn proposal_of(solution: PaperSolution, rate: f64) -> Proposal {
    Proposal {
        candidate: Candidate {
            source: Source::Paper(rate),
            k: Ok(solution.k),
        },
        run: solution.run,
        noise_aware: false,
    }
}

/// ρ(F) of a gain after its projection.
fn radius_of_f(synthesis: &Synthesis<'_>, k: &DMatrix<f64>) -> f64 {
    let [_, a12, _, a22] = synthesis.plant.blocks();
    spectral_radius(&(a22 + synthesis.decoupling.project(k) * a12)).unwrap_or(f64::INFINITY)
}
