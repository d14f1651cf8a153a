//! Test directions by linear programs: method sheet 3.8, rule 4.

use crate::fixtures::designed;
use crate::simulation::random_plant;
use nalgebra::DVector;
use residual_diagnosis::{
    method::MethodOptions,
    reduced_order_observer::{
        design::Design, floors::step_response, observer_design::ObserverDesign,
        options::ReducedOrderObserverOptions,
    },
};
use residual_synthesis::linear_program::LinearProgram;

/// Seeds of random plants with four outputs, noise and disturbance.
fn plants() -> Vec<ReducedOrderObserverOptions> {
    let four = |seed: &u64| {
        let model = random_plant(*seed);
        model.c.len() == 4 && !model.d[0].is_empty() && !seed.is_multiple_of(3) && model.a.len() > 4
    };
    let seeds = (0..200).filter(four).take(5);
    seeds
        .map(|seed| ReducedOrderObserverOptions {
            model: random_plant(seed),
            ..ReducedOrderObserverOptions::default()
        })
        .collect()
}

/// The smallest t with g in t Z, where Z is the unreduced steady set of the residual.
pub fn gauge(design: &Design, g: &DVector<f64>) -> f64 {
    let p = design.plant.outputs();
    let noise = nalgebra::DMatrix::from_diagonal(&design.plant.noise_bound);
    let columns: Vec<DVector<f64>> = std::iter::once(noise)
        .chain(
            design
                .main
                .reach
                .generators
                .iter()
                .map(|x| x.rows(0, p).into_owned()),
        )
        .flat_map(|matrix| {
            matrix
                .column_iter()
                .map(|column| column.into_owned())
                .collect::<Vec<_>>()
        })
        .filter(|column| column.norm() > 1e-9)
        .collect();
    let mut program = LinearProgram::default();
    let xi = program.add_variables(columns.len());
    let t = program.add_variables(1);
    program.add_cost(t, 1.0);
    for i in 0..p {
        program.equal(
            columns.iter().enumerate().map(|(j, column)| (xi + j, column[i])),
            g[i],
        );
    }
    for j in 0..columns.len() {
        program.at_most([(xi + j, 1.0), (t, -1.0)], 0.0);
        program.at_most([(xi + j, -1.0), (t, -1.0)], 0.0);
    }
    program.solve().unwrap().objective
}

/// The floor that the rows guarantee k samples after the onset.
fn floor(design: &ObserverDesign, actuator: usize, k: usize) -> f64 {
    let sizes = residual_diagnosis::reduced_order_observer::floors::certain_sizes(
        &design.observer,
        &design.tests,
        &design.steady(),
        actuator,
    );
    sizes[k]
}

#[test]
fn with_four_outputs_the_directions_attain_what_an_exact_membership_test_could_guarantee() {
    let mut better = 0;
    for options in plants() {
        let (found, design) = designed(&options);
        assert!(
            !found.warnings.iter().any(|warning| warning.contains("solver")),
            "{:?}",
            found.warnings
        );
        for actuator in 0..design.plant.actuators() {
            let response = step_response(&design.main.observer, actuator);
            for k in [1, 3, 200] {
                let exact = 2.0 / gauge(&design, &response[k]);
                let attained = floor(&design.main, actuator, k);
                assert!(attained >= exact * (1.0 - 1e-6), "{attained} below {exact}");
                assert!(attained <= exact * 1.01, "{attained} instead of {exact}");
            }
        }
        // Without a solver the same gains are tested by fewer directions, and that is said.
        let without = options.find_gains(0.1).unwrap();
        assert!(without.warnings[0].contains("needs") || without.warnings[0].contains("need a solver"));
        let without = Design::with_gains(&options, &without.gains).unwrap();
        better += usize::from(without.main.set_floors().max() > 1.01 * design.main.set_floors().max());
    }
    assert!(better > 0);
}
