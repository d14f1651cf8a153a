//! Detectable fault against delay.

use residual_chart::{Chart, Curve};
use residual_diagnosis::achieved::Achieved;

/// Per fault the smallest constant size that is detected within a time; a step curve from one delay to the next.
pub(super) fn chart(name: &str, sample_time_s: f64, achieved: &Achieved) -> Option<Chart> {
    let longest = achieved
        .faults
        .iter()
        .flat_map(|fault| &fault.delays)
        .map(|delay| delay.within_s)
        .fold(0.0, f64::max);
    let curves: Vec<Curve> = achieved
        .faults
        .iter()
        .filter(|fault| !fault.delays.is_empty())
        .map(|fault| {
            let mut points = Vec::new();
            for delay in &fault.delays {
                if let Some((_, size)) = points.last().copied() {
                    points.push((delay.within_s, size));
                }
                points.push((delay.within_s, delay.size));
            }
            if let Some((_, size)) = points.last().copied() {
                points.push((longest + sample_time_s, size));
            }
            let unit = match fault.unit.as_str() {
                "" => String::new(),
                unit => format!(", {unit}"),
            };
            let assurance = match fault.assurance {
                1.0 => "guaranteed".to_owned(),
                probability => format!("with probability {probability}"),
            };
            Curve {
                name: format!("{}{unit} ({assurance})", fault.fault),
                points,
            }
        })
        .collect();
    (!curves.is_empty()).then(|| Chart {
        title: format!("{name}: smallest constant fault that is detected in time"),
        x: "delay from the onset, s".to_owned(),
        y: "size of the fault".to_owned(),
        curves,
        ..Chart::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use residual_diagnosis::achieved::{Delay, FaultSensitivity};

    #[test]
    fn a_size_holds_until_the_delay_at_which_a_smaller_one_is_sure() {
        let delay = |within_s, size| Delay { within_s, size };
        let achieved = Achieved {
            faults: vec![FaultSensitivity {
                fault: "valve".to_owned(),
                unit: "kW".to_owned(),
                assurance: 1.0,
                provided_that: String::new(),
                detectable: Some(1.0),
                isolable: None,
                delays: vec![delay(0.1, 3.0), delay(0.5, 1.0)],
            }],
            ..Achieved::default()
        };
        let chart = chart("loop", 0.1, &achieved).unwrap();
        assert_eq!(
            chart.curves[0].points,
            [(0.1, 3.0), (0.5, 3.0), (0.5, 1.0), (0.6, 1.0)]
        );
        assert_eq!(chart.curves[0].name, "valve, kW (guaranteed)");
        assert_eq!(super::chart("none", 0.1, &Achieved::default()), None);
    }
}
