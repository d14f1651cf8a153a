//! Numbers for people.

/// The smallest decimal number of `digits` significant digits that is not smaller than `value`.
///
/// Printing the result and reading it back gives the same number. Zero, negative and non-finite values come back
/// unchanged; `digits` = 0 counts as 1, and more than 17 as 17.
pub fn round_up(value: f64, digits: usize) -> f64 {
    if !(value.is_finite() && value > 0.0) {
        return value;
    }
    let digits = digits.clamp(1, 17);
    let nearest = format!("{value:.*e}", digits - 1);
    let Some((mantissa, exponent)) = nearest.split_once('e') else {
        return value;
    };
    let (Ok(mantissa), Ok(exponent)) = (mantissa.replace('.', "").parse::<u64>(), exponent.parse::<i32>())
    else {
        return value;
    };
    (0..=2)
        .filter_map(|up| {
            format!("{}e{}", mantissa + up, exponent - digits as i32 + 1)
                .parse::<f64>()
                .ok()
        })
        .find(|&candidate| candidate >= value)
        .unwrap_or(value)
}

/// The decimal number of `digits` significant digits next to `value`; like [`round_up`] otherwise.
pub fn round(value: f64, digits: usize) -> f64 {
    let nearest = format!("{value:.*e}", digits.clamp(1, 17) - 1).parse();
    nearest.ok().filter(|_| value.is_finite()).unwrap_or(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_takes_the_nearest_number_of_few_digits() {
        assert_eq!(round(0.003_814_9, 3), 0.003_81);
        assert_eq!(round(-9.996, 3), -10.0);
        assert_eq!(round(0.0, 3), 0.0);
        assert_eq!(round(f64::INFINITY, 3), f64::INFINITY);
    }

    #[test]
    fn rounding_never_goes_down_and_keeps_few_digits() {
        assert_eq!(round_up(0.00381, 2), 0.0039);
        assert_eq!(round_up(0.0038, 2), 0.0038);
        assert_eq!(round_up(9.99, 2), 10.0);
        assert_eq!(round_up(123_456.0, 3), 124_000.0);
        assert_eq!(round_up(0.1 + 0.2, 3), 0.301);
        assert_eq!(round_up(0.0, 3), 0.0);
        for i in 1..2000 {
            let value = f64::from(i) * 1.234_567e-3;
            let rounded = round_up(value, 3);
            assert!(rounded >= value && rounded <= value * 1.0101, "{value} {rounded}");
            assert_eq!(rounded.to_string().parse::<f64>().unwrap(), rounded);
        }
    }
}
