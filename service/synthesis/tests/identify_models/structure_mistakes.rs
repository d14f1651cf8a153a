//! Structures that say something wrong.

use residual_synthesis::identify::model::{Structure, StructureOptions};

const GOOD: &str = r#"
    A = [["a", 0], [0.1, "free"]]
    B = [[1], ["2 * a"]]
    C = [[1, 0]]
    D = [[1], [0]]
    parameters = { a = { start = 0.5, lower = 0, upper = 1 } }
    initial_state_radius = [1, 1]
"#;

fn refusal(from: &str, to: &str) -> String {
    assert!(GOOD.contains(from), "{from}");
    let options: StructureOptions = match toml::from_str(&GOOD.replace(from, to)) {
        Ok(options) => options,
        Err(error) => return error.to_string(),
    };
    Structure::new(&options, 0.1, 1, 1).unwrap_err().to_string()
}

#[test]
fn the_structure_itself_is_accepted() {
    let options: StructureOptions = toml::from_str(GOOD).unwrap();
    assert!(Structure::new(&options, 0.1, 1, 1).is_ok());
}

#[test]
fn every_mistake_is_named() {
    let cases = [
        ("[0.1, \"free\"]", "[0.1]", "row 1 of `A` has 1 entries"),
        ("[[1, 0]]", "[[1, 0, 0]]", "`C` is 1 x 3, but 1 x 2 is needed"),
        (
            "[[1, 0]]",
            "[[1, 0], [0, 1]]",
            "`C` is 2 x 2, but 1 x 2 is needed",
        ),
        (
            "B = [[1], [\"2 * a\"]]",
            "B = [[1, \"a\"], [0, 1]]",
            "`B` is 2 x 2, but 2 x 1 is needed",
        ),
        ("0.1", "inf", "`A[1][0]` is inf"),
        ("2 * a", "2 * b", "there is no parameter `b`"),
        ("2 * a", "2 * * a", "which is neither \"free\" nor an expression"),
        ("\"free\"", "\"fre\"", "there is no parameter `fre`"),
        ("\"free\"", "true", "expected a number, \"free\""),
        (
            "\"free\"",
            "{ start = 2, upper = 1 }",
            "`A[1][1]` starts at 2 in the range from -inf to 1",
        ),
        ("\"free\"", "{ begin = 2 }", "expected a number, \"free\""),
        (
            "lower = 0, upper = 1",
            "lower = 1, upper = 0",
            "in the range from 1 to 0",
        ),
        (
            "parameters = { a",
            "parameters = { unused = {}, a",
            "no entry uses the parameter `unused`",
        ),
        (
            "parameters = { a",
            "parameters = { \"2\" = {}, a",
            "`2` cannot be the name of a parameter",
        ),
        (
            "radius = [1, 1]",
            "radius = [1]",
            "`initial_state_radius` is a list of length 1",
        ),
        (
            "radius = [1, 1]",
            "radius = [1, 0]",
            "`initial_state_radius` holds 0",
        ),
        ("D = [[1], [0]]", "D = [[1]]", "`D` is 1 x 1, but 2 x 1 is needed"),
        (
            "D =",
            "disturbance_covariance = [[-1]]\nD =",
            "not a covariance: NotPositiveSemidefinite",
        ),
        (
            "D =",
            "disturbance_covariance = [[1, 0], [0, 1]]\nD =",
            "`disturbance_covariance` is 2 x 2",
        ),
        (
            "D =",
            "measurement_noise_covariance = [[0]]\nD =",
            "`measurement_noise_covariance` holds 0",
        ),
        ("D =", "E =", "unknown field `E`"),
    ];
    for (from, to, words) in cases {
        let message = refusal(from, to);
        assert!(message.contains(words), "{from} -> {to}: {message}");
    }
}
