//! Benchmarks of residuald; run them with `cargo bench -p residual-benches`.

pub mod shared_words;
