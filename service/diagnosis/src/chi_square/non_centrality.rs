//! Non-centralities: how strongly a fault shows in each statistic (method sheet 3).

use super::{
    construction::engine_design,
    engine::{Detectors, Engine, Outcome},
    error::ChiSquareError,
    filter::Filter,
    model_options::Schedule,
    options::ChiSquareOptions,
    plant::Plant,
};

/// Runs the statistics from x̂(0) = 0 on the fault alone: u = 0, z(k) = `fault`\[k - 1\] (m each), and hands each
/// instant's outcome to `take`. Each chi-square statistic then equals its non-centrality.
///
/// # Errors
/// [`ChiSquareError`]: the model, or a schedule other than `"constant"`.
pub fn non_centrality(
    options: &ChiSquareOptions,
    fault: &[Vec<f64>],
    mut take: impl FnMut(&Outcome),
) -> Result<(), ChiSquareError> {
    let plant = Plant::new(options)?;
    let design = engine_design(options, &plant)?;
    if plant.schedule != Schedule::Constant {
        return Err(ChiSquareError::setting(
            "model.schedule",
            "not \"constant\"",
            "a non-centrality is defined for one model; use \"constant\"",
        ));
    }
    let mut filter = Filter::new(&vec![0.0; design.states], &plant.initial_factor);
    let mut detectors = Detectors::new(&design);
    let input = vec![0.0; plant.counts()[1]];
    let measurements = design.measurements;
    let mut engine = Engine::new(design);
    for fault in fault.iter().filter(|fault| fault.len() == measurements) {
        engine.step(
            &mut filter,
            &mut detectors,
            &plant.models[0],
            &input,
            &input,
            fault,
        );
        take(&engine.outcome);
    }
    Ok(())
}
