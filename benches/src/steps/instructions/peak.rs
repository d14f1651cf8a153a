//! The most floating-point operations in a second that this processor does of each class, measured.

#[cfg(target_arch = "x86_64")]
mod x86_64;

#[cfg(target_arch = "x86_64")]
pub use x86_64::peaks;

use super::operations::Class;

/// The peak of one class.
#[derive(Clone, Copy, Debug)]
pub struct Peak {
    /// The class.
    pub class: Class,
    /// Floating-point operations in a second.
    pub per_second: f64,
}

/// Only the vector instructions of x86-64 are known here.
#[cfg(not(target_arch = "x86_64"))]
pub fn peaks(_quick: bool) -> Option<Vec<Peak>> {
    None
}
