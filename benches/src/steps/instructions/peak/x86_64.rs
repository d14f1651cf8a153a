//! Kernels that stay in registers: fourteen numbers (or vectors) without dependence on each other, one operation after
//! the other.
//!
//! `pulp` offers the processor's instructions behind a token that proves their presence, so that no unsafe code is
//! needed.

use std::arch::x86_64::{__m128d, __m256d};
use std::hint::black_box;
use std::time::{Duration, Instant};

use pulp::x86::V3;

use super::super::operations::{Class, Kind};
use super::Peak;

/// Rounds of a kernel between two looks at the clock: shorter than the turn of a process on a busy machine.
const ROUNDS: u64 = 10_000;

/// Independent chains: as many as fit into the registers, to hide the latency of the operations.
const CHAINS: usize = 14;

/// The peaks of all classes; `None` on a processor without AVX2 and FMA.
pub fn peaks(quick: bool) -> Option<Vec<Peak>> {
    let simd = V3::try_new()?;
    let kernels: [(Class, fn(V3)); 12] = [
        ((Kind::AddMultiply, 1), scalar::add_multiply),
        ((Kind::AddMultiply, 2), packed_128::add_multiply),
        ((Kind::AddMultiply, 4), packed_256::add_multiply),
        ((Kind::Fused, 1), scalar::fused),
        ((Kind::Fused, 2), packed_128::fused),
        ((Kind::Fused, 4), packed_256::fused),
        ((Kind::Divide, 1), scalar::divide),
        ((Kind::Divide, 2), packed_128::divide),
        ((Kind::Divide, 4), packed_256::divide),
        ((Kind::Root, 1), scalar::root),
        ((Kind::Root, 2), packed_128::root),
        ((Kind::Root, 4), packed_256::root),
    ];
    let repetitions = if quick { 300 } else { 2000 };
    let peak = |(class, kernel): (Class, fn(V3))| Peak {
        class,
        per_second: operations(class) as f64 / fastest(simd, kernel, repetitions).as_secs_f64(),
    };
    Some(kernels.into_iter().map(peak).collect())
}

fn operations((kind, lanes): Class) -> u64 {
    ROUNDS * CHAINS as u64 * lanes * kind.operations()
}

fn fastest(simd: V3, kernel: fn(V3), repetitions: usize) -> Duration {
    let time = || {
        let begin = Instant::now();
        kernel(simd);
        begin.elapsed()
    };
    (0..repetitions).map(|_| time()).min().unwrap_or(Duration::MAX)
}

/// The four kernels on one kind of vector; numbers stay near 1, so that no operation is slow for its operands.
macro_rules! kernels {
    ($module:ident, $vector:ty, $splat:expr, $add:expr, $multiply:expr, $fused:expr, $divide:expr, $root:expr) => {
        mod $module {
            use super::*;

            fn run(simd: V3, operation: impl Fn(V3, usize, $vector, $vector, $vector) -> $vector) {
                simd.vectorize(
                    #[inline(always)]
                    || {
                        let splat = $splat;
                        let (one, none) = (splat(simd, black_box(1.0)), splat(simd, black_box(0.0)));
                        let mut chains: [$vector; CHAINS] = [splat(simd, black_box(1.5)); CHAINS];
                        for _ in 0..ROUNDS {
                            for (place, chain) in chains.iter_mut().enumerate() {
                                *chain = operation(simd, place, *chain, one, none);
                            }
                        }
                        black_box(chains);
                    },
                );
            }

            pub fn add_multiply(simd: V3) {
                run(
                    simd,
                    #[inline(always)]
                    |simd, place, chain, one, none| match place % 2 {
                        0 => $add(simd, chain, none),
                        _ => $multiply(simd, chain, one),
                    },
                );
            }

            pub fn fused(simd: V3) {
                run(
                    simd,
                    #[inline(always)]
                    |simd, _, chain, one, none| $fused(simd, chain, one, none),
                );
            }

            pub fn divide(simd: V3) {
                run(
                    simd,
                    #[inline(always)]
                    |simd, _, chain, one, _| $divide(simd, chain, one),
                );
            }

            pub fn root(simd: V3) {
                run(
                    simd,
                    #[inline(always)]
                    |simd, _, chain, _, _| $root(simd, chain),
                );
            }
        }
    };
}

kernels!(
    scalar,
    __m128d,
    |simd: V3, number| simd.sse2._mm_set1_pd(number),
    |simd: V3, a, b| simd.sse2._mm_add_sd(a, b),
    |simd: V3, a, b| simd.sse2._mm_mul_sd(a, b),
    |simd: V3, a, b, c| simd.fma._mm_fmadd_sd(a, b, c),
    |simd: V3, a, b| simd.sse2._mm_div_sd(a, b),
    |simd: V3, a| simd.sse2._mm_sqrt_sd(a, a)
);

kernels!(
    packed_128,
    __m128d,
    |simd: V3, number| simd.sse2._mm_set1_pd(number),
    |simd: V3, a, b| simd.sse2._mm_add_pd(a, b),
    |simd: V3, a, b| simd.sse2._mm_mul_pd(a, b),
    |simd: V3, a, b, c| simd.fma._mm_fmadd_pd(a, b, c),
    |simd: V3, a, b| simd.sse2._mm_div_pd(a, b),
    |simd: V3, a| simd.sse2._mm_sqrt_pd(a)
);

kernels!(
    packed_256,
    __m256d,
    |simd: V3, number| simd.avx._mm256_set1_pd(number),
    |simd: V3, a, b| simd.avx._mm256_add_pd(a, b),
    |simd: V3, a, b| simd.avx._mm256_mul_pd(a, b),
    |simd: V3, a, b, c| simd.fma._mm256_fmadd_pd(a, b, c),
    |simd: V3, a, b| simd.avx._mm256_div_pd(a, b),
    |simd: V3, a| simd.avx._mm256_sqrt_pd(a)
);
