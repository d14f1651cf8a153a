//! One small configuration per mistake: each is refused at its key, with the condition that does not hold.

use residual_diagnosis::{
    hinf_filter::options::HinfFilterOptions,
    method::{MethodOptions, Refusal},
};

const MODEL: &str = "[model]\nA = [[-3.37, 1.636], [-0.325, -1.896]]\nB = [[0.5], [0.4]]\nC = [[1, 0], [0, 1]]\nD = [[0], \
                     [0.267]]\nBd = [[0.01], [0.01]]\nDd = [[0.02], [0.02]]\nBf = [[0.586, 0], [0.41, 0]]\nDf = [[0, \
                     1], [0.267, 0]]\n";
const DISTURBANCE: &str = "[disturbance]\namplitude = [0.01]\n";

fn refusal(text: &str) -> Refusal {
    let options: HinfFilterOptions = toml::from_str(text).unwrap();
    options.design(0.01).unwrap_err()
}

#[track_caller]
fn assert_refused(text: &str, key: &str, words: &[&str]) {
    let refusal = refusal(text);
    assert_eq!(refusal.key, key, "{refusal}");
    for word in words {
        assert!(refusal.message.contains(word), "no {word:?} in: {refusal}");
    }
    assert!(refusal.message.contains("; "), "no advice in: {refusal}");
}

fn with(tables: &str) -> String {
    format!("{MODEL}{DISTURBANCE}{tables}")
}

fn replaced(from: &str, to: &str) -> String {
    let text = with("");
    assert!(text.contains(from), "{from}");
    text.replace(from, to)
}

#[test]
fn shapes_that_do_not_fit() {
    assert_refused(
        &replaced("B = [[0.5], [0.4]]", "B = [[0.5]]"),
        "model.B",
        &["1 x 1", "2 x 1"],
    );
    assert_refused(
        &replaced("C = [[1, 0], [0, 1]]", "C = [[1, 0, 0], [0, 1, 0]]"),
        "model.C",
        &["2 x 3"],
    );
    assert_refused(
        &replaced("Dd = [[0.02], [0.02]]", "Dd = [[0.02]]"),
        "model.Dd",
        &["1 x 1"],
    );
    assert_refused(
        &replaced("[[0, 1], [0.267, 0]]", "[[0], [0.267]]"),
        "model.Df",
        &["2 x 1"],
    );
    assert_refused(
        &replaced("A = [[-3.37, 1.636],", "A = [[-3.37],"),
        "model.A.1",
        &["2 entries"],
    );
    assert_refused(
        &replaced("Bf = [[0.586, 0], [0.41, 0]]", "Bf = [[], []]"),
        "model.Df",
        &["2 x 2"],
    );
    assert_refused(
        &replaced("D = [[0], [0.267]]", "D = [[0], [0.267]]\noutput_units = [\"m\"]"),
        "model.output_units",
        &[],
    );
}

#[test]
fn entries_that_are_not_finite() {
    assert_refused(
        &replaced("C = [[1, 0]", "C = [[inf, 0]"),
        "model.C",
        &["inf", "row 0, column 0"],
    );
    assert_refused(&replaced("Bd = [[0.01]", "Bd = [[nan]"), "model.Bd", &["NaN"]);
}

fn two_states(a: &str, c: &str) -> String {
    format!(
        "[model]\nA = {a}\nB = [[1], [1]]\nC = {c}\nBd = [[1], [0]]\nDd = [[1]]\nBf = [[1], [1]]\nDf = [[1]]\n\
         [disturbance]\namplitude = [1]\n[filter]\ninitial = \"given\"\ninitial_error_bound = [0, 0]\n"
    )
}

#[test]
fn an_unstable_mode_that_no_output_shows() {
    let hidden = two_states("[[0.3, 0], [0, -1]]", "[[0, 1]]");
    assert_refused(&hidden, "model.C", &["0.3", "not observable"]);
}

#[test]
fn an_unstable_mode_although_stability_is_required() {
    let unstable = two_states("[[0.3, 0], [0, -1]]", "[[1, 1]]");
    assert_refused(&unstable, "model.A", &["0.3", "require_stable"]);
    let allowed = unstable.replace("[disturbance]", "require_stable = false\n[disturbance]");
    let options: HinfFilterOptions = toml::from_str(&allowed).unwrap();
    options.design(0.01).unwrap();
}

#[test]
fn a_mode_that_sampling_hides() {
    // An undamped oscillation of exactly one turn per period looks like two constants.
    let turn = std::f64::consts::TAU / 0.01;
    let text = two_states(&format!("[[0, {turn}], [-{turn}, 0]]"), "[[1, 0]]");
    let text = text.replace("[disturbance]", "require_stable = false\n[disturbance]");
    assert_refused(&text, "model.C", &["sampled", "sample_time_s"]);
}

#[test]
fn listed_models_that_are_not_stable() {
    let text = replaced(
        "[disturbance]",
        "listed_models = [{ A = [[1, 0], [0, -1]] }]\n[disturbance]",
    );
    assert_refused(&text, "model.listed_models.0.A", &["1.000000"]);
    let text = replaced(
        "[disturbance]",
        "listed_models = [{ A = [[-1, 0]] }]\n[disturbance]",
    );
    assert_refused(&text, "model.listed_models.0.A", &["1 x 2"]);
}

#[test]
fn a_design_without_optimum() {
    let text = replaced("Dd = [[0.02], [0.02]]", "Dd = [[0], [0]]");
    let continuous = format!("{text}[synthesis]\ntype = \"riccati_ct\"\n");
    assert_refused(&continuous, "synthesis.noise_weight", &["noise weight"]);
    let discrete = format!("{text}[synthesis]\nnoise_weight = [0, 0]\n");
    assert_refused(&discrete, "synthesis.noise_weight", &["singular"]);
}

#[test]
fn windows_that_are_no_whole_number_of_periods() {
    for window in ["0.015", "0.0", "-1.0", "nan", "0.004"] {
        assert_refused(
            &with(&format!("[evaluation]\nwindow = {window}\n")),
            "evaluation.window",
            &["whole number"],
        );
    }
}

#[test]
fn bounds_and_weights_outside_their_range() {
    let bad = |from: &str, to: &str, key: &str, word: &str| assert_refused(&replaced(from, to), key, &[word]);
    bad(
        "amplitude = [0.01]",
        "amplitude = [0.0]",
        "disturbance.amplitude.0",
        "positive",
    );
    bad(
        "amplitude = [0.01]",
        "amplitude = [0.01, 0.01]",
        "disturbance.amplitude",
        "length 2",
    );
    bad(
        "amplitude = [0.01]",
        "amplitude = [0.01]\nslew = [-1.0]",
        "disturbance.slew.0",
        "negative",
    );
    bad(
        "amplitude = [0.01]",
        "window_energy = 0.0",
        "disturbance.window_energy",
        "positive",
    );
    bad(
        "amplitude = [0.01]",
        "amplitude = [0.01]\nwindow_energy = 1.0",
        "disturbance.window_energy",
        "one of them",
    );
    bad("amplitude = [0.01]", "", "disturbance.amplitude", "missing");
    bad(
        "amplitude = [0.01]",
        "amplitude = [0.01]\nnoise_std = [0.0, 1.0]",
        "disturbance.noise_std.0",
        "positive",
    );
    for (tables, key, word) in [
        (
            "[synthesis]\ndisturbance_weight = [0.0]",
            "synthesis.disturbance_weight.0",
            "positive",
        ),
        (
            "[synthesis]\nnoise_weight = [0.1]",
            "synthesis.noise_weight",
            "length 1",
        ),
        (
            "[synthesis]\nnoise_weight = [0.1, -0.1]",
            "synthesis.noise_weight.1",
            "negative",
        ),
        ("[synthesis]\nmax_gain = 0.0", "synthesis.max_gain", "positive"),
        ("[synthesis]\nmax_gain = 1e-6", "synthesis.max_gain", "limit"),
        (
            "[filter]\njitter_tolerance = 1.5",
            "filter.jitter_tolerance",
            "part of the period",
        ),
        (
            "[filter]\ninitial_state = [1.0]",
            "filter.initial_state",
            "length 1",
        ),
        (
            "[filter]\ninitial_error_bound = [1.0, -1.0]",
            "filter.initial_error_bound.1",
            "negative",
        ),
        (
            "[filter]\ninitial_error_norm = -1.0",
            "filter.initial_error_norm",
            "positive",
        ),
        (
            "[filter]\ninitial_error_norm = 1.0\ninitial_error_bound = [1, 1]",
            "filter.initial_error_norm",
            "one of them",
        ),
        (
            "[filter]\ninitial = \"given\"",
            "filter.initial_error_bound",
            "missing",
        ),
    ] {
        assert_refused(&with(tables), key, &[word]);
    }
}

#[test]
fn options_that_do_not_fit_together() {
    for (tables, key, word) in [
        (
            "[evaluation]\nthreshold = \"constant\"",
            "evaluation.constant_threshold",
            "missing",
        ),
        (
            "[evaluation]\nthreshold = \"constant\"\nconstant_threshold = -1.0",
            "evaluation.constant_threshold",
            "positive",
        ),
        (
            "[evaluation]\nconstant_threshold = 1.0",
            "evaluation.constant_threshold",
            "guaranteed",
        ),
        (
            "[evaluation]\npeak_test = true\nthreshold = \"constant\"\nconstant_threshold = 1.0",
            "evaluation.peak_test",
            "guaranteed",
        ),
        (
            "[filter]\nrealisation = \"filter_foh\"",
            "filter.realisation",
            "continuous gain",
        ),
        (
            "[filter]\nrealisation = \"filter_foh\"\n[synthesis]\ntype = \"given\"\nL = [[0, 0], [0, 0]]",
            "synthesis.H",
            "continuous gain",
        ),
        ("[synthesis]\nL = [[0, 0], [0, 0]]", "synthesis.L", "given"),
        (
            "[synthesis]\nclaimed_bound = 1.0",
            "synthesis.claimed_bound",
            "given",
        ),
        ("[synthesis]\ntype = \"given\"", "synthesis.L", "missing"),
        (
            "[synthesis]\ntype = \"given\"\nL = [[0, 0], [0, 0]]\nH = [[0, 0], [0, 0]]",
            "synthesis.L",
            "one of them",
        ),
        (
            "[synthesis]\ntype = \"given\"\nL = [[0, 0]]",
            "synthesis.L",
            "1 x 2",
        ),
        (
            "[synthesis]\ntype = \"given\"\nL = [[0, 0], [0, 0]]\nV = [[0, 0]]",
            "synthesis.V",
            "not zero",
        ),
        (
            "[synthesis]\ntype = \"given\"\nL = [[0, 0], [0, 0]]\npole_radius = 1.0",
            "synthesis.pole_radius",
            "pole_decay",
        ),
    ] {
        assert_refused(&with(tables), key, &[word]);
    }
    let noise = replaced("amplitude = [0.01]", "amplitude = [0.01]\nnoise_std = [0.1, 0.1]");
    assert_refused(
        &format!("{noise}[evaluation]\nwindow = \"cumulative\"\n"),
        "disturbance.noise_std",
        &["cumulative"],
    );
    let energy = replaced("amplitude = [0.01]", "window_energy = 0.1\nslew = [0.1]");
    assert_refused(
        &format!("{energy}[evaluation]\nwindow = \"cumulative\"\n"),
        "disturbance.slew",
        &["cumulative"],
    );
    let energy = replaced("amplitude = [0.01]", "window_energy = 0.1");
    assert_refused(
        &format!("{energy}[evaluation]\npeak_test = true\n"),
        "evaluation.peak_test",
        &["amplitude"],
    );
    assert_refused(
        &format!("{energy}[isolation]\nblind_sets = [[\"f1\"]]\nfault_bound = [1, 1]\n"),
        "isolation",
        &["amplitude"],
    );
    let listed = replaced(
        "[disturbance]",
        "listed_models = [{ A = [[-3, 0], [0, -1]] }]\n[disturbance]",
    );
    assert_refused(
        &format!("{listed}[synthesis]\ntype = \"riccati_ct\"\n[filter]\nrealisation = \"filter_zoh\"\n"),
        "model.listed_models",
        &["discrete_observer"],
    );
}

#[test]
fn gains_that_fail_their_certificate() {
    let given = |gain: &str| with(&format!("[synthesis]\ntype = \"given\"\n{gain}\n"));
    assert_refused(
        &given("L = [[2.5, 0], [0, 2.5]]"),
        "synthesis.type",
        &["not stable", "-1.5"],
    );
    assert_refused(
        &given("H = [[-5, 0], [0, 0]]"),
        "synthesis.type",
        &["continuous", "not stable"],
    );
    let half = "H = [[0.5, 0], [0, 0.5]]";
    let claim = |claim: &str| given(&format!("{half}\n{claim}"));
    assert_refused(
        &claim("claimed_bound = 0.028"),
        "synthesis.type",
        &["below σ_max(Dd)"],
    );
    let open = given("H = [[0, 0], [0, 0]]\nclaimed_bound = 0.03");
    assert_refused(&open, "synthesis.type", &["above the claimed bound", "0.035"]);
    assert_refused(
        &claim("pole_decay = 3.1"),
        "synthesis.type",
        &["-3.025907", "Re λ < -3.1"],
    );
    assert_refused(&claim("pole_radius = 3.1"), "synthesis.type", &["-3.240093"]);
    let discrete = given("L = [[0.005, 0], [0, 0.005]]\npole_decay = 50.0");
    assert_refused(&discrete, "synthesis.type", &["|λ| <"]);
    let allowed = claim("pole_decay = 3.1\nallow_uncertified = true");
    let options: HinfFilterOptions = toml::from_str(&allowed).unwrap();
    let designed = options.design(0.01).unwrap();
    assert!(
        designed.warnings[0].contains("uncertified"),
        "{:?}",
        designed.warnings
    );
    // A claim that holds is accepted.
    let options: HinfFilterOptions =
        toml::from_str(&claim("claimed_bound = 0.0283\npole_decay = 3.0")).unwrap();
    options.design(0.01).unwrap();
}

#[test]
fn a_matched_gain_that_does_not_exist() {
    let text = replaced("Bd = [[0.01], [0.01]]", "Bd = [[0.01, 1], [0.01, 0]]")
        .replace("Dd = [[0.02], [0.02]]", "Dd = [[0.02, 0], [0.02, 0]]")
        .replace("amplitude = [0.01]", "amplitude = [0.01, 0.01]");
    assert_refused(
        &format!("{text}[synthesis]\ntype = \"matched\"\n"),
        "synthesis.type",
        &["matched"],
    );
}

#[test]
fn banks_that_cannot_isolate() {
    let bank = |tables: &str| with(&format!("[isolation]\nfault_bound = [1, 1]\n{tables}\n"));
    for (tables, key, word) in [
        ("blind_sets = [[\"f3\"]]", "isolation.blind_sets.0", "no fault"),
        (
            "blind_sets = [[\"f1\", \"f1\"]]",
            "isolation.blind_sets.0",
            "twice",
        ),
        (
            "blind_sets = [[\"f1\", \"f2\"]]",
            "isolation.blind_sets.0",
            "not all",
        ),
        ("blind_sets = [[]]", "isolation.blind_sets.0", "some of them"),
        (
            "fault_names = [\"pump\"]",
            "isolation.fault_names",
            "one per column",
        ),
        (
            "fault_names = [\"pump\", \"pump\"]",
            "isolation.fault_names.1",
            "twice",
        ),
        ("blind_weight = 0.0", "isolation.blind_weight", "positive"),
        ("isolation_wait = -1.0", "isolation.isolation_wait", "positive"),
        ("fault_slew = [1.0]", "isolation.fault_slew", "length 1"),
    ] {
        assert_refused(&bank(tables), key, &[word]);
    }
    // Both faults act through the same column.
    let same = bank("blind_sets = [[\"f1\"]]")
        .replace(
            "Bf = [[0.586, 0], [0.41, 0]]",
            "Bf = [[0.586, 0.586], [0.41, 0.41]]",
        )
        .replace("Df = [[0, 1], [0.267, 0]]", "Df = [[0, 0], [0.267, 0.267]]");
    assert_refused(&same, "isolation.blind_sets.0", &["f2", "same directions"]);
    let wide =
        bank("fault_estimate = true").replace("Df = [[0, 1], [0.267, 0]]", "Df = [[0, 0], [0.267, 0.534]]");
    assert_refused(&wide, "isolation.fault_estimate", &["column rank"]);
    let unstable = bank("fault_estimate = true")
        .replace("Df = [[0, 1], [0.267, 0]]", "Df = [[0, 1], [0.0267, 0]]")
        .replace("Bf = [[0.586, 0], [0.41, 0]]", "Bf = [[-5.86, 0], [-4.1, 0]]");
    assert_refused(&unstable, "isolation.fault_estimate", &["modulus"]);
    let sets: Vec<_> = (0..31).map(|_| "[\"f1\"]").collect();
    let many = bank(&format!("blind_sets = [{}]", sets.join(", ")));
    assert_refused(&many, "isolation.blind_sets", &["96", "64"]);
}

#[test]
fn designs_by_matrix_inequalities_need_a_solver() {
    for kind in ["lmi_paper", "lmi_two_stage_dt", "lmi_two_stage_ct", "lmi_mixed"] {
        let text = with(&format!("[synthesis]\ntype = \"{kind}\"\n"));
        let options: HinfFilterOptions = toml::from_str(&text).unwrap();
        options.validate(0.01).unwrap();
        assert_eq!(options.needs_solver().unwrap().key, "synthesis.type");
        assert_refused(&text, "synthesis.type", &[kind, "residuald design", "riccati_dt"]);
    }
    let options: HinfFilterOptions = toml::from_str(&with("")).unwrap();
    assert_eq!(options.needs_solver(), None);
}

#[test]
fn keys_of_the_synthesis_that_do_not_belong_to_its_type() {
    for (tables, key, word) in [
        ("type = \"riccati_dt\"\nslack = 0.01", "slack", "lmi_two_stage_dt"),
        ("type = \"lmi_mixed\"\nslack = 0.01", "slack", "lmi_two_stage_ct"),
        ("type = \"lmi_two_stage_dt\"\nslack = 2.0", "slack", "at most 1"),
        ("type = \"lmi_two_stage_dt\"\nslack = -0.1", "slack", "positive"),
        (
            "type = \"lmi_two_stage_dt\"\npole_radius = 10.0",
            "pole_radius",
            "radius_z",
        ),
        (
            "type = \"lmi_two_stage_ct\"\nradius_z = 0.9",
            "radius_z",
            "pole_radius",
        ),
        (
            "type = \"lmi_two_stage_dt\"\nradius_z = 1.0",
            "radius_z",
            "below 1",
        ),
        (
            "type = \"lmi_two_stage_ct\"\npole_decay = 3.0\npole_radius = 2.0",
            "pole_decay",
            "smaller",
        ),
        (
            "type = \"lmi_paper\"\npole_decay = 3.0",
            "pole_decay",
            "lmi_mixed",
        ),
        ("type = \"riccati_ct\"\npole_decay = 3.0", "pole_decay", "given"),
        (
            "type = \"lmi_mixed\"\nrecovery = \"sound\"",
            "recovery",
            "lmi_paper",
        ),
        ("normalisation = \"printed\"", "normalisation", "lmi_paper"),
        (
            "type = \"lmi_paper\"\nclaimed_bound = 1.0",
            "claimed_bound",
            "given",
        ),
    ] {
        assert_refused(
            &with(&format!("[synthesis]\n{tables}\n")),
            &format!("synthesis.{key}"),
            &[word],
        );
    }
    let silent = replaced("Dd = [[0.02], [0.02]]", "Dd = [[0], [0]]");
    for kind in ["lmi_two_stage_ct", "lmi_mixed", "lmi_paper"] {
        let text = format!("{silent}[synthesis]\ntype = \"{kind}\"\n");
        assert_refused(
            &text,
            "synthesis.type",
            &["larger and larger gains", "pole_radius"],
        );
    }
    let bounded = format!("{silent}[synthesis]\ntype = \"lmi_two_stage_ct\"\npole_radius = 50.0\n");
    toml::from_str::<HinfFilterOptions>(&bounded)
        .unwrap()
        .validate(0.01)
        .unwrap();
    let held = with("[synthesis]\ntype = \"lmi_two_stage_dt\"\n[filter]\nrealisation = \"filter_foh\"\n");
    assert_refused(&held, "filter.realisation", &["continuous"]);
}
