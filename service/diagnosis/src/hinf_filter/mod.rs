//! Robust fault detection filter: an observer whose residual is weakly driven by disturbances and strongly by faults.
pub mod plant;
pub mod realisation;
pub mod synthesis;
