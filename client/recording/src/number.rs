//! Floating-point numbers in JSON, back and forth without the loss of a bit.
//!
//! | number | JSON |
//! |---|---|
//! | finite | the shortest decimal number that is read as the same bits; `-0.0` for the negative zero |
//! | infinite | the string `"inf"` or `"-inf"` |
//! | NaN, as processors and [`f64::NAN`] make it | `null` |
//! | NaN with other bits | the string `"nan:"` and its bits, 16 hexadecimal digits |

use std::fmt;

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// What stands before the bits of an unusual NaN.
const NAN_BITS: &str = "nan:";

/// A number that is written to JSON and read back with all its bits.
#[derive(Clone, Copy, Debug)]
pub struct Number(pub f64);

impl Serialize for Number {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            f64::INFINITY => serializer.serialize_str("inf"),
            f64::NEG_INFINITY => serializer.serialize_str("-inf"),
            number if number.to_bits() == f64::NAN.to_bits() => serializer.serialize_none(),
            number if number.is_nan() => {
                serializer.collect_str(&format_args!("{NAN_BITS}{:016x}", number.to_bits()))
            }
            number => serializer.serialize_f64(number),
        }
    }
}

impl<'de> Deserialize<'de> for Number {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(NumberVisitor).map(Self)
    }
}

struct NumberVisitor;

impl Visitor<'_> for NumberVisitor {
    type Value = f64;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a number, null, \"inf\", \"-inf\", or \"nan:\" with 16 hexadecimal digits")
    }

    fn visit_f64<E: Error>(self, number: f64) -> Result<f64, E> {
        Ok(number)
    }

    fn visit_i64<E: Error>(self, number: i64) -> Result<f64, E> {
        Ok(number as f64)
    }

    fn visit_u64<E: Error>(self, number: u64) -> Result<f64, E> {
        Ok(number as f64)
    }

    fn visit_unit<E: Error>(self) -> Result<f64, E> {
        Ok(f64::NAN)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<f64, E> {
        let bits = |digits| u64::from_str_radix(digits, 16).ok().map(f64::from_bits);
        match text {
            "inf" => Some(f64::INFINITY),
            "-inf" => Some(f64::NEG_INFINITY),
            _ => text
                .strip_prefix(NAN_BITS)
                .and_then(bits)
                .filter(|number| number.is_nan()),
        }
        .ok_or_else(|| E::invalid_value(Unexpected::Str(text), &self))
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng as _, SeedableRng as _};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    fn there_and_back(bits: u64) -> u64 {
        let json = serde_json::to_vec(&Number(f64::from_bits(bits))).unwrap();
        let back: Number = serde_json::from_slice(&json).unwrap();
        back.0.to_bits()
    }

    #[test]
    fn every_bit_pattern_comes_back() {
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let special = [
            0.0,
            -0.0,
            f64::NAN,
            -f64::NAN,
            f64::MIN_POSITIVE,
            f64::MAX,
            f64::INFINITY,
        ];
        let special = special.into_iter().flat_map(|number| [number, -number]);
        let subnormal = (0..10_000).map(|_| random.next_u64() >> 12);
        let subnormal: Vec<u64> = subnormal.collect();
        let any = (0..1_000_000).map(|_| random.next_u64());
        for bits in special.map(f64::to_bits).chain(subnormal).chain(any) {
            assert_eq!(there_and_back(bits), bits, "{bits:016x}");
        }
    }

    #[test]
    fn what_is_no_number_has_its_documented_form() {
        let json = |number| serde_json::to_string(&Number(number)).unwrap();
        assert_eq!(json(f64::NAN), "null");
        assert_eq!(json(f64::INFINITY), r#""inf""#);
        assert_eq!(json(f64::NEG_INFINITY), r#""-inf""#);
        assert_eq!(
            json(f64::from_bits(0xfff8_0000_0000_0000)),
            r#""nan:fff8000000000000""#
        );
        assert_eq!(json(-0.0), "-0.0");
    }

    #[test]
    fn anything_else_is_refused() {
        for json in [
            r#""Inf""#,
            r#""nan:zz""#,
            r#""nan:3ff0000000000000""#,
            r#""1.5""#,
            "true",
            "[1]",
        ] {
            assert!(serde_json::from_str::<Number>(json).is_err(), "{json}");
        }
        assert_eq!(serde_json::from_str::<Number>("7").unwrap().0, 7.0);
    }
}
