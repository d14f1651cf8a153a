//! The length of a window as it is written: seconds, or `"cumulative"` for one that never ends.

use serde::{Deserializer, Serializer, de};
use std::fmt;

const CUMULATIVE: &str = "cumulative";

pub(super) fn serialize<S: Serializer>(window: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if *window == f64::INFINITY {
        serializer.serialize_str(CUMULATIVE)
    } else {
        serializer.serialize_f64(*window)
    }
}

pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    deserializer.deserialize_any(Window)
}

struct Window;

impl de::Visitor<'_> for Window {
    type Value = f64;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "a number of seconds or \"{CUMULATIVE}\"")
    }

    fn visit_f64<E: de::Error>(self, seconds: f64) -> Result<f64, E> {
        Ok(seconds)
    }

    fn visit_i64<E: de::Error>(self, seconds: i64) -> Result<f64, E> {
        Ok(seconds as f64)
    }

    fn visit_u64<E: de::Error>(self, seconds: u64) -> Result<f64, E> {
        Ok(seconds as f64)
    }

    fn visit_str<E: de::Error>(self, text: &str) -> Result<f64, E> {
        if text == CUMULATIVE {
            Ok(f64::INFINITY)
        } else {
            Err(E::invalid_value(de::Unexpected::Str(text), &self))
        }
    }
}
