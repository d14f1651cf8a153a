//! From the options to checked matrices and vectors.

use super::{
    checks::{check_plant, describe},
    error::HinfFilterError,
    faults::FaultSet,
    options::{DesignType, HinfFilterOptions, InitialType, PlantOptions, RealisationType, ThresholdType},
    plant::{Plant, SampledPlant},
    synthesis::pseudo_inverse,
};
use crate::{
    decomposition::{SingularDecomposition, eigenvalues},
    tables::{TableError, matrix, shaped_matrix, vector},
};
use nalgebra::{DMatrix, DVector};

/// Default noise weight relative to σ_max(Dd diag(w_d)).
const DEFAULT_NOISE: f64 = 0.07;
/// A window is a whole number of periods up to this part of it.
const WHOLE: f64 = 1e-9;
/// Largest number of samples in a window.
const LONGEST_WINDOW: f64 = 1e6;

/// What is known of the disturbance.
#[derive(Clone, Debug, PartialEq)]
pub struct DisturbanceBound {
    /// d̄, length m; `None` if only the energy is bounded.
    pub amplitude: Option<DVector<f64>>,
    /// ḋ̄, length m; zero for a disturbance that changes at sampling instants only.
    pub slew: DVector<f64>,
    /// M_w, units of d times √s.
    pub window_energy: Option<f64>,
}

/// What is known of the initial error.
#[derive(Clone, Debug, PartialEq)]
pub enum InitialError {
    /// |e₀| <= ē, component by component.
    Box(DVector<f64>),
    /// ‖e₀‖₂ <= ε.
    Ball(f64),
}

/// Where the filter begins.
#[derive(Clone, Debug, PartialEq)]
pub struct InitialRule {
    /// Whether from the first complete sample.
    pub first_output: bool,
    /// x̂₀, or the prior, length n.
    pub state: DVector<f64>,
    /// Around `state`.
    pub error: InitialError,
}

/// Everything that was configured, checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Problem {
    /// The plant.
    pub plant: Plant,
    /// The plant, sampled.
    pub sampled: SampledPlant,
    /// Listed models.
    pub listed: Vec<(Plant, SampledPlant)>,
    /// Bounds of d.
    pub disturbance: DisturbanceBound,
    /// Standard deviations of measurement noise, length q.
    pub noise: Option<DVector<f64>>,
    /// w_d, length m.
    pub disturbance_weight: DVector<f64>,
    /// w_n, length q.
    pub noise_weight: DVector<f64>,
    /// N; `None` for all samples from the start on.
    pub window: Option<usize>,
    /// Where the filter begins.
    pub initial: InitialRule,
    /// Names and bounds of the faults, blind sets.
    pub faults: FaultSet,
}

impl Problem {
    /// Checks everything that needs no design.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn new(options: &HinfFilterOptions, sample_time_s: f64) -> Result<Self, HinfFilterError> {
        if !(sample_time_s.is_finite() && sample_time_s > 0.0) {
            return Err(HinfFilterError::OutOfRange {
                key: "sample_time_s".to_owned(),
                value: sample_time_s,
                allowed: "it must be positive",
            });
        }
        let plant = read_plant(&options.model)?;
        let (n, _, q, m, _) = plant.dimensions();
        let sampled = plant.sample(sample_time_s);
        check_plant(&plant, &sampled, options.model.require_stable)?;
        let listed = read_listed(options, &plant, sample_time_s)?;
        let disturbance = read_disturbance(options, m)?;
        let noise = &options.disturbance.noise_std;
        let noise = match noise.is_empty() {
            true => None,
            false => Some(at_least(
                "disturbance.noise_std",
                noise,
                q,
                "outputs",
                Sign::Positive,
            )?),
        };
        let disturbance_weight = match (&options.synthesis.disturbance_weight, &disturbance.amplitude) {
            (Some(weight), _) => at_least(
                "synthesis.disturbance_weight",
                weight,
                m,
                "disturbances",
                Sign::Positive,
            )?,
            (None, Some(amplitude)) => amplitude.clone(),
            (None, None) => DVector::from_element(m, 1.0),
        };
        let noise_weight = match (&options.synthesis.noise_weight, &noise) {
            (Some(weight), _) => at_least("synthesis.noise_weight", weight, q, "outputs", Sign::NotNegative)?,
            (None, Some(noise)) => noise.clone(),
            (None, None) => {
                let weighted = &plant.dd * DMatrix::from_diagonal(&disturbance_weight);
                DVector::from_element(q, DEFAULT_NOISE * SingularDecomposition::new(&weighted).largest())
            }
        };
        let problem = Self {
            window: read_window(options.evaluation.window, sample_time_s)?,
            initial: read_initial(options, &plant, n)?,
            faults: FaultSet::new(options.isolation.as_ref(), plant.bf.ncols())?,
            plant,
            sampled,
            listed,
            disturbance,
            noise,
            disturbance_weight,
            noise_weight,
        };
        problem.check_combinations(options)?;
        Ok(problem)
    }

    /// ē when the filter begins with this disturbance and these direct terms: as configured, or for the first output
    /// |C⁺||Dd| d̄ + |I - C⁺C| ē_prior (+ 6 |C⁺| σ).
    pub(super) fn initial_error(&self, direct: &DMatrix<f64>, amplitude: &DVector<f64>) -> InitialError {
        if !self.initial.first_output {
            return self.initial.error.clone();
        }
        let (inverse, unseen) = self.first_output();
        let mut bound = inverse.abs() * (direct.abs() * amplitude);
        bound += match &self.initial.error {
            InitialError::Box(prior) => unseen.abs() * prior,
            InitialError::Ball(radius) => {
                DVector::from_fn(unseen.nrows(), |i, _| unseen.row(i).norm() * radius)
            }
        };
        if let Some(noise) = &self.noise {
            bound += inverse.abs() * noise * 6.0;
        }
        InitialError::Box(bound)
    }

    /// C⁺ and I - C⁺C; the latter is exactly zero where C shows every state.
    pub(super) fn first_output(&self) -> (DMatrix<f64>, DMatrix<f64>) {
        let c = &self.plant.c;
        let n = c.ncols();
        let inverse = pseudo_inverse(c);
        let unseen = if sees_every_state(c) {
            DMatrix::zeros(n, n)
        } else {
            DMatrix::identity(n, n) - &inverse * c
        };
        (inverse, unseen)
    }

    /// The largest |d| at one instant: d̄, or M_w/√Ts if only the energy is bounded.
    pub(super) fn amplitude(&self) -> DVector<f64> {
        let instant = self.disturbance.window_energy.unwrap_or(0.0) / self.sampled.sample_time_s.sqrt();
        match &self.disturbance.amplitude {
            Some(amplitude) => amplitude.clone(),
            None => DVector::from_element(self.plant.bd.ncols(), instant),
        }
    }

    fn check_combinations(&self, options: &HinfFilterOptions) -> Result<(), HinfFilterError> {
        let conflict = |key, reason| Err(HinfFilterError::Conflict { key, reason });
        let (evaluation, synthesis) = (&options.evaluation, &options.synthesis);
        let held = options.filter.realisation != RealisationType::DiscreteObserver;
        let constant = evaluation.threshold == ThresholdType::Constant;
        if constant {
            match evaluation.constant_threshold {
                Some(value) if value.is_finite() && value > 0.0 => {}
                Some(value) => {
                    return Err(HinfFilterError::OutOfRange {
                        key: "evaluation.constant_threshold".to_owned(),
                        value,
                        allowed: "it must be positive",
                    });
                }
                None => {
                    return Err(HinfFilterError::Missing {
                        key: "evaluation.constant_threshold",
                        reason: "give it, or use `evaluation.threshold` = \"guaranteed\"",
                    });
                }
            }
        } else if evaluation.constant_threshold.is_some() {
            let reason = "with `evaluation.threshold` = \"guaranteed\"; remove one of them";
            return conflict("evaluation.constant_threshold", reason);
        }
        if evaluation.peak_test == Some(true) && (constant || self.disturbance.amplitude.is_none()) {
            let reason = "without guaranteed thresholds from `disturbance.amplitude`; remove it";
            return conflict("evaluation.peak_test", reason);
        }
        if self.window.is_none() && self.noise.is_some() {
            let reason =
                "with `evaluation.window` = inf, whose noise energy has no bound; give a finite window";
            return conflict("disturbance.noise_std", reason);
        }
        if self.window.is_none()
            && self.disturbance.window_energy.is_some()
            && self.disturbance.slew.amax() > 0.0
        {
            let reason = "with a window energy and `evaluation.window` = inf; remove it";
            return conflict("disturbance.slew", reason);
        }
        if held && !self.listed.is_empty() {
            let reason = "with this `filter.realisation`; use \"discrete_observer\"";
            return conflict("model.listed_models", reason);
        }
        if options.isolation.is_some() {
            if held || constant {
                let reason = "without the discrete observer and guaranteed thresholds; remove the table";
                return conflict("isolation", reason);
            }
            if self.disturbance.amplitude.is_none() {
                let reason = "without `disturbance.amplitude`; give it instead of the window energy";
                return conflict("isolation", reason);
            }
        }
        if held && matches!(synthesis.design, DesignType::RiccatiDiscrete) {
            let reason = "with \"riccati_dt\", it needs a continuous gain; use \"riccati_ct\", \"matched\" or a given H";
            return conflict("filter.realisation", reason);
        }
        if held && synthesis.design == DesignType::Given && synthesis.h.is_none() {
            return Err(HinfFilterError::Missing {
                key: "synthesis.H",
                reason: "this `filter.realisation` needs a continuous gain; give it instead of L",
            });
        }
        let tolerance = options.filter.jitter_tolerance;
        if !(tolerance > 0.0 && tolerance < 1.0) {
            return Err(HinfFilterError::OutOfRange {
                key: "filter.jitter_tolerance".to_owned(),
                value: tolerance,
                allowed: "it is a part of the period, above 0 and below 1",
            });
        }
        check_gain_keys(options)
    }
}

/// Keys of a gain that do not belong to the type of the design.
fn check_gain_keys(options: &HinfFilterOptions) -> Result<(), HinfFilterError> {
    let synthesis = &options.synthesis;
    let given = synthesis.design == DesignType::Given;
    let reason = "with this `synthesis.type`; use \"given\"";
    for (key, present) in [
        ("synthesis.L", synthesis.l.is_some()),
        ("synthesis.H", synthesis.h.is_some()),
        ("synthesis.claimed_bound", synthesis.claimed_bound.is_some()),
        ("synthesis.pole_decay", synthesis.pole_decay.is_some()),
        ("synthesis.pole_radius", synthesis.pole_radius.is_some()),
        (
            "synthesis.V",
            synthesis.v.is_some() && synthesis.design != DesignType::Matched,
        ),
    ] {
        if present && !given {
            return Err(HinfFilterError::Conflict { key, reason });
        }
    }
    if given && synthesis.l.is_some() == synthesis.h.is_some() {
        return Err(match synthesis.l {
            None => HinfFilterError::Missing {
                key: "synthesis.L",
                reason: "give the discrete gain L or the continuous gain H",
            },
            Some(_) => HinfFilterError::Conflict {
                key: "synthesis.L",
                reason: "beside `synthesis.H`; give one of them",
            },
        });
    }
    for (key, value) in [
        ("synthesis.claimed_bound", synthesis.claimed_bound),
        ("synthesis.pole_decay", synthesis.pole_decay),
        ("synthesis.pole_radius", synthesis.pole_radius),
        ("synthesis.max_gain", Some(synthesis.max_gain)),
    ] {
        positive(key, value)?;
    }
    if synthesis.pole_radius.is_some() && synthesis.h.is_none() {
        let reason = "with a discrete gain; use `synthesis.pole_decay`";
        return Err(HinfFilterError::Conflict {
            key: "synthesis.pole_radius",
            reason,
        });
    }
    Ok(())
}

/// Whether C has full column rank, so that one output determines the state.
fn sees_every_state(c: &DMatrix<f64>) -> bool {
    let values = SingularDecomposition::new(c);
    values.smallest() > 1e-9 * values.largest()
}

/// Which numbers a list may hold.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Sign {
    Positive,
    NotNegative,
}

/// A list of bounds or weights.
pub(super) fn at_least(
    key: &str,
    entries: &[f64],
    length: usize,
    meaning: &'static str,
    sign: Sign,
) -> Result<DVector<f64>, HinfFilterError> {
    let found = vector(key, entries, length, meaning)?;
    let (limit, allowed) = match sign {
        Sign::Positive => (f64::MIN_POSITIVE, "it must be positive"),
        Sign::NotNegative => (0.0, "it must not be negative"),
    };
    match entries.iter().position(|value| *value < limit) {
        Some(index) => Err(HinfFilterError::OutOfRange {
            key: format!("{key}.{index}"),
            value: entries[index],
            allowed,
        }),
        None => Ok(found),
    }
}

pub(super) fn positive(key: &str, value: Option<f64>) -> Result<(), HinfFilterError> {
    match value {
        Some(value) if !(value.is_finite() && value > 0.0) => Err(HinfFilterError::OutOfRange {
            key: key.to_owned(),
            value,
            allowed: "it must be positive",
        }),
        _ => Ok(()),
    }
}

fn read_plant(model: &PlantOptions) -> Result<Plant, HinfFilterError> {
    let a = matrix("model.A", &model.a)?;
    let c = matrix("model.C", &model.c)?;
    let (n, q) = (a.nrows(), c.nrows());
    let columns = |rows: &[Vec<f64>]| rows.first().map_or(0, Vec::len);
    let p = columns(&model.b);
    let shaped = |key, rows: &[Vec<f64>], shape, meaning| shaped_matrix(key, rows, shape, meaning);
    let plant = Plant {
        b: shaped("model.B", &model.b, (n, p), "states x commands")?,
        d: match model.d.is_empty() {
            true => DMatrix::zeros(q, p),
            false => shaped("model.D", &model.d, (q, p), "outputs x commands")?,
        },
        bd: shaped(
            "model.Bd",
            &model.bd,
            (n, columns(&model.bd)),
            "states x disturbances",
        )?,
        dd: shaped(
            "model.Dd",
            &model.dd,
            (q, columns(&model.bd)),
            "outputs x disturbances",
        )?,
        bf: shaped("model.Bf", &model.bf, (n, columns(&model.bf)), "states x faults")?,
        df: shaped("model.Df", &model.df, (q, columns(&model.bf)), "outputs x faults")?,
        a: shaped("model.A", &model.a, (n, n), "states x states")?,
        c: shaped("model.C", &model.c, (q, n), "outputs x states")?,
    };
    for (key, count, what) in [
        ("model.A", n, "state"),
        ("model.C", q, "output"),
        ("model.Bd", plant.bd.ncols(), "disturbance"),
        ("model.Bf", plant.bf.ncols(), "fault"),
    ] {
        if count == 0 {
            return Err(HinfFilterError::Empty { key, what });
        }
    }
    if let Some(units) = model.output_units.as_ref().filter(|units| units.len() != q) {
        return Err(HinfFilterError::Table(TableError::Shape {
            key: "model.output_units".to_owned(),
            actual: format!("a list of length {}", units.len()),
            expected: format!("a list of length {q}"),
            meaning: "outputs",
        }));
    }
    Ok(plant)
}

fn read_listed(
    options: &HinfFilterOptions,
    plant: &Plant,
    sample_time_s: f64,
) -> Result<Vec<(Plant, SampledPlant)>, HinfFilterError> {
    let (n, p, _, m, _) = plant.dimensions();
    let mut found = Vec::new();
    for (index, listed) in options.model.listed_models.iter().enumerate() {
        let read = |name, rows: &Option<Vec<Vec<f64>>>, like: &DMatrix<f64>, columns, meaning| match rows {
            Some(rows) => shaped_matrix(
                &format!("model.listed_models.{index}.{name}"),
                rows,
                (n, columns),
                meaning,
            ),
            None => Ok::<_, TableError>(like.clone()),
        };
        let other = Plant {
            a: shaped_matrix(
                &format!("model.listed_models.{index}.A"),
                &listed.a,
                (n, n),
                "states x states",
            )?,
            b: read("B", &listed.b, &plant.b, p, "states x commands")?,
            bd: read("Bd", &listed.bd, &plant.bd, m, "states x disturbances")?,
            ..plant.clone()
        };
        let sampled = other.sample(sample_time_s);
        let poles = eigenvalues(&sampled.ad).ok_or(HinfFilterError::Eigenvalues {
            matrix: "a listed model",
        })?;
        if poles.iter().any(|pole| pole.norm() >= 1.0 - 1e-9) {
            let worst = eigenvalues(&other.a)
                .unwrap_or_default()
                .into_iter()
                .max_by(|left, right| left.re.total_cmp(&right.re));
            return Err(HinfFilterError::ListedModelNotStable {
                index,
                eigenvalue: worst.map_or_else(String::new, describe),
            });
        }
        found.push((other, sampled));
    }
    Ok(found)
}

fn read_disturbance(options: &HinfFilterOptions, m: usize) -> Result<DisturbanceBound, HinfFilterError> {
    let disturbance = &options.disturbance;
    positive("disturbance.window_energy", disturbance.window_energy)?;
    let amplitude = match (&disturbance.amplitude, disturbance.window_energy) {
        (Some(_), Some(_)) => {
            return Err(HinfFilterError::Conflict {
                key: "disturbance.window_energy",
                reason: "beside `disturbance.amplitude`; give one of them",
            });
        }
        (None, None) if options.evaluation.threshold == ThresholdType::Guaranteed => {
            return Err(HinfFilterError::Missing {
                key: "disturbance.amplitude",
                reason: "a guaranteed threshold needs the amplitudes or the window energy of d",
            });
        }
        (Some(amplitude), _) => Some(at_least(
            "disturbance.amplitude",
            amplitude,
            m,
            "disturbances",
            Sign::Positive,
        )?),
        (None, _) => None,
    };
    let slew = match &disturbance.slew {
        Some(slew) => at_least("disturbance.slew", slew, m, "disturbances", Sign::NotNegative)?,
        None => DVector::zeros(m),
    };
    Ok(DisturbanceBound {
        amplitude,
        slew,
        window_energy: disturbance.window_energy,
    })
}

fn read_window(window: f64, sample_time_s: f64) -> Result<Option<usize>, HinfFilterError> {
    if window == f64::INFINITY {
        return Ok(None);
    }
    let samples = window / sample_time_s;
    let whole = samples.round();
    if !((samples - whole).abs() <= WHOLE * samples && (1.0..=LONGEST_WINDOW).contains(&whole)) {
        return Err(HinfFilterError::Window { window, samples });
    }
    Ok(Some(whole as usize))
}

fn read_initial(
    options: &HinfFilterOptions,
    plant: &Plant,
    n: usize,
) -> Result<InitialRule, HinfFilterError> {
    let filter = &options.filter;
    let first_output = filter.initial == InitialType::FirstOutput;
    let state = match &filter.initial_state {
        Some(state) => vector("filter.initial_state", state, n, "states")?,
        None => DVector::zeros(n),
    };
    let needed = options.evaluation.threshold == ThresholdType::Guaranteed
        && !(first_output && sees_every_state(&plant.c));
    let error = match (&filter.initial_error_bound, filter.initial_error_norm) {
        (Some(_), Some(_)) => {
            return Err(HinfFilterError::Conflict {
                key: "filter.initial_error_norm",
                reason: "beside `filter.initial_error_bound`; give one of them",
            });
        }
        (Some(bound), None) => InitialError::Box(at_least(
            "filter.initial_error_bound",
            bound,
            n,
            "states",
            Sign::NotNegative,
        )?),
        (None, Some(radius)) => {
            positive("filter.initial_error_norm", Some(radius))?;
            InitialError::Ball(radius)
        }
        (None, None) if needed => {
            return Err(HinfFilterError::Missing {
                key: "filter.initial_error_bound",
                reason: "the outputs do not tell the state at the start; give its bound around \
                         `filter.initial_state`, zeros if it is known",
            });
        }
        (None, None) => InitialError::Box(DVector::zeros(n)),
    };
    Ok(InitialRule {
        first_output,
        state,
        error,
    })
}
