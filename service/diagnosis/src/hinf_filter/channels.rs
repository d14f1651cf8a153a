//! The channels of a record (method sheet 4.2).

use super::{
    construction::METHOD, faults::FaultSet, filter::ResidualFilter, main_filter::MainFilter,
    options::HinfFilterOptions, problem::Problem,
};
use crate::diagnoser::{ChannelDescription, Description};
use nalgebra::DMatrix;

/// Channels: energy and residuals of the main filter, of each blind filter, and the fault estimates.
pub(super) fn describe(
    problem: &Problem,
    options: &HinfFilterOptions,
    main: &MainFilter,
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
        let prefix = prefix(&problem.faults, i);
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

/// How the channels of a filter begin: nothing for the detecting one, which is number 0.
pub(super) fn prefix(faults: &FaultSet, filter: usize) -> String {
    let blind = filter.checked_sub(1).and_then(|i| faults.blind.get(i));
    blind.map_or_else(String::new, |set| {
        let names: Vec<_> = set.iter().map(|j| faults.names[*j].as_str()).collect();
        format!("blind_to_{}_", names.join("_"))
    })
}
