//! "Did you mean".

/// Words less alike than this are no suggestion (0: nothing in common, 1: equal).
const LIKENESS: f64 = 0.55;

/// A help text for a word that is not one of `known`: the most similar one, and all of them.
pub(super) fn did_you_mean(word: &str, known: &[impl AsRef<str>], what: &str) -> String {
    let all: Vec<_> = known.iter().map(|known| format!("`{}`", known.as_ref())).collect();
    let list = format!("{what}: {}", all.join(", "));
    match closest(word, known) {
        Some(closest) => format!("did you mean `{closest}`? {list}"),
        None => list,
    }
}

fn closest<'k>(word: &str, known: &'k [impl AsRef<str>]) -> Option<&'k str> {
    let likeness = |known: &str| {
        strsim::normalized_damerau_levenshtein(&word.to_lowercase(), &known.to_lowercase())
    };
    known
        .iter()
        .map(|known| (likeness(known.as_ref()), known.as_ref()))
        .filter(|(likeness, _)| *likeness >= LIKENESS)
        .max_by(|left, right| left.0.total_cmp(&right.0))
        .map(|(_, known)| known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_most_similar_word_is_suggested_and_none_when_nothing_is_alike() {
        assert_eq!(closest("perod", &["priority", "period", "phase"]), Some("period"));
        assert_eq!(closest("c", &["B", "C"]), Some("C"));
        assert_eq!(closest("wheels", &["period", "phase"]), None);
    }
}
