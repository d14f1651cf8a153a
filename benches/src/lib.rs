//! Benchmarks of residuald; run them with `cargo bench -p residual-benches`.
