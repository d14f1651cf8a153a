//! Stated against recomputed: every number of one against its twin in the other.

use toml::Value;

/// The first place at which two values differ by more than the tolerance.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Difference {
    /// Where, in words: `norms / largest gain from disturbance to residual / value`.
    pub place: String,
    /// The same as a dotted path: `norms.0.value`.
    pub key: String,
    /// What the file states.
    pub stated: String,
    /// What the gains give.
    pub recomputed: String,
}

/// Differences below this are rounding noise, which differs between processors.
const NOISE: f64 = 1e-12;

/// How far a stated pole may lie from a recomputed one, relative to the largest of the list: rounding noise moves a
/// triple pole by about 1e-5. Poles are there to be read; what depends on them is compared as closely as all else.
const POLES: f64 = 1e-4;

/// How far two numbers may lie apart.
pub(super) fn allowed(a: f64, b: f64, tolerance: f64) -> f64 {
    tolerance * a.abs().max(b.abs()) + NOISE
}

/// Compares two values part by part; `tolerance` is relative to the larger number.
pub(super) fn first_difference(stated: &Value, recomputed: &Value, tolerance: f64) -> Option<Difference> {
    at(&Place::default(), stated, recomputed, tolerance)
}

/// A place in a value.
#[derive(Default)]
struct Place {
    words: String,
    key: String,
}

impl Place {
    fn below(&self, word: &str, part: &str) -> Self {
        let join = |begin: &str, separator: &str, end: &str| match begin {
            "" => end.to_owned(),
            _ => format!("{begin}{separator}{end}"),
        };
        Self {
            words: join(&self.words, " / ", word),
            key: join(&self.key, ".", part),
        }
    }

    fn differs(&self, stated: &dyn ToString, recomputed: &dyn ToString) -> Option<Difference> {
        Some(Difference {
            place: self.words.clone(),
            key: self.key.clone(),
            stated: stated.to_string(),
            recomputed: recomputed.to_string(),
        })
    }
}

fn at(place: &Place, stated: &Value, recomputed: &Value, tolerance: f64) -> Option<Difference> {
    match (stated, recomputed) {
        (Value::Float(a), Value::Float(b)) => {
            let allowed = allowed(*a, *b, tolerance);
            let close = a == b || (allowed.is_finite() && (a - b).abs() <= allowed);
            if close { None } else { place.differs(a, b) }
        }
        (Value::Array(a), Value::Array(b)) if a.len() != b.len() => {
            let entries = |list: &[Value]| format!("{} entries", list.len());
            place.differs(&entries(a), &entries(b))
        }
        (Value::Array(a), Value::Array(b)) if is_pole_list(place) => {
            let unmatched = unmatched_pole(&complex(a), &complex(b), tolerance)?;
            place
                .below("a pole", &unmatched.to_string())
                .differs(&stated.to_string(), &recomputed.to_string())
        }
        (Value::Array(a), Value::Array(b)) => {
            let mut pairs = a.iter().zip(b).enumerate();
            pairs.find_map(|(index, (a, b))| {
                let place = place.below(&name_of(b, index), &index.to_string());
                at(&place, a, b, tolerance)
            })
        }
        (Value::Table(a), Value::Table(b)) => {
            let missing = b.iter().find(|(key, _)| !a.contains_key(*key));
            if let Some((key, value)) = missing {
                return place.below(key, key).differs(&"nothing", value);
            }
            a.iter().find_map(|(key, value)| {
                let place = place.below(key, key);
                match b.get(key) {
                    Some(other) => at(&place, value, other, tolerance),
                    None => place.differs(value, &"nothing"),
                }
            })
        }
        _ if stated == recomputed => None,
        _ => place.differs(stated, recomputed),
    }
}

/// `poles.<index>.values`.
fn is_pole_list(place: &Place) -> bool {
    place.key.starts_with("poles.") && place.key.ends_with(".values")
}

/// \[real part, imaginary part\] of each pole; not-a-number for what is none.
fn complex(list: &[Value]) -> Vec<[f64; 2]> {
    let part = |pole: &Value, index: usize| pole.get(index).and_then(Value::as_float).unwrap_or(f64::NAN);
    list.iter().map(|pole| [part(pole, 0), part(pole, 1)]).collect()
}

/// The first stated pole without a partner among as many recomputed ones. Rounding noise may change the order of
/// poles of equal modulus.
fn unmatched_pole(stated: &[[f64; 2]], recomputed: &[[f64; 2]], tolerance: f64) -> Option<usize> {
    let mut left = recomputed.to_vec();
    let largest = left
        .iter()
        .fold(0.0, |most: f64, pole| most.max(pole[0].hypot(pole[1])));
    let allowed = tolerance.max(POLES) * largest + NOISE;
    stated.iter().position(|pole| {
        let distance = |other: &[f64; 2]| (pole[0] - other[0]).hypot(pole[1] - other[1]);
        let nearest = left
            .iter()
            .enumerate()
            .min_by(|a, b| distance(a.1).total_cmp(&distance(b.1)));
        match nearest.map(|(index, other)| (index, distance(other))) {
            Some((index, gap)) if gap <= allowed => {
                left.swap_remove(index);
                false
            }
            _ => true,
        }
    })
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
        assert_eq!(difference.key, "norms.0.value");
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
    fn poles_are_compared_in_any_order_and_a_moved_one_is_named() {
        let stated = value("poles = [{ name = \"F\", values = [[0.5, 0.0], [-0.5, 0.0], [1e-17, 0.0]] }]");
        let same = value("poles = [{ name = \"F\", values = [[-0.5, 0.0], [0.5, 0.0], [-1e-9, 0.0]] }]");
        let moved = value("poles = [{ name = \"F\", values = [[-0.5, 0.0], [0.51, 0.0], [0.0, 0.0]] }]");
        assert_eq!(first_difference(&stated, &same, 1e-6), None);
        let difference = first_difference(&stated, &moved, 1e-6).unwrap();
        assert_eq!(difference.key, "poles.0.values.0");
        let twice = value("poles = [{ name = \"F\", values = [[0.5, 0.0], [0.5, 0.0], [0.0, 0.0]] }]");
        assert!(first_difference(&stated, &twice, 1e-6).is_some());
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
