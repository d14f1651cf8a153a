//! What every diagnoser promises, whatever its method: written once, run for every method and mode.
//!
//! | module | what |
//! |---|---|
//! | `case` | what a method contributes: its tables, a plant that keeps its assumptions, its promise on false alarms |
//! | `plant` | simulated plants and the packets they send |
//! | `properties` | the properties, each over any case |
//! | `false_alarms` | guarantee or configured probability, in fault-free operation |
//! | the others | the cases of one method each |
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, unsafe_code)]

mod allocation;
mod async_imm;
mod case;
mod chi_square;
mod false_alarms;
mod hinf_filter;
mod plant;
mod properties;
mod reduced_order_observer;
mod unknown_input_filter;

/// One test per property for a case, in a module of the case's name.
macro_rules! conforms {
    ($($name:ident => $case:expr;)*) => { $(mod $name {
        #[allow(unused_imports)]
        use super::*;
        use crate::{case::Case, false_alarms, properties};
        use std::sync::LazyLock;

        static CASE: LazyLock<Case> = LazyLock::new(|| $case);

        #[test]
        fn names_and_counts_are_sound_and_constant() { properties::description_is_sound(&CASE); }
        #[test]
        fn repetition_gives_equal_bits() { properties::repetition_gives_equal_bits(&CASE); }
        #[test]
        fn a_saved_state_goes_on_to_the_last_bit() { properties::saved_state_goes_on(&CASE); }
        #[test]
        fn a_state_of_another_kind_is_refused() { properties::foreign_state_is_refused(&CASE); }
        #[test]
        fn a_forged_state_is_refused_or_survived() { properties::forged_state_is_refused_or_survived(&CASE); }
        #[test]
        fn a_reset_returns_to_the_start() { properties::reset_returns_to_the_start(&CASE); }
        #[test]
        fn no_step_allocates() { properties::no_step_allocates(&CASE); }
        #[test]
        fn hostile_input_is_survived_and_never_called_nominal() { properties::hostile_input_is_survived(&CASE); }
        #[test]
        fn a_ratio_above_one_is_a_residual_out_of_its_bounds() { properties::ratio_agrees_with_bounds(&CASE); }
        #[test]
        fn faults_are_reported_with_their_place() { properties::faults_are_reported(&CASE); }
        #[test]
        fn false_alarms_are_as_promised() { false_alarms::are_as_promised(&CASE); }
    })* };
}
pub(crate) use conforms;
