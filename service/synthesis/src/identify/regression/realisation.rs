//! Equations as a state-space model.

use super::{Regression, RegressionError};
use nalgebra::DMatrix;

/// The equations as a model whose states carry the past along, with all regressors as commands.
///
/// y_e(k) = s_1(k) + Σ of the terms without lag, s_i(k) = s_{i+1}(k-1) + Σ of the terms of lag i at k-1. All that y
/// depends on has been measured, so that the residual is the innovation of this model. A constant is a last state that
/// stays 1.
#[derive(Clone, Debug, PartialEq)]
pub struct ShiftRegister {
    /// Signals that are commands, in order.
    pub commands: Vec<usize>,
    /// States x states.
    pub transition: DMatrix<f64>,
    /// States x commands.
    pub input: DMatrix<f64>,
    /// Outputs x states.
    pub measurement: DMatrix<f64>,
    /// Outputs x commands.
    pub feedthrough: DMatrix<f64>,
    /// Whether the last state is the constant 1.
    pub has_constant: bool,
}

/// The equations as x(k+1) = A x(k) + B u(k) with the outputs as states.
#[derive(Clone, Debug, PartialEq)]
pub struct FirstOrder {
    /// Signals that are commands, in order.
    pub commands: Vec<usize>,
    /// Outputs x outputs.
    pub a: DMatrix<f64>,
    /// Outputs x commands.
    pub b: DMatrix<f64>,
}

impl Regression {
    /// Signals of terms, in order of first use.
    fn regressors(&self) -> Vec<usize> {
        let mut signals = Vec::new();
        for term in self.equations.iter().flat_map(|equation| &equation.terms) {
            if !signals.contains(&term.signal) {
                signals.push(term.signal);
            }
        }
        signals
    }

    /// The equations with their past as states.
    pub fn shift_register(&self) -> ShiftRegister {
        let commands = self.regressors();
        let depth = |e: usize| {
            self.equations[e]
                .terms
                .iter()
                .map(|term| term.lag)
                .max()
                .unwrap_or(0)
                .max(1)
        };
        let outputs = self.equations.len();
        let first: Vec<usize> = (0..outputs).map(|e| (0..e).map(depth).sum()).collect();
        let states: usize = (0..outputs).map(depth).sum();
        let has_constant = self.equations.iter().any(|equation| equation.constant);
        let size = states + usize::from(has_constant);
        let mut model = ShiftRegister {
            transition: DMatrix::zeros(size, size),
            input: DMatrix::zeros(size, commands.len()),
            measurement: DMatrix::zeros(outputs, size),
            feedthrough: DMatrix::zeros(outputs, commands.len()),
            commands,
            has_constant,
        };
        if has_constant {
            model.transition[(states, states)] = 1.0;
        }
        for (e, (equation, found)) in self.equations.iter().zip(&self.found).enumerate() {
            model.measurement[(e, first[e])] = 1.0;
            for i in 1..depth(e) {
                model.transition[(first[e] + i - 1, first[e] + i)] = 1.0;
            }
            for (term, coefficient) in equation.terms.iter().zip(&found.coefficients) {
                let column = model.commands.iter().position(|signal| *signal == term.signal);
                let Some(column) = column else { continue };
                match term.lag {
                    0 => model.feedthrough[(e, column)] += coefficient,
                    lag => model.input[(first[e] + lag - 1, column)] += coefficient,
                }
            }
            if equation.constant
                && let Some(constant) = found.coefficients.last()
            {
                model.measurement[(e, states)] = *constant;
            }
        }
        model
    }

    /// The equations with the outputs as states.
    ///
    /// # Errors
    /// [`RegressionError::NotFirstOrder`]: a term whose lag is not 1, or a constant.
    pub fn first_order(&self) -> Result<FirstOrder, RegressionError> {
        let refuse = |reason: &str| RegressionError::NotFirstOrder {
            reason: reason.to_owned(),
        };
        let outputs: Vec<usize> = self.equations.iter().map(|equation| equation.output).collect();
        if self.equations.iter().any(|equation| equation.constant) {
            return Err(refuse("this method's model has no constant"));
        }
        if self
            .equations
            .iter()
            .flat_map(|equation| &equation.terms)
            .any(|term| term.lag != 1)
        {
            return Err(refuse("as a model of this method, every term needs the lag 1"));
        }
        if (1..outputs.len()).any(|e| outputs[..e].contains(&outputs[e])) {
            return Err(refuse("two equations have the same output"));
        }
        let commands: Vec<usize> = self
            .regressors()
            .into_iter()
            .filter(|signal| !outputs.contains(signal))
            .collect();
        let mut model = FirstOrder {
            a: DMatrix::zeros(outputs.len(), outputs.len()),
            b: DMatrix::zeros(outputs.len(), commands.len()),
            commands,
        };
        for (e, (equation, found)) in self.equations.iter().zip(&self.found).enumerate() {
            for (term, coefficient) in equation.terms.iter().zip(&found.coefficients) {
                let place = |signals: &[usize]| signals.iter().position(|signal| *signal == term.signal);
                if let Some(state) = place(&outputs) {
                    model.a[(e, state)] += coefficient;
                } else if let Some(command) = place(&model.commands) {
                    model.b[(e, command)] += coefficient;
                }
            }
        }
        Ok(model)
    }
}
