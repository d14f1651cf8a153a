//! Exact facts of method sheet 8(a) and the width ratios of section 6, through the public interface.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::{
    diagnoser::{Diagnoser, Verdict, flags},
    model::ModelOptions,
    unknown_input_filter::UnknownInputFilterBank,
};
use support::*;

fn vtol_bank(model: &ModelOptions, bank_keys: &str, filter_keys: &str) -> UnknownInputFilterBank {
    let text = format!(
        "bank = {{ reset = \"none\", {bank_keys} }}\n\
         filter = {{ initialisation = \"prior\", outward_rounding = false, {filter_keys} }}\n\
         missing = {{ policy = \"unbounded_fault\" }}"
    );
    bank(model, &options(&text))
}

fn certain_vtol() -> ModelOptions {
    ModelOptions {
        a_uncertainty: Vec::new(),
        ..vtol()
    }
}

/// Half widths of every row of a record.
fn half_widths(
    bank: &UnknownInputFilterBank,
    record: &residual_diagnosis::diagnoser::StepRecord,
) -> Vec<f64> {
    let channels = bank.description().channels.iter().zip(record.channels());
    channels
        .filter(|(description, _)| {
            description.name.contains("_output_") || description.name.contains("_matched_")
        })
        .map(|(_, channel)| channel.upper)
        .collect()
}

#[test]
fn an_own_fault_moves_the_set_of_its_mode_and_nothing_else() {
    let y = rows(&reference("vtol_case1.json")["y"]);
    let model = vtol();
    let alpha = 1e3;
    for gain in [
        "gain = \"row_wise\"",
        "gain = \"frobenius\"",
        "gain = \"fixed\"",
        "form = \"paper\"",
    ] {
        for own in 0..2 {
            let mut banks = [(); 2].map(|()| vtol_bank(&model, "fault_free_mode = false", gain));
            for (k, y) in y.iter().enumerate().take(31) {
                let mut faulty = y.clone();
                if k == 30 {
                    for (j, value) in faulty.iter_mut().enumerate() {
                        *value += (0..4)
                            .map(|i| model.c[j][i] * model.b[i][own] * alpha)
                            .sum::<f64>();
                    }
                }
                let records = [
                    step(&mut banks[0], y, &[0.1, 0.2]),
                    step(&mut banks[1], &faulty, &[0.1, 0.2]),
                ];
                if k < 30 {
                    continue;
                }
                for j in 0..4 {
                    let name = format!("mode_{own}_output_{j}");
                    let [a, b] = [0, 1].map(|i| residual_and_width(&banks[i], &records[i], &name));
                    assert!(
                        (a.0 - b.0).abs() < 1e-11 && a.1 == b.1,
                        "{gain} {name}: {a:?} {b:?}"
                    );
                }
                let sets = [0, 1].map(|i| banks[i].state_set(own).unwrap());
                assert_eq!(sets[0].1, sets[1].1, "{gain}");
                for i in 0..4 {
                    let moved = sets[1].0[i] - sets[0].0[i];
                    assert!((moved - model.b[i][own] * alpha).abs() < 1e-11, "{gain}: {moved}");
                }
            }
        }
    }
}

#[test]
fn without_uncertainty_the_widths_do_not_depend_on_the_data() {
    let y = rows(&reference("vtol_case1.json")["y"]);
    for gain in [
        "gain = \"row_wise\"",
        "gain = \"frobenius\"",
        "gain = \"fixed\"",
        "form = \"paper\"",
    ] {
        let mut banks = [(); 2].map(|()| vtol_bank(&certain_vtol(), "fault_free_mode = true", gain));
        for (k, y) in y.iter().enumerate() {
            let other: Vec<f64> = y.iter().map(|value| 3.0 - 50.0 * value).collect();
            let records = [
                step(&mut banks[0], y, &[0.0, 0.0]),
                step(&mut banks[1], &other, &[k as f64, -7.0]),
            ];
            let [a, b] = [0, 1].map(|i| half_widths(&banks[i], &records[i]));
            assert!(
                a.iter().zip(&b).all(|(a, b)| (a - b).abs() <= 1e-12),
                "{gain} at {k}"
            );
        }
    }
}

#[test]
fn permuting_the_sensors_permutes_the_bounds() {
    let y = rows(&reference("vtol_case2.json")["y"]);
    let permutation = [2, 0, 3, 1];
    let model = vtol();
    let mut permuted = model.clone();
    permuted.c = permutation.iter().map(|j| model.c[*j].clone()).collect();
    for gain in ["gain = \"row_wise\"", "gain = \"frobenius\"", "form = \"paper\""] {
        let mut banks = [&model, &permuted].map(|model| vtol_bank(model, "fault_free_mode = true", gain));
        for y in &y {
            let other: Vec<f64> = permutation.iter().map(|j| y[*j]).collect();
            let records = [
                step(&mut banks[0], y, &[0.0, 0.0]),
                step(&mut banks[1], &other, &[0.0, 0.0]),
            ];
            for mode in ["fault_free", "0", "1"] {
                for (place, original) in permutation.iter().enumerate() {
                    let names = [original, &place].map(|j| format!("mode_{mode}_output_{j}"));
                    let [a, b] = [0, 1].map(|i| residual_and_width(&banks[i], &records[i], &names[i]));
                    assert!(
                        (a.0 - b.0).abs() < 1e-11 && (a.1 - b.1).abs() < 1e-11,
                        "{gain}: {a:?} {b:?}"
                    );
                }
            }
        }
    }
}

#[test]
fn one_step_floors_and_isolability_are_those_of_fact_14() {
    let s = "S = [[0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01], [0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01]]";
    let mut bank = vtol_bank(&certain_vtol(), "fault_free_mode = false", s);
    let mut last = None;
    for _ in 0..20 {
        last = Some(step(&mut bank, &[0.0; 4], &[0.0; 2]));
    }
    let record = last.unwrap();
    for (fault, expected) in [2.106348757, 1.341139868].iter().enumerate() {
        for kind in ["detectable", "isolable"] {
            let floor = channel(&bank, &record, &format!("{kind}_fault_{fault}")).residual;
            assert!((floor - expected).abs() < 1e-8, "{floor} instead of {expected}");
        }
    }
    for isolability in &bank.report().isolability {
        assert!((isolability.sigma_min - 0.742868708).abs() < 1e-8);
    }
    let mut with_fault_free = vtol_bank(&certain_vtol(), "fault_free_mode = true", "");
    (0..20).for_each(|_| last = Some(step(&mut with_fault_free, &[0.0; 4], &[0.0; 2])));
    for (fault, expected) in [1.085, 0.820].iter().enumerate() {
        let record = last.unwrap();
        let floor = channel(&with_fault_free, &record, &format!("detectable_fault_{fault}")).residual;
        assert!((floor - expected).abs() < 1e-3, "{floor} instead of {expected}");
    }
}

#[test]
fn a_large_state_makes_the_thresholds_inert_and_says_so() {
    let mut bank = vtol_bank(
        &vtol(),
        "fault_free_mode = false",
        "fault_of_interest = [3.0, 2.5]",
    );
    let product = |x: f64| -> Vec<f64> {
        vtol()
            .c
            .iter()
            .map(|row| row.iter().map(|c| c * x).sum())
            .collect()
    };
    for (size, inert) in [(0.3, false), (1.0, false), (10.0, true), (0.0, false)] {
        let mut last = None;
        for _ in 0..5 {
            last = Some(step(&mut bank, &product(size), &[0.0, 0.0]));
        }
        let record = last.unwrap();
        assert_eq!(record.flags & flags::THRESHOLD_INERT != 0, inert, "state {size}");
        let floor = channel(&bank, &record, "detectable_fault_0");
        assert_eq!(floor.upper, 3.0);
        assert_eq!(floor.residual > 3.0, inert);
    }
}

#[test]
fn the_default_form_is_narrower_than_the_papers_by_the_listed_ratios() {
    // Regulated states as in method sheet 6: the ratio hardly depends on the regulator.
    for (bound, expected, tolerance) in [(0.01, 0.712, 0.01), (0.001, 0.642, 0.01)] {
        let mut model = vtol();
        model.disturbance_bound = vec![bound; 4];
        let default = vtol_bank(&model, "fault_free_mode = false", "");
        let paper = vtol_bank(
            &model,
            "fault_free_mode = false",
            "form = \"paper\", test = \"printed\"",
        );
        let mut sums = [vec![0.0; 8], vec![0.0; 8]];
        for (mut bank, sum) in [default, paper].into_iter().zip(&mut sums) {
            let mut plant = Simulation::new(&model, 7);
            for k in 0..400 {
                let y = plant.measure();
                let u = [0.3 * y[1] + 0.6 * y[3], 0.4 * y[1] + 0.5 * y[3]];
                let record = step(&mut bank, &y, &u);
                plant.advance(&u, &[0.0, 0.0]);
                if k >= 200 {
                    for mode in 0..2 {
                        for j in 0..4 {
                            sum[4 * mode + j] +=
                                channel(&bank, &record, &format!("mode_{mode}_output_{j}")).upper;
                        }
                    }
                }
            }
        }
        let ratios: Vec<f64> = sums[0]
            .iter()
            .zip(&sums[1])
            .map(|(default, paper)| default / paper)
            .collect();
        let mean = ratios.iter().sum::<f64>() / 8.0;
        println!("w = {bound}: mean {mean:.3}, ratios {ratios:.3?}");
        assert!(ratios.iter().all(|ratio| *ratio < 0.95), "{ratios:?}");
        assert!(
            (mean - expected).abs() < tolerance,
            "{mean} instead of {expected}"
        );
    }
}

#[test]
fn repetition_and_reset_give_identical_bits() {
    let file = reference("vtol_loss_reset.json");
    let (y, u) = (rows(&file["y"]), rows(&file["u"]));
    let make = || {
        let mut options = options(
            "bank = { clear_samples = 15 }\nmissing = { policy = \"bounded_fault\", fault_bound = [3, 3] }",
        );
        options.parity.certificates = Some(certificates(&reference("vtol_design.json")));
        bank(&vtol(), &options)
    };
    let (mut first, mut second) = (make(), make());
    let run = |bank: &mut UnknownInputFilterBank| -> Vec<_> {
        y.iter().zip(&u).map(|(y, u)| step(bank, y, u)).collect()
    };
    let records = run(&mut first);
    let again = run(&mut second);
    first.reset();
    let after_reset = run(&mut first);
    for (k, record) in records.iter().enumerate() {
        assert!(
            record.same_bits(&again[k]) && record.same_bits(&after_reset[k]),
            "instant {k}"
        );
    }
}

#[test]
fn the_paper_rule_isolates_only_at_the_instants_of_an_alarm() {
    let case = reference("vtol_case1.json");
    let mut bank = vtol_bank(
        &vtol(),
        "fault_free_mode = false, isolation = \"instantaneous\"",
        "form = \"paper\", test = \"printed\", S = [[0.01, 0, 0.01, 0], [0, 0.01, 0, 0.01], [0.01, 0, 0.01, 0], \
         [0, 0.01, 0, 0.01]]",
    );
    for (k, y) in rows(&case["y"]).iter().enumerate() {
        let record = step(&mut bank, y, &[0.0, 0.0]);
        let expected = match k {
            0 => Verdict::Starting,
            _ if alarm_now(&record) => Verdict::Isolated,
            _ => Verdict::Nominal,
        };
        assert_eq!(record.verdict(), expected, "instant {k}");
    }
}

/// The plant with deterministic pseudo-random disturbance and noise within their bounds.
struct Simulation {
    model: ModelOptions,
    x: Vec<f64>,
    seed: u64,
}

impl Simulation {
    fn new(model: &ModelOptions, seed: u64) -> Self {
        Self {
            model: model.clone(),
            x: vec![0.1, -0.2, 0.15, 0.1],
            seed,
        }
    }

    /// Uniform in \[-1, 1\].
    fn random(&mut self) -> f64 {
        self.seed = self
            .seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.seed >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn measure(&mut self) -> Vec<f64> {
        let c = self.model.c.clone();
        let noise = self.model.measurement_noise_bound.clone();
        let exact = c
            .iter()
            .map(|row| row.iter().zip(&self.x).map(|(c, x)| c * x).sum::<f64>());
        exact
            .collect::<Vec<_>>()
            .iter()
            .zip(noise)
            .map(|(y, v)| y + v * self.random())
            .collect()
    }

    fn advance(&mut self, u: &[f64], fault: &[f64]) {
        let ModelOptions {
            a,
            b,
            d,
            a_uncertainty,
            disturbance_bound,
            ..
        } = self.model.clone();
        let disturbance: Vec<f64> = disturbance_bound.iter().map(|w| w * self.random()).collect();
        let mut next = vec![0.0; self.x.len()];
        for i in 0..next.len() {
            for k in 0..next.len() {
                let change = a_uncertainty.get(i).map_or(0.0, |row| row[k]) * self.random();
                next[i] += (a[i][k] + change) * self.x[k];
            }
            next[i] += (0..u.len()).map(|j| b[i][j] * (u[j] + fault[j])).sum::<f64>();
            next[i] += disturbance
                .iter()
                .enumerate()
                .map(|(j, value)| d[i][j] * value)
                .sum::<f64>();
        }
        self.x = next;
    }
}
