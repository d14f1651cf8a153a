//! The daemon `residuald`: samples in, diagnosis at every sampling instant, bounds and alarms out.
//!
//! | module | what |
//! |---|---|
//! | [`configuration`] | the configuration file: loading, validation, located mistakes |
//! | [`cli`], [`commands`] | the command line |



pub mod configuration;
