//! Numbers for people and for JSON, which knows neither NaN nor infinity.

use serde::{Serialize, Serializer};

/// A number that may be infinite or none at all.
#[derive(Clone, Copy, Debug)]
pub struct Number(pub f64);

impl Serialize for Number {
    /// NaN as null, infinite numbers as the strings `inf` and `-inf`.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.0 {
            number if number.is_nan() => serializer.serialize_none(),
            f64::INFINITY => serializer.serialize_str("inf"),
            f64::NEG_INFINITY => serializer.serialize_str("-inf"),
            number => serializer.serialize_f64(number),
        }
    }
}

impl Number {
    /// Five significant digits or so, in at most 11 characters.
    pub fn short(self) -> String {
        let magnitude = self.0.abs();
        if self.0 == 0.0 {
            "0".into()
        } else if self.0.is_nan() {
            "-".into()
        } else if self.0.is_infinite() || (1e-3..1e5).contains(&magnitude) {
            format!("{:.4}", self.0)
        } else {
            format!("{:.3e}", self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_has_null_for_none_and_strings_for_infinite_numbers() {
        let json = |number| serde_json::to_string(&Number(number)).unwrap();
        assert_eq!(json(f64::NAN), "null");
        assert_eq!(json(f64::INFINITY), r#""inf""#);
        assert_eq!(json(f64::NEG_INFINITY), r#""-inf""#);
        assert_eq!(json(-0.125), "-0.125");
    }

    #[test]
    fn short_numbers_stay_short() {
        let short = |number| Number(number).short();
        assert_eq!(short(0.0), "0");
        assert_eq!(short(f64::NAN), "-");
        assert_eq!(short(f64::INFINITY), "inf");
        assert_eq!(short(-99_999.5), "-99999.5000");
        assert_eq!(short(-1.25e-300), "-1.250e-300");
        assert_eq!(short(0.5), "0.5000");
    }
}
