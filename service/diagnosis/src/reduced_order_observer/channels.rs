//! Names and units of the channels of a record (method sheet 4).
//!
//! `output_i`, `direction_l` (the other rows of W), `output_excess` (r of the paper's equation (18): above 0 when an
//! output leaves its bounds), `member_i_l` (row l of the member of actuator i), `estimator_i` (the row whose residual
//! is the fault of actuator i, against its interval without a fault), `fault_estimate_i` (that fault, one sample ago,
//! with its interval; for information). Everything counts from 0.

use residual_shared::record::MAX_CHANNELS;

use super::{design::Design, error::ConstructionError, options::ModelOptions, test_row::TestRow};
use crate::diagnoser::{Channel, ChannelDescription};

/// The channels of a design in the order of a record.
///
/// # Errors
/// [`ConstructionError::TooManyChannels`].
pub(super) fn describe(design: &Design) -> Result<Vec<ChannelDescription>, ConstructionError> {
    let model = &design.options.model;
    let (p, rows) = (design.plant.outputs(), design.main.tests.nrows());
    let common = common_unit(model);
    let mut channels = Vec::new();
    let mut add = |name: String, unit: &str| {
        channels.push(ChannelDescription {
            name,
            unit: unit.to_owned(),
        });
    };
    for i in 0..p {
        add(format!("output_{i}"), entry(&model.output_units, i));
    }
    for l in 0..rows - p {
        add(format!("direction_{l}"), common);
    }
    add("output_excess".to_owned(), common);
    for (actuator, member) in with_actuator(&design.isolation.members) {
        for l in 0..member.tests.nrows() {
            add(format!("member_{actuator}_{l}"), common);
        }
    }
    for (actuator, _) in with_actuator(&design.isolation.estimators) {
        add(
            format!("estimator_{actuator}"),
            entry(&model.actuator_units, actuator),
        );
    }
    for (actuator, _) in with_actuator(&design.isolation.estimators) {
        add(
            format!("fault_estimate_{actuator}"),
            entry(&model.actuator_units, actuator),
        );
    }
    match channels.len() {
        count if count > MAX_CHANNELS => Err(ConstructionError::TooManyChannels {
            count,
            limit: MAX_CHANNELS,
        }),
        _ => Ok(channels),
    }
}

/// Names of the actuators.
pub(super) fn fault_names(model: &ModelOptions, actuators: usize) -> Vec<String> {
    let name = |j| match entry(&model.actuator_names, j) {
        "" => format!("actuator_{j}"),
        name => name.to_owned(),
    };
    (0..actuators).map(name).collect()
}

/// r of the paper's equation (18) over the hull rows, with the largest of their ratios.
pub(super) fn output_excess(hull: impl Iterator<Item = TestRow>) -> Channel {
    let evaluated = hull.filter(|row| row.evaluated);
    evaluated.fold(Channel::NOT_EVALUATED, |worst, row| {
        let first = !worst.is_evaluated();
        Channel {
            lower: if first {
                -row.half_width
            } else {
                worst.lower.max(-row.half_width)
            },
            residual: if first {
                row.excess()
            } else {
                worst.residual.max(row.excess())
            },
            upper: 0.0,
            ratio: if first {
                row.ratio()
            } else {
                worst.ratio.max(row.ratio())
            },
        }
    })
}

fn with_actuator(
    designs: &[super::observer_design::ObserverDesign],
) -> impl Iterator<Item = (usize, &super::observer_design::ObserverDesign)> {
    designs
        .iter()
        .filter_map(|design| Some((design.actuator?, design)))
}

fn entry(list: &Option<Vec<String>>, index: usize) -> &str {
    list.as_ref()
        .and_then(|list| list.get(index))
        .map_or("", String::as_str)
}

/// The unit of all outputs, if they have one in common.
fn common_unit(model: &ModelOptions) -> &str {
    let units = model.output_units.as_deref().unwrap_or_default();
    match units {
        [first, rest @ ..] if rest.iter().all(|unit| unit == first) => first,
        _ => "",
    }
}
