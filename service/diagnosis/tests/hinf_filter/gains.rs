//! Gains: what a filter runs on, what it achieves, and what becomes of gains that were altered.

use crate::paper::{RICCATI, TS, paper_options, windowed};
use residual_diagnosis::{
    achieved::Achieved,
    diagnoser::{Diagnoser, StepInput, StepRecord},
    gains::{
        FoundGains,
        error::GainsError,
        file::{Entry, GainsFile, TOLERANCE, VERSION, hash_of_inputs},
    },
    hinf_filter::{
        gains::{HinfFilterGains, ReferenceModel},
        options::{DesignType, HinfFilterOptions},
    },
    method::{MethodOptions, Refusal},
};

const BANK: &str = "[isolation]\nblind_sets = [[\"f1\"], [\"f2\"]]\nfault_bound = [0.3, 0.3]\nfault_slew = [0.05, \
                    0.05]\nfault_estimate = true\n";

fn options(synthesis: &str, more: &str) -> HinfFilterOptions {
    paper_options(&format!("{}{more}", windowed(synthesis)))
}

/// The gains as a file holds them.
fn entry(options: &HinfFilterOptions, found: &FoundGains<HinfFilterGains>, achieved: Achieved) -> Entry {
    Entry {
        name: "plant".to_owned(),
        method: HinfFilterOptions::METHOD.to_owned(),
        sample_time_s: TS,
        inputs: hash_of_inputs(options, TS).unwrap(),
        warnings: found.warnings.clone(),
        solver: found.solver.clone(),
        gains: toml::Table::try_from(&found.gains).unwrap(),
        achieved,
    }
}

/// The entry and its gains after a file was written and read.
fn read_back(entry: Entry) -> (Entry, HinfFilterGains) {
    let file = GainsFile {
        version: VERSION,
        tool: "test".to_owned(),
        date: "2026-01-01T00:00:00Z".to_owned(),
        tolerance: TOLERANCE,
        diagnoser: vec![entry],
    };
    let file = GainsFile::parse(&file.to_text("test").unwrap()).unwrap();
    let (_, entry) = file.entry("plant").unwrap();
    (
        entry.clone(),
        toml::Value::Table(entry.gains.clone()).try_into().unwrap(),
    )
}

fn complete() -> (HinfFilterOptions, HinfFilterGains) {
    let options = options(RICCATI, BANK);
    let gains = options.find_gains(TS).unwrap().gains;
    (options, gains)
}

fn refusal(change: impl Fn(&mut HinfFilterGains)) -> Refusal {
    let (options, mut gains) = complete();
    change(&mut gains);
    options.with_gains(TS, &gains).unwrap_err()
}

#[track_caller]
fn assert_refused(key: &str, word: &str, change: impl Fn(&mut HinfFilterGains)) {
    let refusal = refusal(change);
    assert_eq!(refusal.key, key, "{refusal}");
    assert!(refusal.message.contains(word), "no {word:?} in: {refusal}");
    assert!(refusal.message.contains("; "), "no advice in: {refusal}");
}

#[test]
fn gains_survive_their_file_and_give_the_same_records() {
    for synthesis in [
        RICCATI,
        "type = \"riccati_ct\"",
        "type = \"matched\"",
        "type = \"given\"\nH = [[0.5, 0], [0, 0.5]]\nclaimed_bound = 0.0283",
    ] {
        let options = options(synthesis, BANK);
        let found = options.find_gains(TS).unwrap();
        assert_eq!(found.gains.main.label, "certified");
        let designed = options.design(TS).unwrap();
        assert_eq!(designed.achieved.violated(), None, "{synthesis}");
        let (entry, gains) = read_back(entry(&options, &found, designed.achieved.clone()));
        assert_eq!(gains, found.gains);
        let mut again = options.with_gains(TS, &gains).unwrap();
        entry.verify(&again.achieved, 1e-6).unwrap();
        let mut first = designed.diagnoser;
        let record = |diagnoser: &mut Box<dyn Diagnoser>| {
            let mut record = StepRecord::new(diagnoser.description().channels.len());
            diagnoser.step(&StepInput::new(&[0.1, -0.2], &[1.0]), &mut record);
            record.channels().to_vec()
        };
        assert_eq!(record(&mut first), record(&mut again.diagnoser));
    }
}

#[test]
fn altered_gains_of_the_filter_are_refused_with_condition_and_margin() {
    let scale = |rows: &mut Option<Vec<Vec<f64>>>, factor: f64| rows.as_mut().unwrap()[0][0] *= factor;
    assert_refused("gains.main.L", "deviates", |gains| {
        scale(&mut gains.main.l, 1.001)
    });
    assert_refused("gains.main.L", "margin -", |gains| {
        scale(&mut gains.main.l, 1.001)
    });
    assert_refused("gains.main.L", "deviates", |gains| gains.main.v[1][0] *= 1.01);
    assert_refused("gains.main.L", "residual of the Riccati equation", |gains| {
        scale(&mut gains.main.riccati, 1.01);
    });
    assert_refused("gains.main.L", "not stable", |gains| {
        scale(&mut gains.main.l, -1e3)
    });
    assert_refused("gains.main.L", "NaN", |gains| scale(&mut gains.main.l, f64::NAN));
    assert_refused("gains.main.L", "inf", |gains| {
        scale(&mut gains.main.l, f64::INFINITY)
    });
    assert_refused("gains.main.V", "1 x 3", |gains| {
        gains.main.v = vec![vec![1.0, 0.0, 0.0]]
    });
    assert_refused("gains.main.V", "not zero", |gains| {
        gains.main.v = vec![vec![0.0, 0.0]]
    });
    assert_refused("gains.main.L", "3 x 2", |gains| {
        gains.main.l.as_mut().unwrap().push(vec![0.0, 0.0]);
    });
    assert_refused("gains.main.L", "beside", |gains| {
        gains.main.h = gains.main.l.clone()
    });
    assert_refused("gains.main.L", "missing", |gains| gains.main.l = None);
    assert_refused("gains.main.Pi", "missing", |gains| gains.main.riccati = None);
    assert_refused("gains.main.design", "matched", |gains| {
        gains.main.design = DesignType::Matched
    });
    assert_refused("gains.main.label", "certified", |gains| {
        gains.main.label = "proven".to_owned()
    });
    assert_refused("gains.main.claimed_bound", "positive", |gains| {
        gains.main.claimed_bound = Some(f64::NAN);
    });
    // Below what any gain reaches, and below the truth.
    assert_refused("gains.main.L", "below", |gains| {
        gains.main.claimed_bound = Some(0.028)
    });
}

#[test]
fn entries_that_belong_to_another_design_are_refused() {
    assert_refused("gains.main.X", "does not claim", |gains| {
        gains.main.lyapunov = gains.main.riccati.clone();
    });
    assert_refused("gains.main.stage_one", "does not claim", |gains| {
        gains.main.stage_one = Some(1.0)
    });
    assert_refused("gains.main.claimed_index", "does not claim", |gains| {
        gains.main.claimed_index = Some(1e-9)
    });
    assert_refused("gains.main.reference", "does not claim", |gains| {
        let square = vec![vec![-1.0, 0.0], vec![0.0, -1.0]];
        gains.main.reference = Some(ReferenceModel {
            a: square.clone(),
            b: square.clone(),
            c: square.clone(),
            d: square,
        });
    });
    let options = options("type = \"matched\"", "");
    let mut gains = options.find_gains(TS).unwrap().gains;
    gains.main.riccati = Some(vec![vec![1.0, 0.0], vec![0.0, 1.0]]);
    assert_eq!(options.with_gains(TS, &gains).unwrap_err().key, "gains.main.Pi");
}

#[test]
fn gains_of_a_riccati_design_replace_only_a_search_in_the_same_time_domain() {
    let gains = |design| options(design, "").find_gains(TS).unwrap().gains;
    let (discrete, continuous) = (gains("type = \"riccati_dt\""), gains("type = \"riccati_ct\""));
    for (design, replacing, other) in [
        ("lmi_two_stage_dt", &discrete, &continuous),
        ("lmi_two_stage_ct", &continuous, &discrete),
        ("lmi_mixed", &continuous, &discrete),
    ] {
        let options = options(&format!("type = \"{design}\""), "");
        let designed = options.with_gains(TS, replacing).unwrap();
        let said: Vec<_> = designed
            .warnings
            .iter()
            .filter(|warning| warning.contains(design) && warning.contains("instead of"))
            .collect();
        assert_eq!(said.len(), 1, "{:?}", designed.warnings);
        let refusal = options.with_gains(TS, other).unwrap_err();
        assert_eq!(refusal.key, "gains.main.design", "{refusal}");
    }
    let (options, gains) = complete();
    let warnings = options.with_gains(TS, &gains).unwrap().warnings;
    assert!(
        warnings.iter().all(|warning| !warning.contains("instead of")),
        "{warnings:?}"
    );
}

#[test]
fn a_filter_that_replaces_another_keeps_the_configured_region() {
    let fallback = options("type = \"riccati_dt\"", "").find_gains(TS).unwrap().gains;
    let narrow = options("type = \"lmi_two_stage_dt\"\nradius_z = 0.5", "");
    let refusal = narrow.with_gains(TS, &fallback).unwrap_err();
    assert!(refusal.message.contains("outside |λ| < 0.5"), "{refusal}");
    let fallback = options("type = \"riccati_ct\"", "").find_gains(TS).unwrap().gains;
    let narrow = options("type = \"lmi_two_stage_ct\"\npole_radius = 0.5", "");
    let refusal = narrow.with_gains(TS, &fallback).unwrap_err();
    assert!(refusal.message.contains("outside |λ| < 0.5"), "{refusal}");
}

#[test]
fn a_post_filter_that_is_not_the_symmetric_root_is_refused() {
    let negated = |v: &mut Vec<Vec<f64>>| v[1].iter_mut().for_each(|entry| *entry = -*entry);
    let dropped = |v: &mut Vec<Vec<f64>>| v.truncate(1);
    let words = "V deviates";
    assert_refused("gains.main.L", words, |gains| negated(&mut gains.main.v));
    assert_refused("gains.main.L", words, |gains| dropped(&mut gains.main.v));
    assert_refused("gains.blind.0.L", words, |gains| negated(&mut gains.blind[0].v));
    assert_refused("gains.blind.1.L", words, |gains| dropped(&mut gains.blind[1].v));
}

#[test]
fn altered_gains_of_bank_and_estimate_are_refused_with_condition_and_margin() {
    assert_refused("gains.blind.0.L", "deviates", |gains| {
        gains.blind[0].l[0][0] *= 1.001
    });
    assert_refused("gains.blind.0.L", "belongs to Π", |gains| {
        gains.blind[0].riccati[0][0] *= 1.001;
    });
    assert_refused("gains.blind.1.L", "gain", |gains| {
        gains.blind[1]
            .v
            .iter_mut()
            .flatten()
            .for_each(|entry| *entry *= 1.01);
    });
    assert_refused("gains.blind.0.L", "not stable", |gains| {
        gains.blind[0].l[0][0] = -1e3
    });
    assert_refused("gains.blind.0.V", "NaN", |gains| {
        gains.blind[0].v[0][0] = f64::NAN
    });
    assert_refused("gains.blind.1.faults", "f2", |gains| {
        gains.blind[1].faults = vec!["f1".to_owned()]
    });
    assert_refused("gains.blind", "1 blind filters", |gains| gains.blind.truncate(1));
    assert_refused("gains.estimator.L", "T_rf = Df", |gains| {
        gains.estimator.as_mut().unwrap().l[0][0] += 1e-6;
    });
    assert_refused("gains.estimator", "no fault estimate", |gains| {
        gains.estimator = None
    });
}

#[test]
fn gains_of_another_plant_are_refused() {
    let (_, gains) = complete();
    let mut other = options(RICCATI, BANK);
    other.model.a[0][0] = -3.0;
    let refusal = other.with_gains(TS, &gains).unwrap_err();
    assert_eq!(refusal.key, "gains.main.L", "{refusal}");
    assert!(
        refusal.message.contains("residual of the Riccati equation"),
        "{refusal}"
    );
    let entry = entry(
        &other,
        &other.find_gains(TS).unwrap(),
        other.design(TS).unwrap().achieved,
    );
    let inputs = hash_of_inputs(&options(RICCATI, BANK), TS).unwrap();
    let refused = entry.belongs_to(HinfFilterOptions::METHOD, TS, &inputs);
    assert!(matches!(refused, Err(GainsError::OtherInputs { .. })));
}

#[test]
fn given_gains_must_be_those_of_the_configuration() {
    let options = options("type = \"given\"\nH = [[0.5, 0], [0, 0.5]]", "");
    let mut gains = options.find_gains(TS).unwrap().gains;
    gains.main.h.as_mut().unwrap()[0][1] = 1e-3;
    let refusal = options.with_gains(TS, &gains).unwrap_err();
    assert_eq!(refusal.key, "gains.main.design", "{refusal}");
}

#[test]
fn an_uncertified_gain_runs_only_if_allowed_and_says_so_everywhere() {
    // ‖T_rd‖∞ of no gain at all is 0.035.
    let tables = "type = \"given\"\nH = [[0, 0], [0, 0]]\nclaimed_bound = 0.03";
    assert!(options(tables, "").design(TS).is_err());
    let allowed = options(&format!("{tables}\nallow_uncertified = true"), "");
    let gains = allowed.find_gains(TS).unwrap().gains;
    assert_eq!(gains.main.label, "uncertified(claimed_bound_violated)");
    let designed = allowed.with_gains(TS, &gains).unwrap();
    assert_eq!(designed.achieved.violated(), None);
    let alarms = designed.achieved.false_alarms.unwrap();
    assert_eq!(alarms.probability_per_instant, None);
    for text in [&alarms.provided_that, &designed.warnings.join("\n")] {
        assert!(
            text.contains(&gains.main.label) && text.contains("0.035"),
            "{text}"
        );
    }
    assert!(
        designed
            .achieved
            .faults
            .iter()
            .all(|fault| fault.assurance == 0.0)
    );
}

#[test]
fn the_largest_gain_over_all_frequencies_is_the_norm_that_is_stated() {
    let (options, gains) = complete();
    let achieved = options.with_gains(TS, &gains).unwrap().achieved;
    let responses = options.responses(TS, &gains).unwrap();
    let largest = (0..20_000)
        .filter_map(|i| responses[0].singular_values(f64::from(i) / 20_000.0 * std::f64::consts::PI / TS))
        .fold(0.0_f64, |most, (_, gain)| most.max(gain));
    let stated = achieved
        .norms
        .iter()
        .any(|norm| (norm.value / largest - 1.0).abs() < 1e-6);
    assert!(stated, "{largest} in {:?}", achieved.norms);
}
