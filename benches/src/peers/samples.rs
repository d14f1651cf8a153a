//! stub
use super::environment::Environment;
use crate::results::Results;
use anyhow::Result;
/// .
pub fn compare(_environment: &Environment, _quick: bool, _results: &mut Results) -> Result<()> {
    Ok(())
}
