//! What a bank says at the start, without commands, after losses and with modes that cannot be tested.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod support;

use residual_diagnosis::{
    diagnoser::{Diagnoser, StepRecord, Verdict, flags},
    model::{LinearModel, ModelOptions},
    unknown_input_filter::{UnknownInputFilterBank, error::ConstructionError, options::Publish},
};
use support::*;

const NAN: f64 = f64::NAN;

fn default_bank(model: &ModelOptions, text: &str) -> UnknownInputFilterBank {
    bank(
        model,
        &options(&format!("missing = {{ policy = \"unbounded_fault\" }}\n{text}")),
    )
}

#[test]
fn nothing_happens_before_the_first_complete_packet() {
    let mut waiting = default_bank(&vtol(), "");
    for (y, u) in [
        (vec![0.1, NAN, 0.1, 0.2], vec![0.0, 0.0]),
        (vec![0.1, f64::INFINITY, 0.1, 0.2], vec![0.0, 0.0]),
        (vec![0.1; 4], vec![NAN, 0.0]),
        (vec![0.1; 3], vec![0.0, 0.0]),
        (vec![0.1; 5], vec![0.0, 0.0]),
        (vec![0.1; 4], vec![0.0]),
    ] {
        let record = step(&mut waiting, &y, &u);
        assert_eq!(record.verdict(), Verdict::Starting);
        assert_eq!(record.flags, flags::INPUT_MISSING);
        assert!(record.channels().iter().all(|channel| !channel.is_evaluated()));
        assert_eq!(waiting.state_set(0), None);
    }
    let mut fresh = default_bank(&vtol(), "");
    for (k, y) in rows(&reference("vtol_case1.json")["y"]).iter().enumerate() {
        let records = [
            step(&mut waiting, y, &[0.0, 0.0]),
            step(&mut fresh, y, &[0.0, 0.0]),
        ];
        assert!(records[0].same_bits(&records[1]));
        assert_eq!(records[0].verdict() == Verdict::Starting, k == 0);
    }
}

#[test]
fn received_elements_and_losses_are_marked() {
    let mut bank = default_bank(&vtol(), "");
    step(&mut bank, &[0.0; 4], &[0.0; 2]);
    let record = step(&mut bank, &[0.0, NAN, 0.0, 0.0], &[0.0, NAN]);
    assert_eq!(record.inputs_valid, 0b01_1101);
    assert_eq!(record.flags & flags::INPUT_MISSING, flags::INPUT_MISSING);
    assert!(!channel(&bank, &record, "mode_0_output_1").is_evaluated());
    assert!(channel(&bank, &record, "mode_0_output_0").is_evaluated());
    let mut record = StepRecord::new(bank.description().channels.len());
    record.certainly_faulty = 7;
    bank.skip(&mut record);
    assert_eq!((record.inputs_valid, record.certainly_faulty), (0, 0));
}

#[test]
fn a_missing_command_is_bridged_by_its_box_or_by_the_strip() {
    let mut model = vtol();
    let mut by_strip = default_bank(&model, "");
    model.input_lower = Some(vec![-0.5, -0.5]);
    model.input_upper = Some(vec![0.5, 0.5]);
    let mut by_box = default_bank(&model, "");
    for bank in [&mut by_strip, &mut by_box] {
        step(bank, &[0.0; 4], &[0.0; 2]);
        step(bank, &[0.0; 4], &[NAN, 0.0]);
    }
    let record = step(&mut by_strip, &[0.0; 4], &[0.0; 2]);
    assert_eq!(record.verdict(), Verdict::NotEvaluated);
    assert_ne!(record.flags & flags::RESET, 0);
    assert_eq!(
        step(&mut by_strip, &[0.0; 4], &[0.0; 2]).verdict(),
        Verdict::Nominal
    );
    let during = step(&mut by_box, &[0.0; 4], &[0.0; 2]);
    let after = step(&mut by_box, &[0.0; 4], &[0.0; 2]);
    assert_eq!(
        (during.verdict(), during.flags & flags::RESET),
        (Verdict::Nominal, 0)
    );
    // Actuator 0 may have moved by its box: wide in the mode that knows it, not in the mode that ignores it.
    let width = |record: &StepRecord, name: &str| channel(&by_box, record, name).upper;
    assert!(width(&during, "mode_1_matched_0") > 1.1 * width(&after, "mode_1_matched_0"));
    let own = [&during, &after].map(|record| width(record, "mode_0_output_1"));
    assert!((own[0] - own[1]).abs() < 1e-9);
}

#[test]
fn without_strip_a_lost_command_loses_the_guarantee_until_a_state_box_restores_it() {
    let mut model = battery();
    let text = "filter = { publish = \"worst\" }";
    let mut lost = default_bank(&model, text);
    model.state_box_lower = Some(vec![-30.0; 5]);
    model.state_box_upper = Some(vec![30.0; 5]);
    let mut boxed = default_bank(&model, text);
    for bank in [&mut lost, &mut boxed] {
        step(bank, &[0.0; 4], &[0.0; 3]);
        assert_eq!(
            step(bank, &[0.0; 4], &[NAN, 0.0, 0.0]).verdict(),
            Verdict::Nominal
        );
    }
    for _ in 0..5 {
        assert_eq!(
            step(&mut lost, &[0.0; 4], &[0.0; 3]).verdict(),
            Verdict::GuaranteeLost
        );
    }
    let record = step(&mut boxed, &[0.0; 4], &[0.0; 3]);
    assert_eq!(record.verdict(), Verdict::NotEvaluated);
    assert_eq!(boxed.state_set(0).unwrap().1, vec![30.0_f64.next_up(); 5]);
    assert_eq!(step(&mut boxed, &[0.0; 4], &[0.0; 3]).verdict(), Verdict::Nominal);
    lost.reset();
    assert_eq!(step(&mut lost, &[0.0; 4], &[0.0; 3]).verdict(), Verdict::Starting);
    assert_eq!(step(&mut lost, &[0.0; 4], &[0.0; 3]).verdict(), Verdict::Nominal);
}

#[test]
fn a_latched_verdict_outlives_a_lost_packet() {
    let mut bank = default_bank(&vtol(), "");
    let y = rows(&reference("vtol_case2.json")["y"]);
    for y in &y {
        step(&mut bank, y, &[0.0, 0.0]);
    }
    let mut record = StepRecord::new(bank.description().channels.len());
    bank.skip(&mut record);
    assert_eq!(
        (record.verdict(), record.certainly_faulty),
        (Verdict::Isolated, 0b10)
    );
    assert_eq!(record.flags, flags::INPUT_MISSING);
    assert!(record.fault_estimate.is_nan());
}

#[test]
fn the_isolated_fault_is_estimated_within_its_radius() {
    let mut bank = default_bank(&vtol(), "");
    let y = rows(&reference("vtol_case1.json")["y"]);
    let mut estimates = 0;
    for y in &y {
        let record = step(&mut bank, y, &[0.0, 0.0]);
        if record.verdict() == Verdict::Isolated {
            estimates += 1;
            let (estimate, radius) = (record.fault_estimate, record.fault_estimate_half_width);
            assert!(
                (estimate - 2.0).abs() <= radius && radius < 2.0,
                "{estimate} ± {radius}"
            );
        }
    }
    assert_eq!(estimates, 39);
}

#[test]
fn the_worst_channel_of_a_mode_is_its_largest_ratio() {
    let mut banks = [Publish::All, Publish::Worst].map(|publish| {
        let mut options = options("missing = { policy = \"unbounded_fault\" }");
        options.filter.publish = publish;
        options.parity.certificates = Some(certificates(&reference("vtol_design.json")));
        bank(&vtol(), &options)
    });
    for y in rows(&reference("vtol_case1.json")["y"]) {
        let records = banks.each_mut().map(|bank| step(bank, &y, &[0.0, 0.0]));
        for mode in ["mode_fault_free", "mode_0", "mode_1"] {
            let channels = banks[0].description().channels.iter().zip(records[0].channels());
            let rows = channels.filter(|(d, _)| d.name.starts_with(mode) && !d.name.contains("estimate"));
            let largest = rows.map(|(_, channel)| channel.ratio).fold(NAN, f64::max);
            let worst = channel(&banks[1], &records[1], &format!("{mode}_worst")).ratio;
            assert!(worst == largest || worst.is_nan() && largest.is_nan());
        }
        assert_eq!(records[0].verdict, records[1].verdict);
    }
}

#[test]
fn more_channels_than_a_record_holds_are_refused() {
    let options = options(
        "bank = { simultaneous_faults = [1, 2] }\nmissing = { policy = \"unbounded_fault\" }\n\
         filter = { initialisation = \"prior\" }",
    );
    let mut with_certificates = options.clone();
    let certificates = certificates(&reference("battery_bank.json"));
    let mut longer = certificates.clone();
    longer.iter_mut().for_each(|certificate| certificate.length += 1);
    with_certificates.parity.certificates = Some([certificates, longer].concat());
    let model = LinearModel::new(&battery(), 2.0).unwrap();
    let refused = UnknownInputFilterBank::new(model, &with_certificates)
        .err()
        .unwrap();
    assert!(
        matches!(refused, ConstructionError::TooManyChannels { limit: 64, .. }),
        "{refused}"
    );
    assert!(refused.to_string().contains("worst"));
}

#[test]
fn an_untestable_mode_that_is_allowed_stays_a_candidate() {
    let mut model = vtol();
    // A third actuator that no output sees within one step: its fault cannot be tested.
    for row in &mut model.b {
        row.push(0.0);
    }
    let text = "bank = { allow_untestable_modes = true }";
    let mut bank = default_bank(&model, text);
    assert!(
        !bank
            .description()
            .channels
            .iter()
            .any(|channel| channel.name.starts_with("mode_2_"))
    );
    let mut last = None;
    for y in rows(&reference("vtol_case2.json")["y"]) {
        last = Some(step(&mut bank, &y, &[0.0; 3]));
    }
    let record = last.unwrap();
    assert_eq!(record.verdict(), Verdict::Fault);
    assert_eq!((record.certainly_faulty, record.possibly_faulty), (0, 0b110));
    assert_eq!(bank.falsified(), [true, true, false, false]);
}

#[test]
fn the_papers_form_restarts_from_the_strip_after_a_loss() {
    let mut bank = default_bank(&vtol(), "filter = { form = \"paper\" }");
    let y = rows(&reference("vtol_case1.json")["y"]);
    let verdicts: Vec<Verdict> = (0..8)
        .map(|k| {
            let lost = [y[k][0], NAN, NAN, NAN];
            step(&mut bank, if k == 4 { &lost } else { &y[k] }, &[0.0, 0.0]).verdict()
        })
        .collect();
    use Verdict::{Nominal, NotEvaluated, Starting};
    assert_eq!(
        verdicts,
        [
            Starting,
            Nominal,
            Nominal,
            Nominal,
            NotEvaluated,
            NotEvaluated,
            Nominal,
            Nominal
        ]
    );
}

#[test]
fn an_episode_ends_after_quiet_samples_and_the_next_fault_is_isolated_as_well() {
    let mut bank = default_bank(&vtol(), "bank = { clear_samples = 10 }");
    let (mut x, model) = (vec![0.0; 4], vtol());
    let mut verdicts = Vec::new();
    for k in 0..150_usize {
        let y: Vec<f64> = model
            .c
            .iter()
            .map(|row| row.iter().zip(&x).map(|(c, x)| c * x).sum())
            .collect();
        let record = step(&mut bank, &y, &[0.0, 0.0]);
        verdicts.push((record.verdict(), record.certainly_faulty));
        let mut fault = [0.0, 0.0];
        if (20..40).contains(&k) {
            fault[0] = 4.0;
        } else if (90..110).contains(&k) {
            fault[1] = 3.0;
        }
        x = (0..4)
            .map(|i| {
                let state: f64 = (0..4).map(|j| model.a[i][j] * x[j]).sum();
                state + model.b[i][0] * fault[0] + model.b[i][1] * fault[1]
            })
            .collect();
    }
    verdicts.dedup();
    let expected = [
        (Verdict::Starting, 0),
        (Verdict::Nominal, 0),
        (Verdict::Isolated, 1),
        (Verdict::Nominal, 0),
        (Verdict::Isolated, 2),
        (Verdict::Nominal, 0),
    ];
    assert_eq!(verdicts, expected);
}
