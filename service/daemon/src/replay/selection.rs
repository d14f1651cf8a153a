//! Which runs of a recording are replayed.

/// Which runs of a recording to take: `all`, `odd`, `even` (by position, counted from 1), or names separated by
/// commas.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunSelection {
    /// Every run.
    All,
    /// The first, third, fifth … run.
    Odd,
    /// The second, fourth, sixth … run.
    Even,
    /// The runs with these names.
    Named(Vec<String>),
}

impl std::str::FromStr for RunSelection {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "all" => Self::All,
            "odd" => Self::Odd,
            "even" => Self::Even,
            names => Self::Named(names.split(',').map(|name| name.trim().into()).collect()),
        })
    }
}

impl RunSelection {
    /// Whether the run at `position` (from 0) with this name is taken.
    pub fn takes(&self, position: usize, name: &str) -> bool {
        match self {
            Self::All => true,
            Self::Odd => position.is_multiple_of(2),
            Self::Even => !position.is_multiple_of(2),
            Self::Named(names) => names.iter().any(|wanted| wanted == name),
        }
    }

    /// The first name that no run has.
    pub fn unknown<'a>(&'a self, runs: &[&str]) -> Option<&'a str> {
        match self {
            Self::Named(names) => names.iter().map(String::as_str).find(|name| !runs.contains(name)),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_takes_by_position_or_name() {
        let odd: RunSelection = "odd".parse().unwrap();
        assert!(odd.takes(0, "1") && !odd.takes(1, "2"));
        let named: RunSelection = "3, x".parse().unwrap();
        assert!(named.takes(9, "x") && !named.takes(0, "1"));
        assert_eq!(named.unknown(&["x", "3"]), None);
        assert_eq!(named.unknown(&["x", "4"]), Some("3"));
        assert_eq!(odd.unknown(&[]), None);
    }
}
