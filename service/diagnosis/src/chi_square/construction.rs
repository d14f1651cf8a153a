//! From options to a diagnoser: checks in the order of method sheet 3, off-line design, room.

use super::{
    admissibility::{check_modes, exclusions},
    alarm::AlarmRules,
    calibration::calibrate,
    channels::{ChannelLayout, component_names, describe_mode},
    design::{Design, DesignReport, insensitive_windows, separability},
    engine::EngineDesign,
    error::ChiSquareError,
    glr::GlrDesign,
    glr_modes::{FaultProfile, modes},
    model_options::Schedule,
    options::{ChiSquareOptions, Signature, StatisticKind},
    plant::Plant,
    steady::steady_state,
    thresholds::Thresholds,
    validate::{check_names, check_settings, check_units},
};
use crate::{matrix::Matrix, tables};
use nalgebra::DMatrix;
use residual_shared::record::MAX_FAULTS;

/// Options that were checked, and what the checks found.
pub(super) struct Checked {
    pub plant: Plant,
    pub engine: EngineDesign,
    pub layout: ChannelLayout,
    pub rules: AlarmRules,
    pub components: Vec<String>,
    /// Whether the sensors left by each set of excluded ones (as bits) see every mode that does not decay; empty:
    /// nothing is ever excluded.
    pub admissible: Vec<bool>,
    pub report: DesignReport,
}

/// Makes every check that needs no design.
pub(super) fn check(options: &ChiSquareOptions) -> Result<Checked, ChiSquareError> {
    let plant = Plant::new(options)?;
    let [n, _, m, _] = plant.counts();
    let model = &options.model;
    check_names("model.state_names", model.state_names.as_ref(), n)?;
    check_units("model.state_units", model.state_units.as_ref(), n)?;
    check_names("model.measurement_names", model.measurement_names.as_ref(), m)?;
    check_units("model.measurement_units", model.measurement_units.as_ref(), m)?;
    check_settings(options)?;
    let engine = engine_design(options, &plant)?;
    let faults = engine.glr.as_ref().map_or(0, |glr| glr.entry.columns());
    check_names(
        "glr.process_fault_names",
        options.glr.process_fault_names.as_ref(),
        faults,
    )?;
    if m + faults > MAX_FAULTS {
        return Err(ChiSquareError::TooManyFaults {
            count: m + faults,
            limit: MAX_FAULTS,
        });
    }
    let components = component_names(options, &engine);
    let mut report = DesignReport::default();
    check_modes(options, &plant, &mut report)?;
    let admissible = exclusions(options, &plant, &components, &mut report)?;
    let glr = &options.glr;
    Ok(Checked {
        layout: ChannelLayout::new(options, &engine)?,
        rules: AlarmRules {
            confirm_steps: options.alarm.confirm_steps,
            clear_steps: options.alarm.clear_steps,
            warmup_steps: options.alarm.warmup_steps,
            isolation_margin: glr.isolation_margin,
            window_edge: (glr.window_steps - glr.onset_stride_steps) as u64,
        },
        plant,
        engine,
        components,
        admissible,
        report,
    })
}

/// Which statistics run, and how.
pub(super) fn engine_design(
    options: &ChiSquareOptions,
    plant: &Plant,
) -> Result<EngineDesign, ChiSquareError> {
    let statistics = &options.statistics;
    let enabled = |kind| statistics.enabled.contains(&kind);
    let [states, _, measurements, noises] = plant.counts();
    let mut window_steps = statistics.window_steps.clone();
    window_steps.sort_unstable();
    if !enabled(StatisticKind::StateWindow) {
        window_steps.clear();
    }
    let pair =
        enabled(StatisticKind::StateTwoPropagator).then_some(statistics.two_propagator_reset_steps as u64);
    Ok(EngineDesign {
        states,
        measurements,
        noises,
        plain: enabled(StatisticKind::StatePlain),
        pair_reset_steps: pair,
        window_steps,
        cusum_reference: enabled(StatisticKind::Cusum).then_some(options.cusum.reference),
        glr: if enabled(StatisticKind::Glr) {
            Some(glr_design(options, plant)?)
        } else {
            None
        },
        rank_tolerance: options.numerics.rank_tolerance,
    })
}

fn glr_design(options: &ChiSquareOptions, plant: &Plant) -> Result<GlrDesign, ChiSquareError> {
    let glr = &options.glr;
    let [states, _, measurements, _] = plant.counts();
    let faults = glr.process_fault_input.first().map_or(0, Vec::len);
    let entry = tables::shaped_matrix(
        "glr.process_fault_input",
        &glr.process_fault_input,
        (if faults == 0 { 0 } else { states }, faults),
        "states x process faults",
    )?;
    let feedthrough = if glr.process_fault_feedthrough.is_empty() {
        DMatrix::zeros(measurements, faults)
    } else {
        tables::shaped_matrix(
            "glr.process_fault_feedthrough",
            &glr.process_fault_feedthrough,
            (measurements, faults),
            "measurements x process faults",
        )?
    };
    let profiles = |step, ramp| {
        let pairs = [(step, FaultProfile::Step), (ramp, FaultProfile::Ramp)];
        let wanted = pairs
            .into_iter()
            .filter(|(signature, _)| glr.signatures.contains(signature));
        wanted.map(|(_, profile)| profile).collect::<Vec<_>>()
    };
    Ok(GlrDesign {
        modes: modes(
            &profiles(Signature::SensorStep, Signature::SensorRamp),
            measurements,
            &profiles(Signature::ProcessStep, Signature::ProcessRamp),
            faults,
        ),
        measurements,
        entry: Matrix::from(&entry),
        feedthrough: Matrix::from(&feedthrough),
        window_steps: glr.window_steps as u64,
        stride: glr.onset_stride_steps as u64,
    })
}

/// The off-line design of checked options.
pub(super) fn design(options: &ChiSquareOptions, checked: &Checked) -> Result<Design, ChiSquareError> {
    let (plant, engine) = (&checked.plant, &checked.engine);
    let (calibrated, calibration) = calibrate(plant, engine, options)?;
    let degrees = engine.states.max(engine.measurements);
    let mut report = checked.report.clone();
    if plant.schedule == Schedule::Constant {
        match steady_state(plant, options.numerics.steady_state_tolerance) {
            Some(steady) => {
                report.insensitive_windows = insensitive_windows(plant, engine, &steady);
                let (alike, fading) = separability(plant, engine, &steady, options.glr.isolation_margin);
                (report.inseparable_modes, report.fading_modes) = (alike, fading);
                report.steady_state = Some(steady);
            }
            None => report.warnings.push(
                "the filter does not become steady within 20000 steps, so that blind windows and inseparable modes \
                 were not looked for"
                    .to_owned(),
            ),
        }
    }
    describe_findings(&mut report, checked);
    Ok(Design {
        thresholds: Thresholds::new(options, degrees, &calibrated),
        calibration,
        report,
    })
}

fn describe_findings(report: &mut DesignReport, checked: &Checked) {
    let names = &checked.components;
    for window in &report.insensitive_windows {
        let sensor = names.get(window.sensor).map_or("", String::as_str);
        report.warnings.push(format!(
            "window {} sees a constant fault of {sensor} with {:.2} of the strength of the residual test, four windows \
             after its onset; other windows or `glr` have to see it",
            window.window_steps, window.ratio,
        ));
    }
    let Some(glr) = &checked.engine.glr else { return };
    let describe = |mode: usize| {
        glr.modes
            .get(mode)
            .map_or(String::new(), |mode| describe_mode(mode, names))
    };
    for pair in &report.inseparable_modes {
        report.warnings.push(format!(
            "a {} looks nearly like a {}: it is told apart only from a size of {:.3} on",
            describe(pair.mode),
            describe(pair.other),
            pair.smallest_isolable_size,
        ));
    }
    for mode in &report.fading_modes {
        report.warnings.push(format!(
            "a {} leaves a trace at its onset only: what is missed then stays hidden",
            describe_mode(mode, names),
        ));
    }
}
