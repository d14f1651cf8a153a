//! Work on vectors of eight numbers, in the widest registers that the processor has.
//!
//! The work is written once and compiled for one register of eight numbers, two of four, and plain code. All three
//! do the same additions and multiplications in the same order, and none contracts them to fused operations, so
//! that every processor gives the same bits.

#[cfg(target_arch = "x86_64")]
use pulp::{Arch, NullaryFnOnce, x86::V3_512b};
use pulp::{Scalar512b, Simd, cast};

/// Numbers in a vector.
pub(crate) const LANES: usize = 8;

/// The numbers of a vector, in memory.
pub(crate) type Lanes = [f64; LANES];

/// Something to do with vectors of [`LANES`] numbers. Everything that `run` calls must be `#[inline(always)]`.
pub(crate) trait Work {
    type Output;

    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Does the work.
#[inline]
pub(crate) fn vectorised<W: Work>(work: W) -> W::Output {
    #[cfg(target_arch = "x86_64")]
    match Arch::new() {
        Arch::V4(simd) => return simd.vectorize(With { work, simd }),
        Arch::V3(simd) => {
            return simd.vectorize(With {
                work,
                simd: V3_512b(simd),
            });
        }
        _ => {}
    }
    work.run(Scalar512b)
}

/// A work with the proof that its instructions exist.
#[cfg(target_arch = "x86_64")]
struct With<W, S> {
    work: W,
    simd: S,
}

#[cfg(target_arch = "x86_64")]
impl<W: Work, S: Simd> NullaryFnOnce for With<W, S> {
    type Output = W::Output;

    #[inline(always)]
    fn call(self) -> W::Output {
        self.work.run(self.simd)
    }
}

/// A vector from memory.
#[inline(always)]
pub(crate) fn load<S: Simd>(lanes: &Lanes) -> S::f64s {
    cast(*lanes)
}

/// The numbers of a vector.
#[inline(always)]
pub(crate) fn lanes_of<S: Simd>(vector: S::f64s) -> Lanes {
    cast(vector)
}

/// |x| of every number.
#[inline(always)]
pub(crate) fn absolute<S: Simd>(simd: S, vector: S::f64s) -> S::f64s {
    simd.and_f64s(vector, simd.splat_f64s(f64::from_bits(!(1 << 63))))
}

/// Does a work on every instruction set.
#[cfg(test)]
pub(crate) fn on_every_set<W: Work>(work: impl Fn() -> W, mut check: impl FnMut(W::Output, &str)) {
    check(work().run(Scalar512b), "in plain code");
    check(vectorised(work()), "in the widest vectors");
    #[cfg(target_arch = "x86_64")]
    if let Some(simd) = pulp::x86::V3::try_new() {
        check(work().run(V3_512b(simd)), "in vectors of four");
    }
}
