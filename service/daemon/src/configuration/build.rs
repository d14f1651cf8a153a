//! From a configuration to its diagnosers.

use super::design::DesignedMethod;
use super::error::ConfigurationError;
use super::load::Loaded;
use super::locate::{Document, Mistakes};
use super::method::MethodError;
use residual_diagnosis::diagnoser::Diagnoser;

/// A diagnoser, ready for its first step.
pub struct BuiltDiagnoser {
    /// The diagnoser.
    pub diagnoser: Box<dyn Diagnoser>,
    /// What the construction found, for people: name and value.
    pub notes: Vec<(&'static str, String)>,
    /// What is accepted but deserves a second look.
    pub warnings: Vec<String>,
}

impl Loaded {
    /// Constructs the diagnosers, in the order of the configuration. Their off-line design is done the first time
    /// and kept, so that all diagnosers of one configuration are equal to the last bit.
    ///
    /// # Errors
    /// The conditions of the methods that do not hold, one a diagnoser, at their places in the text.
    pub fn build_diagnosers(&self) -> Result<Vec<BuiltDiagnoser>, ConfigurationError> {
        let diagnosers = &self.configuration.diagnosers;
        let designs = self.designs.get_or_init(|| {
            diagnosers
                .iter()
                .map(|diagnoser| diagnoser.method.design(diagnoser.sample_time_s()))
                .collect()
        });
        let results = diagnosers.iter().zip(designs).map(|(diagnoser, design)| {
            let built = design
                .as_ref()
                .map_err(MethodError::clone)
                .and_then(DesignedMethod::build);
            built.map_err(|error| (&diagnoser.name, error))
        });
        let results: Vec<_> = results.collect();
        if results.iter().all(Result::is_ok) {
            return Ok(results.into_iter().flatten().collect());
        }
        let document = Document::parse(&self.source)?;
        let mut mistakes = Mistakes::new(&document);
        for (index, result) in results.into_iter().enumerate() {
            if let Err((name, error)) = result {
                let message = format!("the diagnoser `{name}` cannot be built: {}", error.message);
                mistakes.at(&format!("diagnoser.{index}.{}", error.key), message, error.help);
            }
        }
        Err(mistakes.into_error())
    }
}
