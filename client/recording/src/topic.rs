//! Names of the topics of a recording.

/// The topic of the step records of a diagnoser.
pub fn records(instance: &str, diagnoser: &str) -> String {
    format!("/{instance}/records/{diagnoser}")
}

/// The topic of the alarm transitions.
pub fn alarms(instance: &str) -> String {
    format!("/{instance}/alarms")
}

/// The topic of the samples of an input.
pub fn samples(instance: &str, input: &str) -> String {
    format!("/{instance}/samples/{input}")
}
