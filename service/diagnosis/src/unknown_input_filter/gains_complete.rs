//! Whether gains have a parity test for every window that the options ask for (method sheet 3.4).
//!
//! A certificate that a design found and somebody removed leaves no trace in the others. So gains list the windows
//! without test as well, and every (mode, fault, L) must stand in one of the two lists.

use super::{
    gains::{UnknownInputFilterGains, Untested},
    gains_check::GainsError,
    modes::FaultMode,
    options::{Form, UnknownInputFilterOptions},
};

type Window = (FaultMode, usize, usize);

/// Checks that there is a certificate for every window that `parity.certificates` brings, or else a certificate or an
/// entry of the windows without test for every window of `parity.lengths`. Gains without either list come from a design
/// without a solver.
pub(super) fn check_tests(
    gains: &UnknownInputFilterGains,
    modes: &[FaultMode],
    options: &UnknownInputFilterOptions,
    actuators: usize,
) -> Result<(), GainsError> {
    let window = |untested: &Untested| (untested.mode, untested.fault, untested.length);
    let certified = |window: &Window| {
        let mut certificates = gains.certificates.iter();
        certificates.any(|it| (it.mode, it.fault, it.length) == *window)
    };
    let listed = |asked: &Window| gains.untested.iter().any(|it| window(it) == *asked);
    let designed = options.filter.form == Form::Coupled && options.parity.certificates.is_none();
    let asked: Vec<Window> = match &options.parity.certificates {
        _ if options.filter.form != Form::Coupled => Vec::new(),
        Some(given) => given.iter().map(|it| (it.mode, it.fault, it.length)).collect(),
        None if gains.certificates.is_empty() && gains.untested.is_empty() => Vec::new(),
        None => windows(modes, &options.parity.lengths, actuators),
    };
    for (index, untested) in gains.untested.iter().enumerate() {
        let (mode, fault, length) = window(untested);
        if !designed || !asked.contains(&(mode, fault, length)) || certified(&(mode, fault, length)) {
            return Err(GainsError::Tested {
                index,
                mode,
                fault,
                length,
            });
        }
    }
    match asked
        .into_iter()
        .find(|asked| !certified(asked) && !listed(asked))
    {
        None => Ok(()),
        Some((mode, fault, length)) => Err(GainsError::NoTest { mode, fault, length }),
    }
}

/// All windows of all modes against all other actuators.
fn windows(modes: &[FaultMode], lengths: &[usize], actuators: usize) -> Vec<Window> {
    let pairs = modes
        .iter()
        .flat_map(|&mode| mode.other_actuators(actuators).map(move |fault| (mode, fault)));
    pairs
        .flat_map(|(mode, fault)| lengths.iter().map(move |&length| (mode, fault, length)))
        .collect()
}
