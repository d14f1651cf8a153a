//! Lists of the options as matrices and bounds.

use super::{
    checks::describe,
    error::HinfFilterError,
    options::{HinfFilterOptions, InitialType, PlantOptions, ThresholdType},
    plant::{Plant, SampledPlant},
    problem::{DisturbanceBound, InitialError, InitialRule},
};
use crate::{
    decomposition::{SingularDecomposition, eigenvalues},
    tables::{TableError, matrix, shaped_matrix, vector},
};
use nalgebra::{DMatrix, DVector};

/// A window is a whole number of periods up to this part of it.
const WHOLE: f64 = 1e-9;
/// Largest number of samples in a window.
const LONGEST_WINDOW: f64 = 1e6;

/// Whether C has full column rank, so that one output determines the state.
pub(super) fn sees_every_state(c: &DMatrix<f64>) -> bool {
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

/// A number that must be positive, if it is there.
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

pub(super) fn read_plant(model: &PlantOptions) -> Result<Plant, HinfFilterError> {
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
            return Err(HinfFilterError::Empty {
                key: key.to_owned(),
                what,
            });
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

pub(super) fn read_listed(
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

pub(super) fn read_disturbance(
    options: &HinfFilterOptions,
    m: usize,
) -> Result<DisturbanceBound, HinfFilterError> {
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

pub(super) fn read_window(window: f64, sample_time_s: f64) -> Result<Option<usize>, HinfFilterError> {
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

pub(super) fn read_initial(
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
