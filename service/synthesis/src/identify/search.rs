//! Which noise scales are tried, and which are the best.

use super::evaluate::Evaluator;
use super::report::{LadderStep, StepBounds, StepOutcome};
use super::{IdentifyError, IdentifyOptions, Progress};

/// Steps tried so far; a step is named by its levels: for each output the position in the ladder.
pub(super) struct Search<'a> {
    evaluator: Evaluator<'a>,
    ladder: &'a [f64],
    tolerated: usize,
    levels: Vec<Vec<usize>>,
    steps: Vec<LadderStep>,
    progress: &'a mut dyn FnMut(Progress),
}

impl<'a> Search<'a> {
    pub(super) fn new(
        evaluator: Evaluator<'a>,
        options: &'a IdentifyOptions,
        progress: &'a mut dyn FnMut(Progress),
    ) -> Self {
        Self {
            evaluator,
            ladder: &options.noise_scales,
            tolerated: options.tolerated_left_out_failures,
            levels: Vec::new(),
            steps: Vec::new(),
            progress,
        }
    }

    /// Tries one step.
    pub(super) fn evaluate(&mut self, levels: Vec<usize>) -> Result<(), IdentifyError> {
        let noise_scales: Vec<f64> = levels.iter().map(|&level| self.ladder[level]).collect();
        let runs = self.evaluator.run_count();
        let finished_steps = self.steps.len();
        let mut report = |runs_done| {
            let noise_scales = noise_scales.clone();
            (self.progress)(Progress {
                finished_steps,
                noise_scales,
                runs_done,
                runs,
            });
        };
        let outcome = self.evaluator.evaluate(&noise_scales, &mut report)?;
        self.steps.push(LadderStep {
            noise_scales,
            outcome,
        });
        self.levels.push(levels);
        Ok(())
    }

    /// The step with the fewest left-out failures and, among these, the smallest mean floor.
    pub(super) fn best(&self) -> Option<(usize, &StepBounds)> {
        let feasible = self
            .steps
            .iter()
            .enumerate()
            .filter_map(|(index, step)| match &step.outcome {
                StepOutcome::Bounds(found) => Some((index, found)),
                StepOutcome::Infeasible { .. } => None,
            });
        let failures = |step: &StepBounds| step.left_out_failures.unwrap_or(0).max(self.tolerated);
        feasible.min_by(|(_, a), (_, b)| {
            failures(a)
                .cmp(&failures(b))
                .then(a.mean_floor.total_cmp(&b.mean_floor))
        })
    }

    /// A step that differs from the best one in the scale of one output and has not been tried.
    pub(super) fn untried_neighbour(&self) -> Option<Vec<usize>> {
        let best = &self.levels[self.best()?.0];
        (0..best.len())
            .flat_map(|output| {
                (0..self.ladder.len()).map(move |level| {
                    let mut levels = best.clone();
                    levels[output] = level;
                    levels
                })
            })
            .find(|levels| !self.levels.contains(levels))
    }

    /// The error when no step explains the training runs: that of the step that came closest.
    pub(super) fn infeasible(&self) -> IdentifyError {
        let failures = self.steps.iter().filter_map(|step| match &step.outcome {
            StepOutcome::Infeasible { run, factor } => Some((step, run, *factor)),
            StepOutcome::Bounds(_) => None,
        });
        match failures.min_by(|a, b| a.2.total_cmp(&b.2)) {
            Some((step, run, factor)) => IdentifyError::Infeasible {
                run: run.clone(),
                tried: step.noise_scales.clone(),
                factor,
            },
            None => IdentifyError::NoTrainingRuns,
        }
    }

    pub(super) fn into_steps(self) -> Vec<LadderStep> {
        self.steps
    }
}
