//! The example configuration of the paper's plant.

use crate::paper::{PaperPlant, step};
use crate::support::example::examples;
use residual_diagnosis::{
    diagnoser::Verdict,
    hinf_filter::{HinfFilter, options::HinfFilterOptions},
    method::MethodOptions,
};

#[test]
fn the_example_isolates_the_papers_faults_and_is_silent_without() {
    let example = examples("two_state.toml", HinfFilterOptions::METHOD).remove(0);
    let sample_time_s = example.sample_time_s;
    let options: HinfFilterOptions = example.tables.try_into().unwrap();
    assert_eq!(options.signal_counts(), example.signal_counts);
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
