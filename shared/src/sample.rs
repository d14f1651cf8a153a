//! A sensor sample as it travels over iceoryx2: a slice of `f64` with this header as user header.
//!
//! Other languages match the type by name and layout, for example in Python:
//!
//! ```python
//! class SampleHeader(ctypes.Structure):
//!     _fields_ = [("sequence", ctypes.c_uint64), ("timestamp_ns", ctypes.c_uint64)]
//!     @staticmethod
//!     def type_name() -> str: return "residual.SampleHeader.v1"
//! ```

use iceoryx2::prelude::ZeroCopySend;

/// User header of a sample; the payload is `[f64]`, one element per signal of the input.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("residual.SampleHeader.v1")]
pub struct SampleHeader {
    /// Number of the sample, rising by 1 per sample of one publisher; a step above 1 is a known loss.
    pub sequence: u64,
    /// When the sample was taken, nanoseconds of the daemon's time (CLOCK_MONOTONIC unless replayed faster).
    pub timestamp_ns: u64,
}
