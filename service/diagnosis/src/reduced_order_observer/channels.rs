//! Names and units of the channels of a record (method sheet 4).
//!
//! `output_i`, `direction_l` (the other rows of W), `output_excess` (r of the paper's equation (18): above 0 when an
//! output leaves its bounds), `member_i_l` (row l of the member of actuator i), `estimator_i` (the row whose residual
//! is the fault of actuator i, against its interval without a fault), `fault_estimate_i` (that fault, one sample ago,
//! with its interval; for information). Everything counts from 0.

use residual_shared::record::MAX_CHANNELS;

use super::{
    design::Design, error::ConstructionError, observer_design::ObserverDesign, options::ModelOptions,
    test_row::TestRow,
};
use crate::diagnoser::{Channel, ChannelDescription};

/// A channel with a test.
pub(super) struct TestChannel<'a> {
    /// Its name.
    pub name: String,
    unit: &'a str,
    /// The observer that it belongs to.
    pub design: &'a ObserverDesign,
    /// Which of the observer's rows it is.
    pub row: usize,
}

/// The channels with a test, in the order of a record.
pub(super) fn test_channels(design: &Design) -> Vec<TestChannel<'_>> {
    let model = &design.options.model;
    let (p, common) = (design.plant.outputs(), common_unit(model));
    let rows = |design: &'_ ObserverDesign| 0..design.tests.nrows();
    let main = rows(&design.main).map(|row| TestChannel {
        name: match row.checked_sub(p) {
            None => format!("output_{row}"),
            Some(l) => format!("direction_{l}"),
        },
        unit: if row < p {
            entry(&model.output_units, row)
        } else {
            common
        },
        design: &design.main,
        row,
    });
    let members = with_actuator(&design.isolation.members).flat_map(|(actuator, design)| {
        rows(design).map(move |row| TestChannel {
            name: format!("member_{actuator}_{row}"),
            unit: common,
            design,
            row,
        })
    });
    let estimators = with_actuator(&design.isolation.estimators).map(|(actuator, design)| TestChannel {
        name: format!("estimator_{actuator}"),
        unit: entry(&model.actuator_units, actuator),
        design,
        row: 0,
    });
    main.chain(members).chain(estimators).collect()
}

/// The channels of a design in the order of a record.
///
/// # Errors
/// [`ConstructionError::TooManyChannels`].
pub(super) fn describe(design: &Design) -> Result<Vec<ChannelDescription>, ConstructionError> {
    let model = &design.options.model;
    let channel = |name: String, unit: &str| ChannelDescription {
        name,
        unit: unit.to_owned(),
    };
    let tests = test_channels(design).into_iter();
    let mut channels: Vec<ChannelDescription> = tests.map(|test| channel(test.name, test.unit)).collect();
    channels.insert(
        design.main.tests.nrows(),
        channel("output_excess".to_owned(), common_unit(model)),
    );
    channels.extend(with_actuator(&design.isolation.estimators).map(|(actuator, _)| {
        channel(
            format!("fault_estimate_{actuator}"),
            entry(&model.actuator_units, actuator),
        )
    }));
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

fn with_actuator(designs: &[ObserverDesign]) -> impl Iterator<Item = (usize, &ObserverDesign)> {
    designs
        .iter()
        .filter_map(|design| Some((design.actuator?, design)))
}

/// An entry of a list of names or units; empty where there is none.
pub(super) fn entry(list: &Option<Vec<String>>, index: usize) -> &str {
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
