//! The parity test: a certificate applied to the last samples (method sheet 3.4 and 4.4).
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | n | | transitions of the window, from sample 0 to sample n |
//! | λ_k, μ_k | nx, ny | certificate |
//! | x̄_k | nx | guaranteed bound of the absolute state |
//! | δ, γ | | 2⁻⁵³ and Nδ/(1-Nδ), N = (n+1)(ny+nx) + n nu + 8: bound of accumulated rounding |
//! | ζ_k, ℓ_k | nx | size of, and bound of the error in, λ_{k-1} = A0'λ_k + C'μ_k |
//! | θ_k, ψ_k | nf, nx | bound of F'λ_k, and its effect through the state by which the own fault is bounded |

use super::certificate::{CertificateError, ParityCertificate};
use super::modes::FaultMode;
use super::parity_window::{ParityWindow, WindowSamples};
use crate::decomposition::SingularDecomposition;
use crate::matrix::blocks::{absolute_dot_of, dot_of};
use crate::matrix::dot;
use crate::matrix::vectors::{Work, vectorised};
use crate::model::LinearModel;
use nalgebra::DVector;
use pulp::Simd;

/// The tables of one certificate: everything but the samples, computed once.
#[derive(Clone, Debug)]
pub struct ParityTest {
    mode: FaultMode,
    fault: usize,
    length: usize,
    transitions: usize,
    gain: f64,
    constant: f64,
    mu: Vec<f64>,
    b_lambda: Vec<f64>,
    state_table: Vec<f64>,
    command_table: Vec<f64>,
}

impl ParityTest {
    /// Builds the tables; with `outward_rounding` the half width also covers rounding errors and the rest by
    /// which the equalities of the certificate are missed.
    ///
    /// # Errors
    /// [`CertificateError`] if the certificate does not belong to the model.
    pub fn new(
        certificate: &ParityCertificate,
        model: &LinearModel,
        outward_rounding: bool,
    ) -> Result<Self, CertificateError> {
        certificate.validate(model)?;
        let (nx, nu, ny) = (model.state_count(), model.actuator_count(), model.output_count());
        let n = certificate.transitions();
        let delta = f64::EPSILON / 2.0;
        let operations = ((n + 1) * (ny + nx) + n * nu + 8) as f64;
        let gamma = if outward_rounding {
            operations * delta / (1.0 - operations * delta)
        } else {
            0.0
        };
        let four_gamma = 4.0 * gamma;

        let (lambda, mu) = (certificate.lambda_columns(), certificate.mu_columns());
        let f = certificate.mode.unknown_input_matrix(model.b());
        let f_inverse =
            SingularDecomposition::new(&f)
                .left_inverse(1e-12)
                .ok_or(CertificateError::DependentFaults {
                    mode: certificate.mode,
                })?;
        let [a_abs, b_abs, c_abs, d_abs] = [model.a0(), model.b(), model.c(), model.d()].map(|m| m.abs());
        let zero = DVector::zeros(nx);
        let psi: Vec<DVector<f64>> = lambda
            .iter()
            .map(|lambda| {
                if !outward_rounding {
                    return zero.clone();
                }
                let theta = (f.tr_mul(lambda).abs() + f.abs().tr_mul(&lambda.abs()) * four_gamma) * 2.0;
                f_inverse.abs().tr_mul(&theta)
            })
            .collect();

        let mut constant = 0.0;
        let (mut state_table, mut command_table) = (Vec::new(), Vec::new());
        for k in 0..=n {
            let previous = if k == 0 { &zero } else { &lambda[k - 1] };
            let current = lambda.get(k).unwrap_or(&zero);
            let current_abs = current.abs();
            let (psi_previous, psi_current) = (
                if k == 0 { &zero } else { &psi[k - 1] },
                psi.get(k).unwrap_or(&zero),
            );
            let outputs = c_abs.tr_mul(&mu[k].abs());
            let mut states = model.a_plus().tr_mul(&current_abs) * (1.0 + four_gamma);
            if outward_rounding {
                let zeta = previous.abs() + a_abs.tr_mul(&current_abs) + &outputs;
                let missed = (previous - model.a0().tr_mul(current) - model.c().tr_mul(&mu[k])).abs()
                    + zeta * four_gamma;
                states += outputs * four_gamma
                    + missed * 2.0
                    + (&a_abs + model.a_plus()).tr_mul(psi_current)
                    + psi_previous;
            }
            state_table.extend(states.iter());
            let noise = mu[k].abs().dot(model.v());
            let disturbance = model.d().tr_mul(current).abs().dot(model.w());
            let own_fault = psi_current.dot(&(&d_abs * model.w()));
            constant += (1.0 + four_gamma) * (noise + disturbance) + four_gamma * noise + own_fault;
            if k < n {
                command_table
                    .extend((b_abs.tr_mul(&current_abs) * four_gamma + b_abs.tr_mul(psi_current)).iter());
            }
        }
        Ok(Self {
            mode: certificate.mode,
            fault: certificate.fault,
            length: certificate.length,
            transitions: n,
            gain: certificate.gain(model),
            constant,
            mu: certificate.mu.concat(),
            b_lambda: lambda
                .iter()
                .flat_map(|lambda| model.b().tr_mul(lambda).data.as_vec().clone())
                .collect(),
            state_table,
            command_table,
        })
    }

    /// The mode that this test can falsify.
    pub fn mode(&self) -> FaultMode {
        self.mode
    }

    /// The actuator whose fault it was designed to see.
    pub fn fault(&self) -> usize {
        self.fault
    }

    /// L: fault duration, in samples, that it was designed for.
    pub fn length(&self) -> usize {
        self.length
    }

    /// n: number of transitions it needs in the window.
    pub fn transitions(&self) -> usize {
        self.transitions
    }

    /// Response of r to a unit fault lasting over the last L transitions, > 0; a constant fault above
    /// 2 h / gain is certainly seen.
    pub fn gain(&self) -> f64 {
        self.gain
    }

    /// h0: the part of the half width that does not depend on the samples.
    pub fn constant_half_width(&self) -> f64 {
        self.constant
    }

    /// The half width while |x| does not exceed `state` (length nx) and the commands are zero.
    pub fn half_width_at(&self, state: &[f64]) -> f64 {
        let states = self.state_table.chunks(state.len().max(1));
        self.constant + states.map(|entries| dot(entries, state)).sum::<f64>()
    }

    /// Residual r and half width h over the last n transitions of the window. While the mode holds, |r| <= h;
    /// the mode is falsified by `!(|r| <= h)`.
    ///
    /// `None` as long as the window holds fewer than n complete transitions, belongs to a model of other
    /// dimensions, or gives values that overflow.
    pub fn evaluate(&self, window: &ParityWindow) -> Option<(f64, f64)> {
        let samples = window.latest(self.transitions)?;
        let lengths = [
            samples.measurements.len(),
            samples.commands.len(),
            samples.state_bounds.len(),
        ];
        if lengths != [self.mu.len(), self.b_lambda.len(), self.state_table.len()] {
            return None;
        }
        let (residual, half_width) = vectorised(Evaluation { test: self, samples });
        (residual.is_finite() && half_width.is_finite()).then_some((residual, half_width))
    }
}

/// r and h of one window.
struct Evaluation<'a> {
    test: &'a ParityTest,
    samples: WindowSamples<'a>,
}

impl Work for Evaluation<'_> {
    type Output = (f64, f64);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (f64, f64) {
        let (test, samples) = (self.test, self.samples);
        let (y, u, x) = (samples.measurements, samples.commands, samples.state_bounds);
        let residual = dot_of(simd, &test.mu, y) - dot_of(simd, &test.b_lambda, u);
        // Any order of the additions is within γ, which counts the operations and not their depth.
        let half_width = test.constant
            + dot_of(simd, &test.state_table, x)
            + absolute_dot_of(simd, u, &test.command_table);
        (residual, half_width)
    }
}

#[cfg(test)]
#[path = "parity_tests.rs"]
mod tests;
