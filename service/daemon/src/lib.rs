//! The daemon `residuald`: samples in, diagnosis at every sampling instant, bounds and alarms out.
//!
//! | module | what |
//! |---|---|
//! | [`configuration`] | the configuration file: loading, validation, located mistakes |
//! | [`assembly`] | from a configuration to the parts of a running monitor |
//! | [`identities`] | which diagnosers and inputs of two configurations are the same |
//! | [`runtime`] | the daemon at work: inboxes, schedule, step thread, companion |
//! | [`replay`] | recordings instead of sensors |
//! | [`demo`] | publisher, daemon and client of the demonstration |
//! | [`plot`] | plots of a design |
//! | [`summary`] | what a run did, in numbers |
//! | [`logging`] | the log, off the step thread |
//! | [`cli`], [`commands`] | the command line |

pub mod assembly;
pub mod cli;
pub mod commands;
pub mod configuration;
pub mod demo;
pub mod identities;
pub mod lifecycle;
pub mod logging;
pub mod plot;
pub mod replay;
pub mod runtime;
pub mod summary;
