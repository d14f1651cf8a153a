//! Constants of the guaranteed thresholds (method sheet 3.7).

use super::plant::{SampledPlant, beside, slew_bound, stacked};
use crate::decomposition::SingularDecomposition;
use crate::{
    norms::{System, WindowConstants, h_infinity_discrete, l1_norm, observability_gramian},
    spectrum::spectral_radius,
};
use nalgebra::{DMatrix, DVector};

/// The gap envelope is complete when nothing later can exceed it by this part.
const ENVELOPE: f64 = 1e-15;
/// Longest response that an envelope is taken over.
const LONGEST: usize = 4_000_000;
/// Standard deviations of the bounds under measurement noise: peak and window energy.
const PEAK_DEVIATIONS: f64 = 6.0;
const ENERGY_DEVIATIONS: f64 = 5.0;

/// The error of a filter when a certain plant is the true one.
///
/// z⁺ = A z + E d + Bu u + J w̃, r̃ = C z + F d, z = J e₀ at the start. For the nominal plant z = e = x - x̂; for a
/// listed one z = (x, e).
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorModel {
    /// A.
    pub a: DMatrix<f64>,
    /// E, of d.
    pub e: DMatrix<f64>,
    /// C, of the residual.
    pub c: DMatrix<f64>,
    /// F, of d.
    pub f: DMatrix<f64>,
    /// J: where a disturbance of the plant's state, and the initial error, enter.
    pub j: DMatrix<f64>,
    /// Bu, of the commands; `None` for the nominal plant, where they cancel.
    pub bu: Option<DMatrix<f64>>,
    /// w̃, length n: what d changes within a period.
    pub slew: DVector<f64>,
}

/// Gain, outputs and post-filter of the filter whose error is described.
#[derive(Clone, Copy, Debug)]
pub struct ErrorFilter<'a> {
    /// Ac of the observer error.
    pub closed: &'a DMatrix<f64>,
    /// L.
    pub gain: &'a DMatrix<f64>,
    /// C of the plant.
    pub c: &'a DMatrix<f64>,
    /// V.
    pub v: &'a DMatrix<f64>,
}

impl ErrorModel {
    /// The error when the nominal plant is true: `input`, `direct` and `slew` are Bdd, Dd and w̃ of all that counts as
    /// disturbance.
    pub fn nominal(
        filter: ErrorFilter<'_>,
        input: &DMatrix<f64>,
        direct: &DMatrix<f64>,
        slew: DVector<f64>,
    ) -> Self {
        let n = filter.closed.nrows();
        Self {
            a: filter.closed.clone(),
            e: input - filter.gain * direct,
            c: filter.v * filter.c,
            f: filter.v * direct,
            j: DMatrix::identity(n, n),
            bu: None,
            slew,
        }
    }

    /// The joint error when a listed plant is true: `input` and `slew` are its own.
    pub fn listed(
        filter: ErrorFilter<'_>,
        nominal: &SampledPlant,
        listed: &SampledPlant,
        input: &DMatrix<f64>,
        direct: &DMatrix<f64>,
        slew: DVector<f64>,
    ) -> Self {
        let n = filter.closed.nrows();
        let (zero, identity) = (DMatrix::zeros(n, n), DMatrix::identity(n, n));
        let output = filter.v * filter.c;
        Self {
            a: stacked(&[
                &beside(&[&listed.ad, &zero]),
                &beside(&[&(&listed.ad - &nominal.ad), filter.closed]),
            ]),
            e: stacked(&[input, &(input - filter.gain * direct)]),
            c: beside(&[&DMatrix::zeros(output.nrows(), n), &output]),
            f: filter.v * direct,
            j: stacked(&[&identity, &identity]),
            bu: Some(stacked(&[&listed.bud, &(&listed.bud - &nominal.bud)])),
            slew,
        }
    }

    /// The first `tested` rows of the residual.
    fn tested(&self, tested: usize) -> Self {
        Self {
            c: self.c.rows(0, tested).into_owned(),
            f: self.f.rows(0, tested).into_owned(),
            ..self.clone()
        }
    }

    /// The system from d to the residual.
    pub fn disturbance_system(&self) -> System {
        System::new(&self.a, &self.e, &self.c, &self.f)
    }

    /// The system from w̃ to the residual.
    pub fn slew_system(&self) -> System {
        let direct = DMatrix::zeros(self.c.nrows(), self.j.ncols());
        System::new(&self.a, &self.j, &self.c, &direct)
    }
}

/// w̃ of several inputs of a plant with the state matrix `a`.
pub fn within_period(
    a: &DMatrix<f64>,
    input: &DMatrix<f64>,
    slew: &DVector<f64>,
    sample_time_s: f64,
) -> DVector<f64> {
    if slew.amax() == 0.0 {
        return DVector::zeros(a.nrows());
    }
    slew_bound(a, input, slew, sample_time_s)
}

/// Which bound of d the constants are for.
#[derive(Clone, Copy, Debug)]
pub enum Driven<'a> {
    /// |d| <= d̄ at every instant.
    Amplitude(&'a DVector<f64>),
    /// Root of the energy in every window.
    Energy(f64),
}

/// Constant parts of the thresholds for one error model.
#[derive(Clone, Debug, PartialEq)]
pub struct ThresholdConstants {
    /// ρ_d, of every row of the residual.
    pub amplitude: DVector<f64>,
    /// ρ_s, of every row.
    pub slew: DVector<f64>,
    /// |C(zI - A)⁻¹ J|₁: what a disturbance of the state adds to every row.
    pub state_gain: DMatrix<f64>,
    /// γ of the tested rows.
    pub gamma: f64,
    /// μ of the tested rows.
    pub memory: f64,
    /// J_d, root energy; infinite for an unlimited window under an amplitude bound.
    pub energy: f64,
    /// J_s.
    pub slew_energy: f64,
    /// √(Ts λ_max) of the response to an initial error of norm 1.
    pub initial_gain: f64,
}

impl ThresholdConstants {
    /// The constants of a window of `window` samples whose energy counts the first `tested` rows; `None` if a response
    /// does not decay.
    pub fn new(
        model: &ErrorModel,
        driven: Driven<'_>,
        window: Option<usize>,
        tested: usize,
        sample_time_s: f64,
    ) -> Option<Self> {
        let from_state = l1_norm(&model.slew_system())?;
        let selected = model.tested(tested);
        let disturbance = selected.disturbance_system();
        let (gamma, memory) = window_gain(&disturbance, window)?;
        let length = window.map_or(f64::INFINITY, |samples| (samples as f64 * sample_time_s).sqrt());
        let amplitude = match driven {
            Driven::Amplitude(amplitude) => l1_norm(&model.disturbance_system())? * amplitude,
            Driven::Energy(energy) => {
                let system = model.disturbance_system();
                let mut bound = DVector::zeros(model.c.nrows());
                for (i, bound) in bound.iter_mut().enumerate() {
                    let row = System::new(
                        &system.a,
                        &system.b,
                        &system.c.rows(i, 1).into_owned(),
                        &system.d.rows(i, 1).into_owned(),
                    );
                    let (gamma, memory) = window_gain(&row, window)?;
                    *bound = (gamma + memory) * energy / sample_time_s.sqrt();
                }
                bound
            }
        };
        let energy = match driven {
            Driven::Amplitude(amplitude) => {
                let joint = (gamma + memory) * length * amplitude.norm();
                let mut single = 0.0;
                for (j, amplitude) in amplitude.iter().enumerate() {
                    let (gamma, memory) = window_gain(&disturbance.input(j), window)?;
                    single += (gamma + memory) * length * amplitude;
                }
                joint.min(single)
            }
            Driven::Energy(energy) => (gamma + memory) * energy,
        };
        let slew_energy = if model.slew.amax() == 0.0 {
            0.0
        } else {
            let (gamma, memory) = window_gain(&selected.slew_system(), window)?;
            (gamma + memory) * length * model.slew.norm()
        };
        let gramian = observability_gramian(&model.a, &selected.c)?;
        let initial = SingularDecomposition::new(&model.j.tr_mul(&(gramian * &model.j))).largest();
        Some(Self {
            amplitude,
            slew: &from_state * &model.slew,
            state_gain: from_state,
            gamma,
            memory,
            energy,
            slew_energy,
            initial_gain: (sample_time_s * initial).sqrt(),
        })
    }
}

/// γ and μ; μ is 0 for an unlimited window.
fn window_gain(system: &System, window: Option<usize>) -> Option<(f64, f64)> {
    let gamma = h_infinity_discrete(system).value;
    let memory = match window {
        Some(samples) => WindowConstants::new(&system.a, &system.b, &system.c, samples)?.memory,
        None => 0.0,
    };
    gamma.is_finite().then_some((gamma, memory))
}

/// What a lost sample leaves in the residual: |V C Acᵗ L V⁻¹|_ij <= c_ij r_gᵗ.
#[derive(Clone, Debug, PartialEq)]
pub struct GapEnvelope {
    /// r_g, between the spectral radius of Ac and 1.
    pub rate: f64,
    /// c, rows x rows.
    pub envelope: DMatrix<f64>,
}

impl GapEnvelope {
    /// The envelope of a filter whose residual gives r back by `inverse` (q x rows); `None` if it does not decay.
    pub fn new(filter: ErrorFilter<'_>, inverse: &DMatrix<f64>) -> Option<Self> {
        let radius = spectral_radius(filter.closed)?;
        let rate = if radius < 0.25 {
            radius.sqrt().max(0.05)
        } else {
            radius + 0.25 * (1.0 - radius)
        };
        let scaled = filter.closed / rate;
        let output = filter.v * filter.c;
        let mut response = filter.gain * inverse;
        let start = row_sums(&output) * response.amax();
        let mut power = DMatrix::<f64>::identity(scaled.nrows(), scaled.ncols());
        let mut envelope = (&output * &response).abs();
        let mut largest_power = 1.0_f64;
        for _ in 0..LONGEST {
            response = &scaled * response;
            power = &scaled * power;
            let present = (&output * &response).abs();
            envelope = envelope.zip_map(&present, f64::max);
            let norm = row_sums(&power);
            largest_power = largest_power.max(norm);
            // Every later power is a product of this one and an earlier one.
            if norm * largest_power * start <= ENVELOPE * envelope.amax().max(f64::MIN_POSITIVE)
                || start == 0.0
            {
                return Some(Self { rate, envelope });
            }
            if !norm.is_finite() {
                return None;
            }
        }
        None
    }
}

/// Largest row sum of the absolute values.
fn row_sums(matrix: &DMatrix<f64>) -> f64 {
    matrix
        .row_iter()
        .map(|row| row.iter().map(|value| value.abs()).sum())
        .fold(0.0, f64::max)
}

/// What white measurement noise adds.
#[derive(Clone, Debug, PartialEq)]
pub struct NoiseBound {
    /// ρ_n = 6 √diag(c₀), of every row.
    pub peak: DVector<f64>,
    /// J_n, of the tested rows.
    pub energy: f64,
}

impl NoiseBound {
    /// The bound for standard deviations `noise` (q) in a window of `window` samples; `None` if the filter is not
    /// stable.
    pub fn new(
        filter: ErrorFilter<'_>,
        noise: &DVector<f64>,
        window: usize,
        tested: usize,
        sample_time_s: f64,
    ) -> Option<Self> {
        let (a, l) = (filter.closed, filter.gain);
        let covariance = DMatrix::from_diagonal(&noise.component_mul(noise));
        let state = crate::lyapunov::discrete(a, &(l * &covariance * l.transpose()))?;
        let output = filter.v * filter.c;
        let present = &output * &state * output.transpose() + filter.v * &covariance * filter.v.transpose();
        let peak = present
            .diagonal()
            .map(|value| PEAK_DEVIATIONS * value.max(0.0).sqrt());
        let select = |matrix: &DMatrix<f64>| matrix.view((0, 0), (tested, tested)).into_owned();
        let present = select(&present);
        let mut carried = (a * &state * filter.c.transpose() - l * &covariance) * filter.v.transpose();
        let mut sum = window as f64 * present.norm_squared();
        for k in 1..window {
            let correlation = select(&(&output * &carried));
            sum += 2.0 * (window - k) as f64 * correlation.norm_squared();
            carried = a * carried;
        }
        let mean = sample_time_s * window as f64 * present.trace();
        let variance = 2.0 * sample_time_s * sample_time_s * sum;
        Some(Self {
            peak,
            energy: (mean + ENERGY_DEVIATIONS * variance.sqrt()).sqrt(),
        })
    }
}
