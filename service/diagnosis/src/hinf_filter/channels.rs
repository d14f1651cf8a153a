//! The channels of a record (method sheet 4.2).

use super::{
    construction::METHOD, filter::ResidualFilter, gain::MainDesign, options::HinfFilterOptions,
    problem::Problem,
};
use crate::diagnoser::{ChannelDescription, Description};
use nalgebra::DMatrix;

/// Channels: energy and residuals of the main filter, of each blind filter, and the fault estimates.
pub(super) fn describe(
    problem: &Problem,
    options: &HinfFilterOptions,
    main: &MainDesign,
    filters: &[ResidualFilter],
    bank: usize,
    estimates: bool,
) -> Description {
    let (_, p, q, _, _) = problem.plant.dimensions();
    let plain = main.v == DMatrix::identity(q, q);
    let names = &problem.faults.names;
    let mut channels = Vec::new();
    let mut add = |name: String, unit: &str| {
        channels.push(ChannelDescription {
            name,
            unit: unit.to_owned(),
        })
    };
    for (i, filter) in filters.iter().take(1 + bank).enumerate() {
        let prefix = match i.checked_sub(1) {
            None => String::new(),
            Some(i) => {
                let blind: Vec<_> = problem.faults.blind[i]
                    .iter()
                    .map(|j| names[*j].as_str())
                    .collect();
                format!("blind_to_{}_", blind.join("_"))
            }
        };
        add(format!("{prefix}energy"), "");
        for row in 0..filter.tested {
            let units = options.model.output_units.as_ref().filter(|_| plain && i == 0);
            let unit = units.and_then(|units| units.get(row));
            add(format!("{prefix}r{}", row + 1), unit.map_or("", String::as_str));
        }
    }
    if estimates {
        names
            .iter()
            .for_each(|name| add(format!("fault_estimate_{name}"), ""));
    }
    Description {
        method: METHOD,
        channels,
        faults: names.clone(),
        measurement_count: q,
        command_count: p,
        packets: None,
    }
}
