//! What the options choose, and what happens where the solver has nothing to offer (method sheet 3.6).

use crate::fixtures::{designed, found, servo};
use residual_diagnosis::reduced_order_observer::source::Source;
use residual_diagnosis::{
    method::MethodOptions,
    reduced_order_observer::options::{Gains, NamedM, Objective, ObserverM},
    spectrum::spectral_radius,
};
use residual_synthesis::reduced_order_observer::find_gains;

#[test]
fn auto_takes_the_slow_pole_for_the_floor_and_the_noise_aware_gain_for_the_width() {
    let mut options = servo([0.01; 2]);
    let (gains, design) = designed(&options);
    assert!(
        (design.main.observer.f[0] - 0.9).abs() < 1e-9,
        "{}",
        gains.gains.main.source
    );
    assert!((design.main.set_floors()[0] - 0.0351).abs() < 5e-5);
    assert!(
        gains.solver.is_empty() && gains.warnings.is_empty(),
        "{:?}",
        gains.warnings
    );

    options.design.objective = Objective::Width;
    let (gains, design) = designed(&options);
    let width = design.main.hull().sum();
    assert!((width - 0.34267).abs() < 1e-5, "{width}");
    assert!(
        gains.gains.main.source == Source::NoiseAware,
        "{}",
        gains.gains.main.source
    );
    assert!(gains.solver.len() == 1 && gains.solver[0].solver.contains("Clarabel"));
    // Narrower than the best closed form, K0.
    let closed = options.find_gains(0.1).unwrap().gains;
    assert_eq!(closed.main.source, Source::Particular);
    let closed = residual_diagnosis::reduced_order_observer::design::Design::with_gains(&options, &closed);
    assert!(width < closed.unwrap().main.hull().sum());
}

#[test]
fn the_bound_of_the_eigenvalues_of_f_holds_for_every_choice() {
    for gains in [Gains::Auto, Gains::H2] {
        let mut options = servo([0.01; 2]);
        options.design.gains = gains;
        options.design.spectral_radius_max = 0.3;
        let (found, design) = designed(&options);
        assert!(spectral_radius(&design.main.observer.f).unwrap() <= 0.3 + 1e-9);
        assert!(found.warnings.is_empty(), "{:?}", found.warnings);
        assert!(
            found.gains.main.source == Source::NoiseAware,
            "{}",
            found.gains.main.source
        );
    }
}

#[test]
fn without_a_decay_rate_the_papers_gain_takes_the_largest_radius_that_is_allowed() {
    let mut options = servo([0.01; 2]);
    options.design.gains = Gains::Lmi;
    options.design.spectral_radius_max = 0.2;
    let (gains, design) = designed(&options);
    assert!(gains.gains.main.source == Source::Paper(0.2));
    // F of the reference for a = 0.2.
    assert!((design.main.observer.f[0] - 0.11678483539).abs() < 1e-4);
}

#[test]
fn the_papers_m_is_schur_and_belongs_to_every_k() {
    for gains in [Gains::Auto, Gains::ClosedForm, Gains::Lmi] {
        let mut options = servo([0.01; 2]);
        options.design.gains = gains;
        options.design.poles = Some(vec![0.5]);
        options.design.observer_m = ObserverM::Named(NamedM::Lmi);
        options.design.lmi_decay_rate = Some(0.5);
        let (found, design) = designed(&options);
        assert!(
            found.warnings.is_empty() && !found.solver.is_empty(),
            "{:?}",
            found.warnings
        );
        let radius = spectral_radius(&design.main.observer.m).unwrap();
        assert!(
            design.main.observer.m.amax() > 1e-6 && radius <= 0.5 + 1e-6,
            "{radius}"
        );
    }
}

#[test]
fn what_the_solver_cannot_do_falls_back_to_closed_forms_with_a_warning() {
    // No noise: nothing to be aware of.
    let mut silent = servo([0.0; 2]);
    silent.design.gains = Gains::H2;
    // A decay rate beyond what any P of acceptable condition certifies.
    let mut hasty = servo([0.01; 2]);
    hasty.design.gains = Gains::Lmi;
    hasty.design.lmi_decay_rate = Some(1e-7);
    // Slower than allowed.
    let mut slow = servo([0.01; 2]);
    slow.design.gains = Gains::Lmi;
    slow.design.lmi_decay_rate = Some(0.9);
    slow.design.spectral_radius_max = 0.4;
    for (options, word) in [(silent, "noise"), (hasty, "decay rate"), (slow, "|eig F|")] {
        let (found, design) = designed(&options);
        let text = found.warnings.join("; ");
        assert!(
            text.contains(word) && text.contains("closed-form gains are used instead"),
            "{text}"
        );
        let source = &design.gains.main.source;
        assert!(
            matches!(source, Source::Particular | Source::Poles(_)),
            "{source}"
        );
        let loaded = &design.warnings;
        assert!(
            loaded.iter().any(|text| text.contains("fell back to")),
            "{loaded:?}"
        );
        assert!(found.solver.is_empty());
    }
    let mut no_m = servo([0.01; 2]);
    no_m.design.observer_m = ObserverM::Named(NamedM::Lmi);
    no_m.design.lmi_decay_rate = Some(1e-7);
    let (found, design) = designed(&no_m);
    assert!(
        found.warnings.join("; ").contains("M = 0"),
        "{:?}",
        found.warnings
    );
    assert_eq!(design.main.observer.m.amax(), 0.0);
}

#[test]
fn as_many_disturbances_as_outputs_leave_one_gain_and_no_warning() {
    let mut options = servo([0.01; 2]);
    options.model.d = vec![vec![-0.1, 0.0], vec![0.2, 0.3], vec![-0.1, 0.1]];
    options.model.disturbance_lower = vec![-1.0; 2];
    options.model.disturbance_upper = vec![1.0; 2];
    for gains in [Gains::Auto, Gains::H2, Gains::Lmi] {
        options.design.gains = gains;
        let found = found(&options);
        assert_eq!(found.gains.main.source, Source::Particular);
        assert!(
            !found
                .warnings
                .iter()
                .any(|warning| warning.contains("inequality")),
            "{:?}",
            found.warnings
        );
    }
}

#[test]
fn longer_work_is_announced_and_a_plant_without_observer_is_refused() {
    let options = servo([0.01; 2]);
    let mut heard = Vec::new();
    find_gains(&options, 0.1, &mut |work| heard.push(work.to_owned())).unwrap();
    assert_eq!(heard.len(), 4, "{heard:?}");
    let mut unstable = options;
    unstable.model.a = vec![vec![0.4, 0.0, 1.0], vec![0.0, 0.3, 1.0], vec![0.1, 0.1, 1.5]];
    unstable.model.d = vec![vec![1.0, 0.0], vec![0.0, 1.0], vec![0.0, 0.0]];
    unstable.model.disturbance_lower = vec![-1.0; 2];
    unstable.model.disturbance_upper = vec![1.0; 2];
    let refusal = find_gains(&unstable, 0.1, &mut |_| ()).unwrap_err();
    assert!(
        refusal.key == "model.D" && refusal.message.contains("invariant zero 1.5"),
        "{refusal}"
    );
}
