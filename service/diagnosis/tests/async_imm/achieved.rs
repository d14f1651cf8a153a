//! What a bank of mode filters states that it achieves.

use crate::configuration::{example, options};
use residual_diagnosis::achieved::{Achieved, Need, SizeOf};
use residual_diagnosis::async_imm::options::AsyncImmTables;
use residual_diagnosis::method::MethodOptions;

fn achieved(tables: &AsyncImmTables) -> Achieved {
    tables.design(1.0).unwrap().achieved
}

#[test]
fn thresholds_and_gaps_of_the_papers_plant_are_stated_and_no_rate_is_made_up() {
    let found = achieved(&options(example()));
    let channels: Vec<&str> = found
        .thresholds
        .iter()
        .map(|threshold| threshold.channel.as_str())
        .collect();
    assert_eq!(
        channels,
        [
            "fault probability",
            "probability actuator 1",
            "probability actuator 2"
        ]
    );
    assert!(found.thresholds.iter().all(|threshold| threshold.settled == 0.9));
    assert_eq!(found.inequalities.len(), 2);
    assert!(
        found
            .inequalities
            .iter()
            .all(|gap| (gap.margin - 0.905).abs() < 5e-4)
    );
    let alarms = found.false_alarms.as_ref().unwrap();
    assert_eq!(
        (alarms.probability_per_instant, alarms.expected_per_hour),
        (None, None)
    );
    assert!(alarms.provided_that.contains("simulation") && alarms.provided_that.contains("0.9 for 2"));
    assert!(found.faults.is_empty());
    for size in [SizeOf::Detectable, SizeOf::Isolable] {
        assert!(
            found
                .not_stated
                .iter()
                .any(|not| not.size == size && not.faults.is_empty())
        );
    }
    // A declaration takes L = 2 instants at least.
    assert_eq!(found.isolability.len(), 2);
    assert!(
        found
            .isolability
            .iter()
            .all(|pair| pair.instants == Some(2) && pair.need == Need::AtLeast)
    );
}

#[test]
fn only_modes_whose_filter_becomes_steady_have_poles() {
    let constant = achieved(&options(example()));
    assert_eq!(constant.poles.len(), 1);
    assert!(constant.poles[0].name.contains("normal") && constant.poles[0].values.len() == 4);
    let mut walking = options(example());
    walking.amplitude.random_walk_psd = Some(vec![0.1]);
    let walking = achieved(&walking);
    let counts: Vec<usize> = walking.poles.iter().map(|poles| poles.values.len()).collect();
    assert_eq!(counts, [4, 5, 5]);
    for poles in &walking.poles {
        assert!(poles.values.iter().all(|[re, im]| re.hypot(*im) < 1.0));
    }
}

#[test]
fn modes_that_only_transients_tell_apart_are_said_to_be_so() {
    let mut tables = options(example());
    // Both channels act through the same column.
    for row in &mut tables.plant.f {
        row[1] = row[0] * 2.0;
    }
    let found = achieved(&tables).isolability;
    assert_eq!(found.len(), 2);
    assert!(
        found.iter().all(|pair| pair.need == Need::Transients),
        "{found:?}"
    );
}
