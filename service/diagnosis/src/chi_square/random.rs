//! The generator of the calibration: the same numbers on every machine, whatever libraries it has.

/// Uniform 64-bit words: xoshiro256++ of Blackman and Vigna, seeded by their splitmix64.
#[derive(Clone, Debug)]
pub(super) struct Random {
    state: [u64; 4],
}

impl Random {
    pub fn new(seed: u64) -> Self {
        let mut counter = seed;
        let mut word = || {
            counter = counter.wrapping_add(0x9E37_79B9_7F4A_7C15);
            let mut z = counter;
            z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
            z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
            z ^ (z >> 31)
        };
        Self {
            state: [word(), word(), word(), word()],
        }
    }

    fn word(&mut self) -> u64 {
        let [a, b, c, d] = &mut self.state;
        let result = a.wrapping_add(*d).rotate_left(23).wrapping_add(*a);
        let shifted = *b << 17;
        *c ^= *a;
        *d ^= *b;
        *b ^= *c;
        *a ^= *d;
        *c ^= shifted;
        *d = d.rotate_left(45);
        result
    }

    /// Uniform in (0, 1).
    fn uniform(&mut self) -> f64 {
        ((self.word() >> 12) as f64 + 0.5) / (1_u64 << 52) as f64
    }

    /// Standard normal: the ratio of uniforms with the quadratic bounds of Leva (ACM TOMS 18, 1992).
    ///
    /// The value is a quotient of exact numbers, so that no library's logarithm can change its last bit; one is
    /// only asked in 1 % of the draws whether to accept.
    pub fn normal(&mut self) -> f64 {
        loop {
            let u = self.uniform();
            let v = 1.715_527_769_921_413_5 * (self.uniform() - 0.5);
            let x = u - 0.449_871;
            let y = v.abs() + 0.386_595;
            let q = x * x + y * (0.196 * y - 0.254_72 * x);
            if q < 0.275_97 || (q <= 0.278_46 && v * v <= -4.0 * u.ln() * u * u) {
                return v / u;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chi_square::chi_square_upper_quantile;

    #[test]
    fn the_first_words_are_those_of_the_published_generator() {
        let mut random = Random { state: [1, 2, 3, 4] };
        let words: [u64; 4] = std::array::from_fn(|_| random.word());
        assert_eq!(
            words,
            [
                41_943_041,
                58_720_359,
                3_588_806_011_781_223,
                3_591_011_842_654_386
            ]
        );
    }

    #[test]
    fn normal_numbers_have_the_moments_and_tails_of_the_normal_distribution() {
        let mut random = Random::new(1);
        let count = 200_000;
        let mut moments = [0.0; 4];
        let tails =
            [0.1, 0.01, 0.001].map(|probability| (probability, chi_square_upper_quantile(probability, 1)));
        let mut beyond = [0.0; 3];
        for _ in 0..count {
            let x = random.normal();
            for (order, moment) in moments.iter_mut().enumerate() {
                *moment += x.powi(order as i32 + 1) / count as f64;
            }
            for (number, (_, limit)) in beyond.iter_mut().zip(tails) {
                *number += f64::from(u8::from(x * x > limit)) / count as f64;
            }
        }
        // Standard errors of the moments: sqrt(1, 2, 15, 96) / sqrt(count); four of them.
        for ((moment, expected), variance) in moments
            .iter()
            .zip([0.0, 1.0, 0.0, 3.0])
            .zip([1.0, 2.0, 15.0, 96.0_f64])
        {
            assert!(
                (moment - expected).abs() < 4.0 * (variance / count as f64).sqrt(),
                "{moments:?}"
            );
        }
        for (rate, (probability, _)) in beyond.iter().zip(tails) {
            let error = (probability * (1.0 - probability) / count as f64).sqrt();
            assert!((rate - probability).abs() < 4.0 * error, "{rate} {probability}");
        }
    }
}
