//! Texts that the caller owns.

use std::ffi::c_char;

/// Bytes of a residual_text.
pub const RESIDUAL_TEXT_BYTES: usize = 257;

/// A name or unit: UTF-8 of at most 256 bytes and a zero byte behind them.
#[repr(C)]
#[derive(Clone, Copy)]
pub struct residual_text {
    /// The text.
    pub bytes: [c_char; RESIDUAL_TEXT_BYTES],
}

impl residual_text {
    /// A copy of `text`. The table's texts are not longer than there is room.
    pub(crate) fn new(text: &str) -> Self {
        let mut bytes = [0; RESIDUAL_TEXT_BYTES];
        for (place, byte) in bytes[..RESIDUAL_TEXT_BYTES - 1].iter_mut().zip(text.bytes()) {
            *place = byte as c_char;
        }
        Self { bytes }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_ends_with_a_zero_byte_however_long_it_is() {
        let long = residual_text::new(&"x".repeat(300)).bytes;
        assert_eq!((long[255], long[256]), (b'x' as c_char, 0));
        let umlaut = residual_text::new("ü").bytes;
        assert_eq!(
            [umlaut[0], umlaut[1], umlaut[2]].map(|byte| byte as u8),
            [0xc3, 0xbc, 0]
        );
    }
}
