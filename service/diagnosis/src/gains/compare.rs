//! Stated against recomputed: every number of one against its twin in the other.

use toml::Value;

/// The first place at which two values differ by more than the tolerance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Difference {
    /// Where, in words: `norms / largest gain from disturbance to residual / value`.
    pub place: String,
    /// What the file states.
    pub stated: String,
    /// What the gains give.
    pub recomputed: String,
}

/// Numbers below this are as good as zero: rounding noise differs between machines.
const NEGLIGIBLE: f64 = 1e-9;

/// Compares two values part by part; `tolerance` is relative to the larger number.
pub(super) fn first_difference(stated: &Value, recomputed: &Value, tolerance: f64) -> Option<Difference> {
    at("", stated, recomputed, tolerance)
}

fn at(place: &str, stated: &Value, recomputed: &Value, tolerance: f64) -> Option<Difference> {
    let differs = |stated: &Value, recomputed: &Value| {
        Some(Difference {
            place: place.to_owned(),
            stated: stated.to_string(),
            recomputed: recomputed.to_string(),
        })
    };
    match (stated, recomputed) {
        (Value::Float(a), Value::Float(b)) => {
            let allowed = tolerance * (a.abs().max(b.abs()) + NEGLIGIBLE);
            let close = a == b || (allowed.is_finite() && (a - b).abs() <= allowed);
            if close { None } else { differs(stated, recomputed) }
        }
        (Value::Array(a), Value::Array(b)) => {
            if a.len() != b.len() {
                return Some(Difference {
                    place: place.to_owned(),
                    stated: format!("{} entries", a.len()),
                    recomputed: format!("{} entries", b.len()),
                });
            }
            let pairs = a.iter().zip(b).enumerate();
            pairs
                .filter_map(|(index, (a, b))| at(&below(place, &name_of(b, index)), a, b, tolerance))
                .next()
        }
        (Value::Table(a), Value::Table(b)) => {
            let missing = |present: &toml::Table, absent: &toml::Table| {
                present.keys().find(|key| !absent.contains_key(*key)).cloned()
            };
            if let Some(key) = missing(a, b) {
                return Some(Difference {
                    place: below(place, &key),
                    stated: a[&key].to_string(),
                    recomputed: "nothing".to_owned(),
                });
            }
            if let Some(key) = missing(b, a) {
                return Some(Difference {
                    place: below(place, &key),
                    stated: "nothing".to_owned(),
                    recomputed: b[&key].to_string(),
                });
            }
            a.iter()
                .filter_map(|(key, a)| at(&below(place, key), a, &b[key], tolerance))
                .next()
        }
        _ if stated == recomputed => None,
        _ => differs(stated, recomputed),
    }
}

fn below(place: &str, part: &str) -> String {
    match place {
        "" => part.to_owned(),
        _ => format!("{place} / {part}"),
    }
}

/// Entries of lists are known by name where they have one.
fn name_of(entry: &Value, index: usize) -> String {
    ["name", "fault", "channel"]
        .iter()
        .find_map(|key| entry.get(key)?.as_str())
        .map_or_else(|| (index + 1).to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Value {
        Value::Table(text.parse().unwrap())
    }

    #[test]
    fn numbers_within_the_tolerance_are_equal_and_others_are_named() {
        let stated = value("norms = [{ name = \"T_rd\", value = 0.0282 }]");
        let close = value("norms = [{ name = \"T_rd\", value = 0.02820000001 }]");
        let far = value("norms = [{ name = \"T_rd\", value = 0.0350 }]");
        assert_eq!(first_difference(&stated, &close, 1e-6), None);
        let difference = first_difference(&stated, &far, 1e-6).unwrap();
        assert_eq!(difference.place, "norms / T_rd / value");
        assert_eq!(
            (difference.stated.as_str(), difference.recomputed.as_str()),
            ("0.0282", "0.035")
        );
    }

    #[test]
    fn a_number_that_is_not_one_differs_from_everything_but_infinity_from_finite_only() {
        for (stated, recomputed, equal) in
            [("nan", "nan", false), ("nan", "1.0", false), ("inf", "inf", true)]
        {
            let found = first_difference(
                &value(&format!("x = {stated}")),
                &value(&format!("x = {recomputed}")),
                1e-6,
            );
            assert_eq!(found.is_none(), equal, "{stated} {recomputed}");
        }
        assert!(first_difference(&value("x = inf"), &value("x = 1.0"), 1e-6).is_some());
    }

    #[test]
    fn entries_that_only_one_side_has_are_named() {
        let with = value("poles = [[0.5, 0.0]]\nnorm = 1.0");
        let without = value("poles = [[0.5, 0.0]]");
        assert_eq!(first_difference(&with, &without, 1e-6).unwrap().place, "norm");
        assert_eq!(first_difference(&without, &with, 1e-6).unwrap().stated, "nothing");
        let longer = value("poles = [[0.5, 0.0], [0.1, 0.0]]");
        assert_eq!(
            first_difference(&longer, &without, 1e-6).unwrap().stated,
            "2 entries"
        );
    }
}
