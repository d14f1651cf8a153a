//! The example configuration of the paper's plant.

use crate::paper::{PaperPlant, step};
use residual_diagnosis::{
    diagnoser::Verdict,
    hinf_filter::{HinfFilter, options::HinfFilterOptions},
    method::MethodOptions,
};
use std::path::PathBuf;

/// Keys of a diagnoser's table that are not the method's.
const COMMON: [&str; 9] = [
    "name",
    "method",
    "sample_time_s",
    "phase_s",
    "margin_s",
    "priority",
    "measurements",
    "commands",
    "command_delay_steps",
];

fn example() -> (HinfFilterOptions, f64) {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../deploy/config/two_state.toml");
    let text = std::fs::read_to_string(path).unwrap();
    let file: toml::Table = text.parse().unwrap();
    let mut diagnoser = file["diagnoser"].as_array().unwrap()[0]
        .as_table()
        .unwrap()
        .clone();
    assert_eq!(diagnoser["method"].as_str(), Some(HinfFilterOptions::METHOD));
    let sample_time_s = diagnoser["sample_time_s"].as_float().unwrap();
    for key in COMMON {
        diagnoser.remove(key);
    }
    (diagnoser.try_into().unwrap(), sample_time_s)
}

#[test]
fn the_example_isolates_the_papers_faults_and_is_silent_without() {
    let (options, sample_time_s) = example();
    options.validate(sample_time_s).unwrap();
    let designed = options.design(sample_time_s).unwrap();
    assert!(designed.warnings.is_empty(), "{:?}", designed.warnings);
    assert!(
        designed
            .notes
            .iter()
            .any(|(name, text)| *name == "guarantee" && text.starts_with("no alarm"))
    );
    for (case, faults) in [("none", 0), ("1", 0b01), ("2", 0b10)] {
        let mut filter = HinfFilter::new(&options, sample_time_s).unwrap();
        let mut plant = PaperPlant::new(case);
        let mut isolated = 0;
        for k in 0..1700 {
            let record = step(&mut filter, &plant.next(), &[1.0]);
            assert!(
                k >= 1500 || record.verdict() == Verdict::Nominal,
                "{case} {k}: {:?}",
                record.channels()
            );
            if record.verdict() == Verdict::Isolated {
                isolated |= record.certainly_faulty;
            }
        }
        assert_eq!(isolated, faults, "{case}");
    }
    assert_eq!(designed.diagnoser.description().channels.len(), 11);
}
