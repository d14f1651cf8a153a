//! The examples that the demonstration knows, and what each of them must show.

use clap::Args;

use super::composition::Example;
use super::example;
use super::plants::aircraft::{self, Disturbance};
use super::plants::two_state::{self, Fault};
use super::plants::{Source, scalar, servo, target};

/// What a viewer may vary.
#[derive(Clone, Debug, Args)]
pub struct Variation {
    /// Seed of the measurement noise and of random disturbances (the example of `hinf_filter` has none).
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Disturbance on the aircraft (`unknown_input_filter` only).
    #[arg(long, value_enum, default_value = "sine")]
    pub disturbance: Disturbance,
}

/// A plant (or several), the diagnosers that watch it, and the fault that they must find.
pub struct Scenario {
    /// Its name on the command line.
    pub name: &'static str,
    /// The method that it shows.
    pub method: &'static str,
    /// What happens, for people.
    pub title: &'static str,
    /// Configuration and gains: the same files that users start from.
    pub example: Example,
    /// Speed of the daemon's time: seconds of it per second of the clock.
    pub speed: f64,
    /// How long it lasts, seconds of the daemon's time.
    pub duration_s: f64,
    /// The plants at their start.
    pub plants: fn(&Variation) -> Vec<Box<dyn Source>>,
    /// What each diagnoser must say.
    pub expectations: &'static [Expectation],
    /// Whether it takes part when all methods are shown together.
    pub in_all: bool,
}

/// What one diagnoser must say.
#[derive(Clone, Copy, Debug)]
pub struct Expectation {
    /// The diagnoser.
    pub diagnoser: &'static str,
    /// What is injected, for people.
    pub fault: &'static str,
    /// The first moment whose sample can show the fault, seconds after the start.
    pub onset_s: f64,
    /// By when it must be detected, seconds after the onset.
    pub detect_within_s: f64,
    /// The fault that must be isolated, as the diagnoser names it; `None` where the method cannot tell.
    pub isolates: Option<&'static str>,
}

/// Every scenario.
pub const SCENARIOS: &[Scenario] = &[
    Scenario {
        name: "aircraft-1",
        method: "unknown_input_filter",
        title: "actuator 1 of an aircraft in hover fails",
        example: example!("vtol"),
        speed: 1.0,
        duration_s: 4.0,
        plants: |variation| aircraft::sources(1, variation),
        expectations: &[Expectation {
            diagnoser: "aircraft_actuators",
            fault: "collective pitch +2",
            onset_s: 1.02,
            detect_within_s: 0.08,
            isolates: Some("collective_pitch"),
        }],
        in_all: true,
    },
    Scenario {
        name: "aircraft-2",
        method: "unknown_input_filter",
        title: "actuator 2 of an aircraft in hover fails",
        example: example!("vtol"),
        speed: 1.0,
        duration_s: 4.0,
        plants: |variation| aircraft::sources(2, variation),
        expectations: &[Expectation {
            diagnoser: "aircraft_actuators",
            fault: "longitudinal cyclic pitch +1",
            onset_s: 1.02,
            detect_within_s: 0.08,
            isolates: Some("longitudinal_cyclic_pitch"),
        }],
        in_all: false,
    },
    Scenario {
        name: "servo",
        method: "reduced_order_observer",
        title: "the actuator of a servo gets an offset",
        example: example!("servo"),
        speed: 4.0,
        duration_s: 15.0,
        plants: servo::sources,
        expectations: &[Expectation {
            diagnoser: "servo_actuator",
            fault: "offset of 0.5",
            onset_s: 5.1,
            detect_within_s: 2.0,
            isolates: Some("actuator"),
        }],
        in_all: true,
    },
    Scenario {
        name: "target",
        method: "async_imm",
        title: "an actuator of a turning target fails, seen by three sensors without a common clock, with losses",
        example: example!("turning_target"),
        speed: 4.0,
        duration_s: 40.0,
        plants: target::sources,
        expectations: &[Expectation {
            diagnoser: "turning_target",
            fault: "acceleration of 2 m/s^2",
            onset_s: 16.5,
            detect_within_s: 15.0,
            isolates: Some("actuator 2"),
        }],
        in_all: true,
    },
    Scenario {
        name: "scalar",
        method: "chi_square",
        title: "the sensors of a stable, an unstable and a marginal system fail, softly or hard",
        example: example!("scalar"),
        speed: 4.0,
        duration_s: 20.0,
        plants: scalar::sources,
        expectations: &[
            Expectation {
                diagnoser: "stable_system",
                fault: "ramp of 0.02 per instant",
                onset_s: 5.1,
                detect_within_s: 5.0,
                isolates: Some("value"),
            },
            Expectation {
                diagnoser: "unstable_system",
                fault: "step of 1",
                onset_s: 5.0,
                detect_within_s: 3.0,
                isolates: Some("value"),
            },
            Expectation {
                diagnoser: "marginal_system",
                fault: "ramp of 0.02 per instant",
                onset_s: 5.1,
                detect_within_s: 5.0,
                isolates: Some("value"),
            },
        ],
        in_all: true,
    },
    Scenario {
        name: "two-state-actuator",
        method: "hinf_filter",
        title: "the actuator of a disturbed plant drifts",
        example: example!("two_state"),
        speed: 2.0,
        duration_s: 20.0,
        plants: |variation| two_state::sources(Fault::ActuatorRamp(0.04), variation),
        expectations: &[Expectation {
            diagnoser: "two_state_plant",
            fault: "f1, 0.04 per second",
            onset_s: 15.01,
            detect_within_s: 0.3,
            isolates: Some("f1"),
        }],
        in_all: true,
    },
    Scenario {
        name: "two-state-sensor",
        method: "hinf_filter",
        title: "the sensor of a disturbed plant is off",
        example: example!("two_state"),
        speed: 2.0,
        duration_s: 20.0,
        plants: |variation| two_state::sources(Fault::SensorStep(0.2), variation),
        expectations: &[Expectation {
            diagnoser: "two_state_plant",
            fault: "f2, step of 0.2",
            onset_s: 15.0,
            detect_within_s: 0.1,
            isolates: Some("f2"),
        }],
        in_all: false,
    },
];

/// The scenario of this name.
pub fn named(name: &str) -> Option<&'static Scenario> {
    SCENARIOS.iter().find(|scenario| scenario.name == name)
}

/// The scenarios of a method.
pub fn of_method(method: &str) -> Vec<&'static Scenario> {
    SCENARIOS
        .iter()
        .filter(|scenario| scenario.method == method)
        .collect()
}

/// One scenario per method.
pub fn of_all_methods() -> Vec<&'static Scenario> {
    SCENARIOS.iter().filter(|scenario| scenario.in_all).collect()
}

/// The methods that are shown, in order.
pub fn methods() -> Vec<&'static str> {
    let mut methods: Vec<_> = SCENARIOS.iter().map(|scenario| scenario.method).collect();
    methods.dedup();
    methods
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::configuration::Configuration;
    use std::collections::HashSet;

    const VARIATION: Variation = Variation {
        seed: 1,
        disturbance: Disturbance::Sine,
    };

    #[test]
    fn every_scenario_has_a_name_of_its_own_and_one_per_method_is_shown_with_all() {
        let names: HashSet<_> = SCENARIOS.iter().map(|scenario| scenario.name).collect();
        assert_eq!(names.len(), SCENARIOS.len());
        let shown: Vec<_> = of_all_methods().iter().map(|scenario| scenario.method).collect();
        assert_eq!(shown, methods());
    }

    #[test]
    fn every_scenario_expects_something_of_the_diagnosers_of_its_configuration() {
        for scenario in SCENARIOS {
            let loaded = Configuration::from_text(scenario.name, scenario.example.configuration).unwrap();
            let diagnosers: Vec<_> = loaded
                .configuration
                .diagnosers
                .iter()
                .map(|d| d.name.as_str())
                .collect();
            for expectation in scenario.expectations {
                assert!(diagnosers.contains(&expectation.diagnoser), "{expectation:?}");
                assert!(expectation.onset_s + expectation.detect_within_s <= scenario.duration_s);
            }
            assert_eq!(diagnosers.len(), scenario.expectations.len(), "{}", scenario.name);
            let inputs: HashSet<_> = loaded
                .configuration
                .inputs
                .iter()
                .map(|input| input.name.as_str())
                .collect();
            for mut source in (scenario.plants)(&VARIATION) {
                for _ in 0..20 {
                    let emission = source.next_emission().unwrap();
                    assert!(inputs.contains(emission.input), "{}", emission.input);
                }
            }
        }
    }
}
