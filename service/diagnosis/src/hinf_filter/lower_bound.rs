//! What no discrete gain can undercut: a true lower bound of inf_L ‖T_rd‖∞.
//!
//! | symbol | shape | meaning |
//! |---|---|---|
//! | Q, S, R | | Bdd Bdd', Bdd Dd', Dd Dd' |
//! | M(Π) | n + q | \[\[Ad Π Ad' + Q - Π, Ad Π C' + S\], \[·, C Π C' + R\]\] |
//! | P | n x n | P = Ac P Ac' + W, W what a perturbation adds to the noise of the error |
//!
//! Let M(Π) ⪰ 0, L any gain with a stable Ac = Ad - LC, and E = Ac E Ac' + (Bdd - L Dd)(Bdd - L Dd)'. Then
//! \[I, -L\] M(Π) \[I, -L\]' ⪰ 0 says E - Π ⪰ Ac (E - Π) Ac', so E ⪰ Π, and with it
//! ‖T_rd‖∞² I ⪰ C E C' + R ⪰ C Π C' + R. So λ_max(C Π C' + R) bounds ‖T_rd‖∞² from below for every such Π; the largest of
//! them is the stabilising solution of the Riccati equation (method sheet 3.2), for which it is the infimum.
//!
//! That solution need not exist (R singular, poles on the unit circle), and where noise was added to make it exist its Ω is
//! too large. So the solution of the perturbed problem is only a start: it is lowered until M(Π) is proved positive.

use super::{
    conditions::scaled_margin,
    plant::{SampledPlant, beside, stacked},
};
use crate::{
    decomposition::SingularDecomposition,
    lyapunov,
    riccati::{Covariances, dare},
};
use nalgebra::DMatrix;

/// Added noise relative to σ_max(Dd): the smaller, the closer to the infimum, unless the equation fails.
const PERTURBATIONS: [f64; 6] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7];
/// The same relative to σ_max(Bdd) as a part of that: less where the disturbance reaches the outputs late.
const PROCESS: [f64; 3] = [1.0, 1e-2, 1e-4];
/// Multiples of P by which Π is lowered: 1 + 1e-3 · 2ᵏ for k below this.
const LOWERINGS: i32 = 14;

/// The largest √λ_max(C Π C' + R) that was proved, no less than σ_max(Dd) (Π = 0). No gain has a smaller ‖T_rd‖∞.
pub fn discrete_lower_bound(sampled: &SampledPlant, c: &DMatrix<f64>, dd: &DMatrix<f64>) -> f64 {
    let problem = Problem {
        a: &sampled.ad,
        c,
        q: &sampled.bdd * sampled.bdd.transpose(),
        s: &sampled.bdd * dd.transpose(),
        r: dd * dd.transpose(),
    };
    let (input, direct) = (size(&sampled.bdd), size(dd));
    let noise = if direct > 0.0 { direct } else { input };
    let pairs = PERTURBATIONS
        .iter()
        .flat_map(|part| PROCESS.map(|process| (part * process * input, part * noise)));
    pairs
        .filter_map(|(process, noise)| problem.proved(process, noise))
        .fold(direct, f64::max)
}

fn size(matrix: &DMatrix<f64>) -> f64 {
    SingularDecomposition::new(matrix).largest()
}

struct Problem<'a> {
    a: &'a DMatrix<f64>,
    c: &'a DMatrix<f64>,
    q: DMatrix<f64>,
    s: DMatrix<f64>,
    r: DMatrix<f64>,
}

impl Problem<'_> {
    /// What the solution with this much more noise proves, lowered no more than necessary.
    fn proved(&self, process: f64, noise: f64) -> Option<f64> {
        let (n, q) = (self.a.nrows(), self.c.nrows());
        let (process, noise) = (
            DMatrix::identity(n, n) * (process * process),
            DMatrix::identity(q, q) * (noise * noise),
        );
        let (more_q, more_r) = (&self.q + &process, &self.r + &noise);
        let perturbed = Covariances {
            q: &more_q,
            s: &self.s,
            r: &more_r,
        };
        let solution = dare(self.a, self.c, perturbed).ok()?;
        let gain = &solution.gain;
        let closed = self.a - gain * self.c;
        // \[I, -L\] diag(added noise) \[I, -L\]': lowering by P makes up for it, to first order.
        let excess = lyapunov::discrete(&closed, &(process + gain * noise * gain.transpose()))?;
        (0..LOWERINGS).find_map(|doublings| {
            let pi = &solution.pi - &excess * (1.0 + 1e-3 * 2.0_f64.powi(doublings));
            let pi = (&pi + pi.transpose()) / 2.0;
            self.holds(&pi)
                .then(|| size(&(self.c * pi * self.c.transpose() + &self.r)).sqrt())
        })
    }

    /// Whether M(Π) ⪰ 0 beyond the rounding errors of its terms.
    fn holds(&self, pi: &DMatrix<f64>) -> bool {
        let (n, q) = (self.a.nrows(), self.c.nrows());
        let propagated = self.a * pi;
        let cross = &propagated * self.c.transpose() + &self.s;
        let matrix = stacked(&[
            &beside(&[&(&propagated * self.a.transpose() + &self.q - pi), &cross]),
            &beside(&[&cross.transpose(), &(self.c * pi * self.c.transpose() + &self.r)]),
        ]);
        let (a, c, absolute) = (self.a.abs(), self.c.abs(), pi.abs());
        let states = &a * &absolute * a.transpose() + self.q.abs() + &absolute;
        let outputs = &c * &absolute * c.transpose() + self.r.abs();
        let terms = states
            .diagonal()
            .iter()
            .chain(outputs.diagonal().iter())
            .copied()
            .collect::<Vec<_>>();
        let cancelled = terms
            .iter()
            .enumerate()
            .fold(0.0_f64, |most, (i, term)| most.max(term / matrix[(i, i)]));
        let order = (n + q) as f64;
        scaled_margin(&((&matrix + matrix.transpose()) / 2.0)) >= order * order * f64::EPSILON * cancelled
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::dmatrix;

    fn sampled(ad: f64, bdd: f64) -> SampledPlant {
        SampledPlant {
            ad: dmatrix![ad],
            bdd: dmatrix![bdd],
            bud: DMatrix::zeros(1, 0),
            bfd: DMatrix::zeros(1, 0),
            sample_time_s: 1.0,
        }
    }

    /// T = d + c b/(z - a) with the zero z₀ = a - cb/d: the infimum is |d| if |z₀| <= 1, and |d z₀| otherwise.
    #[test]
    fn the_bound_of_a_first_order_plant_is_its_infimum() {
        for (a, b, d) in [
            (0.5, 0.1, 1.0),
            (0.5, -1.0, 0.1),
            (0.9, 1.0, 1e-3),
            (1.2, -1.0, 1e-5),
            (0.3, 1.0, 0.0),
        ] {
            let infimum = if d == 0.0 {
                b
            } else {
                d * f64::max(1.0, f64::abs(a - b / d))
            };
            let bound = discrete_lower_bound(&sampled(a, b), &dmatrix![1.0], &dmatrix![d]);
            assert!(bound <= infimum * (1.0 + 1e-12), "{a} {b} {d}: {bound} {infimum}");
            assert!(bound >= infimum * (1.0 - 1e-6), "{a} {b} {d}: {bound} {infimum}");
        }
    }
}
