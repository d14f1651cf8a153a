//! Tables of banks, random plants, and the way through a gains file.

use rand::RngExt;
use rand_chacha::ChaCha8Rng;
use residual_diagnosis::diagnoser::{Diagnoser, StepInput, StepRecord};
use residual_diagnosis::gains::FoundGains;
use residual_diagnosis::gains::file::{Entry, GainsFile, TOLERANCE, VERSION, hash_of_inputs};
use residual_diagnosis::method::{Designed, MethodOptions};
use residual_diagnosis::unknown_input_filter::gains::UnknownInputFilterGains;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;
use residual_synthesis::unknown_input_filter::find_gains;

pub const PERIOD_S: f64 = 0.01;

pub type Found = FoundGains<UnknownInputFilterGains>;

/// The aircraft of the method sheet with these further tables.
pub fn aircraft_tables(further: &str) -> UnknownInputFilterTables {
    const MODEL: &str = r#"
[model]
A = [[0.9996, 0.0003, 0.0002, -0.0046], [0.0005, 0.9899, 0.0, -0.0402], [0.0010, 0.0007, 0.9929, 0.0012], [0, 0, 0.01, 1]]
B = [[0.0044, 0.0018], [0.0198, -0.0759], [-0.0552, 0.0449], [0, 0]]
C = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1]]
D = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
A_uncertainty = [[0.01, 0, 0, 0], [0, 0.01, 0, 0], [0, 0, 0.01, 0], [0, 0, 0, 0]]
disturbance_bound = [0.01, 0.01, 0.01, 0.01]
measurement_noise_bound = [0.01, 0.01, 0.01, 0.01]
initial_state_center = [0, 0, 0, 0]
initial_state_radius = [1, 1, 1, 1]
actuator_names = ["collective_pitch", "longitudinal_cyclic_pitch"]
[missing]
policy = "unbounded_fault"
"#;
    tables(&format!("{MODEL}\n{further}"))
}

pub fn tables(text: &str) -> UnknownInputFilterTables {
    toml::from_str(text).unwrap()
}

pub fn find(tables: &UnknownInputFilterTables) -> Found {
    find_gains(tables, PERIOD_S, &mut |_| ()).unwrap()
}

/// The design with gains found by a solver.
pub fn design(tables: &UnknownInputFilterTables) -> Designed {
    let found = find(tables);
    tables.with_gains(PERIOD_S, &found.gains).unwrap()
}

/// The text of a gains file for one diagnoser.
pub fn written(tables: &UnknownInputFilterTables, found: &Found, designed: &Designed) -> String {
    let entry = Entry {
        name: "bank".to_owned(),
        method: UnknownInputFilterTables::METHOD.to_owned(),
        sample_time_s: PERIOD_S,
        inputs: hash_of_inputs(tables, PERIOD_S).unwrap(),
        warnings: found.warnings.clone(),
        solver: found.solver.clone(),
        gains: toml::Table::try_from(&found.gains).unwrap(),
        achieved: designed.achieved.clone(),
    };
    let file = GainsFile {
        version: VERSION,
        tool: "test".to_owned(),
        date: "2026-01-01T00:00:00Z".to_owned(),
        tolerance: TOLERANCE,
        diagnoser: vec![entry],
    };
    file.to_text("a test").unwrap()
}

pub fn read(text: &str) -> Entry {
    GainsFile::parse(text).unwrap().entry("bank").unwrap().1.clone()
}

/// A random plant with n states and two actuators; every second one has fewer outputs than states.
pub fn random_tables(random: &mut ChaCha8Rng, n: usize, lengths: &[usize]) -> UnknownInputFilterTables {
    let outputs = if n > 3 && random.random_bool(0.5) {
        n - 1
    } else {
        n.max(3)
    };
    let mut matrix = |rows: usize, columns: usize, size: f64| -> Vec<Vec<f64>> {
        (0..rows)
            .map(|_| {
                (0..columns)
                    .map(|_| size * random.random_range(-1.0..1.0))
                    .collect()
            })
            .collect()
    };
    let mut a = matrix(n, n, 0.6 / n as f64);
    (0..n).for_each(|i| a[i][i] += 0.4);
    let model = toml::to_string(&toml::Table::from_iter([
        ("A".to_owned(), toml::Value::try_from(a).unwrap()),
        ("B".to_owned(), toml::Value::try_from(matrix(n, 2, 1.0)).unwrap()),
        (
            "C".to_owned(),
            toml::Value::try_from(matrix(outputs, n, 1.0)).unwrap(),
        ),
        ("D".to_owned(), toml::Value::try_from(matrix(n, 2, 1.0)).unwrap()),
        (
            "disturbance_bound".to_owned(),
            toml::Value::try_from([0.02, 0.01]).unwrap(),
        ),
        (
            "measurement_noise_bound".to_owned(),
            toml::Value::try_from(vec![0.05; outputs]).unwrap(),
        ),
        (
            "initial_state_radius".to_owned(),
            toml::Value::try_from(vec![1.0; n]).unwrap(),
        ),
    ]))
    .unwrap();
    tables(&format!(
        "[model]\n{model}\n[missing]\npolicy = \"unbounded_fault\"\n[parity]\nlengths = {lengths:?}\npre_samples = 2\n"
    ))
}

/// Everything that a diagnoser says and remembers over a short run with faults and losses.
pub fn run(designed: &Designed) -> Vec<u8> {
    let mut diagnoser: Box<dyn Diagnoser> = designed.diagnoser.boxed_clone();
    let counts = (
        diagnoser.description().measurement_count,
        diagnoser.description().command_count,
    );
    let mut said = Vec::new();
    for k in 0..40 {
        let value = |i: usize| 0.3 * (0.37 * k as f64 + 1.3 * i as f64).sin();
        let mut y: Vec<f64> = (0..counts.0).map(value).collect();
        if k == 17 {
            y[0] = f64::NAN;
        }
        let u: Vec<f64> = (0..counts.1).map(|j| value(j + 7)).collect();
        let mut record = StepRecord::new(diagnoser.description().channels.len());
        diagnoser.step(&StepInput::new(&y, &u), &mut record);
        said.extend(format!("{:?} {:?}", record.verdict, record.flags).bytes());
        for channel in record.channels() {
            for number in [channel.lower, channel.residual, channel.upper, channel.ratio] {
                said.extend(number.to_bits().to_le_bytes());
            }
        }
    }
    diagnoser.save(&mut said);
    said
}
