//! OpenMetrics text as the older text format of Prometheus, version 0.0.4, which tools without OpenMetrics read.
//!
//! | OpenMetrics | version 0.0.4 |
//! |---|---|
//! | comments name the family, its samples have a suffix | comments name the samples |
//! | type `info` | `gauge`, which is 1 |
//! | `# UNIT`, `# EOF` | nothing: names end with their unit all the same |

use std::collections::HashMap;

/// The same metrics in the older format.
pub fn text(openmetrics: &str) -> String {
    let types: HashMap<&str, &str> = openmetrics
        .lines()
        .filter_map(|line| line.strip_prefix("# TYPE ")?.split_once(' '))
        .collect();
    let mut text = String::with_capacity(openmetrics.len());
    for line in openmetrics.lines() {
        let mut words = line.splitn(4, ' ');
        match [words.next(), words.next(), words.next(), words.next()] {
            [Some("#"), Some("EOF" | "UNIT"), ..] => continue,
            [Some("#"), Some(kind), Some(family), Some(rest)] => {
                let (suffix, shown) = match types.get(family) {
                    Some(&"counter") => ("_total", "counter"),
                    Some(&"info") => ("_info", "gauge"),
                    other => ("", other.copied().unwrap_or("untyped")),
                };
                let rest = if kind == "TYPE" { shown } else { rest };
                text += &format!("# {kind} {family}{suffix} {rest}");
            }
            _ => text += line,
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn comments_name_the_samples_and_nothing_of_openmetrics_is_left() {
        let openmetrics = "# HELP a_build The build.\n# TYPE a_build info\na_build_info{v=\"1\"} 1\n\
                           # HELP a_steps Steps.\n# TYPE a_steps counter\na_steps_total{d=\"x # y\"} 3\n\
                           # HELP a_age_seconds Age.\n# TYPE a_age_seconds gauge\n# UNIT a_age_seconds seconds\n\
                           a_age_seconds 0.5\n# EOF\n";
        let classic = "# HELP a_build_info The build.\n# TYPE a_build_info gauge\na_build_info{v=\"1\"} 1\n\
                       # HELP a_steps_total Steps.\n# TYPE a_steps_total counter\na_steps_total{d=\"x # y\"} 3\n\
                       # HELP a_age_seconds Age.\n# TYPE a_age_seconds gauge\na_age_seconds 0.5\n";
        assert_eq!(super::text(openmetrics), classic);
    }
}
