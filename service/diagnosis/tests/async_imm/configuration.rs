//! From tables to a diagnoser.

use crate::support::example::examples;
use residual_diagnosis::async_imm::options::AsyncImmTables;
use residual_diagnosis::method::MethodOptions;

/// The method's tables of the example.
pub fn example() -> toml::Table {
    examples("turning_target.toml", AsyncImmTables::METHOD)
        .remove(0)
        .tables
}

/// The options of a table.
pub fn options(table: toml::Table) -> AsyncImmTables {
    table.try_into().unwrap()
}

#[test]
fn the_example_is_the_papers_plant_with_the_default_settings() {
    let tables = options(example());
    let (design, settings) = tables.to_design(1.0).unwrap();
    let file = crate::fixture::file("paper_seed20170.json");
    let expected = crate::fixture::design(&file, "default");
    assert_eq!(design.prior, expected.prior);
    assert_eq!(
        design.plant.pieces().collect::<Vec<_>>(),
        expected.plant.pieces().collect::<Vec<_>>()
    );
    for (one, other) in design.sensors.iter().zip(&expected.sensors) {
        assert_eq!(one.measurement_matrix, other.measurement_matrix);
        assert_eq!(one.noise_covariance, other.noise_covariance);
    }
    assert_eq!(design.modes, expected.modes);
    assert_eq!((design.form, design.mixing), (expected.form, expected.mixing));
    assert_eq!(settings.decision, crate::fixture::rule(&file, "default"));
    assert_eq!(settings.initial_command, [0.5, 0.5]);
    tables.validate(1.0).unwrap();
    let designed = tables.design(1.0).unwrap();
    assert!(designed.warnings.is_empty());
    let description = designed.diagnoser.description().clone();
    let channels: Vec<&str> = description
        .channels
        .iter()
        .map(|channel| channel.name.as_str())
        .collect();
    assert_eq!(
        channels,
        [
            "fault probability",
            "probability actuator 1",
            "probability actuator 2",
            "amplitude actuator 1",
            "amplitude actuator 2"
        ]
    );
    assert_eq!(description.channels[3].unit, "m/s^2");
    assert_eq!(description.faults, ["actuator 1", "actuator 2"]);
    assert_eq!((description.measurement_count, description.command_count), (6, 2));
    assert_eq!(description.packets.unwrap().sensor_rows, [2, 2, 2]);
    assert_eq!(tables.signal_counts(), (6, 2));
}

#[test]
fn tables_survive_being_written_and_read() {
    let tables = options(example());
    let again: AsyncImmTables = toml::from_str(&toml::to_string(&tables).unwrap()).unwrap();
    assert_eq!(again, tables);
}

#[test]
fn fault_channels_take_the_names_of_the_commands_that_enter_like_them() {
    let mut table = example();
    let plant = table["plant"].as_table_mut().unwrap();
    plant.remove("channels");
    plant.remove("channel_units");
    let signal = |name: &str| (name.to_owned(), "N".to_owned());
    let commands = [signal("left"), signal("right")];
    let mut tables = options(table.clone());
    tables.name_signals(&[], &commands);
    let (_, settings) = tables.to_design(1.0).unwrap();
    assert_eq!(settings.channels, commands);
    // Other columns than the commands': plain names.
    let mut other = options(table);
    other.plant.f[1][0] = -2.0;
    other.name_signals(&[], &commands);
    let (_, settings) = other.to_design(1.0).unwrap();
    assert_eq!(settings.channels[0], ("channel 1".to_owned(), String::new()));
}

#[test]
fn a_random_walk_acts_where_its_slot_is_active() {
    let mut tables = options(example());
    tables.amplitude.random_walk_psd = Some(vec![0.3]);
    let (design, _) = tables.to_design(1.0).unwrap();
    let walks: Vec<f64> = design.modes.iter().map(|mode| mode.random_walk_psd[0]).collect();
    assert_eq!(walks, [0.0, 0.3, 0.3]);
}

#[test]
fn modes_that_only_transients_tell_apart_and_mixing_of_all_are_warned_of() {
    let mut tables = options(example());
    // A force and its derivative's path: in the steady state one receiver row cannot tell them apart.
    tables.sensor.truncate(1);
    tables.sensor[0].measurement_matrix = vec![vec![1.0, 0.0, 0.0, 0.0]];
    tables.sensor[0].noise_covariance = vec![vec![25.0]];
    tables.amplitude.mixing = residual_diagnosis::async_imm::options::Mixing::All;
    // With both rates damped the plant is detectable from one position.
    tables.plant.a = vec![
        vec![-1.0, 1.0, 0.0, 0.0],
        vec![0.0, -1.0, 1.0, 0.0],
        vec![0.0, 0.0, -1.0, 1.0],
        vec![0.0, 0.0, 0.0, -1.0],
    ];
    let designed = tables.design(1.0).unwrap();
    assert_eq!(designed.warnings.len(), 2, "{:?}", designed.warnings);
    assert!(designed.warnings[0].contains("actuator 1") && designed.warnings[0].contains("transients"));
}
