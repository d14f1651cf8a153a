//! temporary
use super::*;
/// stub
pub struct BuiltDiagnoser {
    /// x
    pub diagnoser: Box<dyn residual_diagnosis::diagnoser::Diagnoser>,
    /// y
    pub warnings: Vec<String>,
}
impl Loaded {
    /// z
    pub fn build_diagnosers(&self) -> Result<Vec<BuiltDiagnoser>, ConfigurationError> {
        Ok(self
            .configuration
            .diagnosers
            .iter()
            .map(|d| {
                let MethodConfiguration::UnknownInputFilter { model, options } = &d.method;
                let m = residual_diagnosis::model::LinearModel::new(model, d.sample_time_s()).unwrap();
                BuiltDiagnoser {
                    diagnoser: Box::new(
                        residual_diagnosis::unknown_input_filter::UnknownInputFilterBank::new(m, options)
                            .unwrap(),
                    ),
                    warnings: vec![],
                }
            })
            .collect())
    }
}
