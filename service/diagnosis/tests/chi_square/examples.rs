//! The example configurations are right and do what they say.

use crate::support::example::examples;
use residual_diagnosis::{chi_square::ChiSquareOptions, method::MethodOptions};

#[test]
fn every_example_designs_without_a_warning() {
    for name in ["vehicle.toml", "scalar.toml"] {
        for example in examples(name, ChiSquareOptions::METHOD) {
            let mut options: ChiSquareOptions = example.tables.try_into().unwrap();
            assert_eq!(options.signal_counts(), example.signal_counts);
            let measurements = example.signal_counts.0;
            let signal = |i: usize| (format!("signal_{i}"), "unit".to_owned());
            let names: Vec<_> = (0..measurements).map(signal).collect();
            options.name_signals(&names, &[]);
            let designed = options.design(example.sample_time_s).unwrap();
            println!("{name}: {:#?}", designed.notes);
            assert!(designed.warnings.is_empty(), "{name}: {:#?}", designed.warnings);
            assert_eq!(designed.diagnoser.description().faults.len(), measurements);
        }
    }
}
