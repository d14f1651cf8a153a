//! Nothing allocates after construction, for the plants that only the library can be given as well.

#[path = "../conformance/allocation.rs"]
mod counter;

use crate::servo::servo;
use crate::simulation::Draw;
use residual_diagnosis::async_imm::{
    design::{Form, ImmDesign},
    estimator::{ImmEstimator, Sample},
    fusion::Fusion,
    inputs::InputHistory,
    plant::{Plant, PlantRates},
};
use std::sync::Arc;

fn plants() -> Vec<Plant> {
    let (_, design) = servo();
    let Plant::Constant(plant) = design.plant else {
        panic!()
    };
    let mut faster = plant.clone();
    faster.a *= 2.0;
    let copy = plant.clone();
    let function = move |time: f64, command: &[f64], rates: &mut PlantRates| {
        for i in 0..2 {
            for j in 0..2 {
                rates.a[(i, j)] = copy.a[(i, j)] * (1.0 + 0.1 * time);
                rates.noise[(i, j)] = copy.noise[(i, j)];
            }
            rates.f[(i, 0)] = copy.f[(i, 0)];
            rates.input[i] = copy.b[(i, 0)] * command[0];
        }
    };
    vec![
        Plant::Constant(plant.clone()),
        Plant::Schedule(vec![(0, plant), (1_230_000_000, faster)]),
        Plant::Function {
            states: 2,
            inputs: 1,
            channels: 1,
            function: Arc::new(function),
        },
    ]
}

#[test]
fn no_form_allocates_with_any_kind_of_plant() {
    for plant in plants() {
        for form in [
            Form::Sequential,
            Form::SequentialSquareRoot,
            Form::BatchUnobserved,
        ] {
            for walk in [0.0, 0.5] {
                if form == Form::BatchUnobserved && walk > 0.0 {
                    continue;
                }
                let mut design = ImmDesign {
                    plant: plant.clone(),
                    form,
                    ..servo().1
                };
                design.modes[1].random_walk_psd = vec![walk];
                let mut estimator = ImmEstimator::new(&design, 8).unwrap();
                let mut fusion = Fusion::new(&design);
                let mut posterior = estimator.start(0);
                let commands = InputHistory::with_changes(&[0.0], &[(777_000_000, vec![1.0])]);
                let mut draw = Draw::new(1);
                for k in 1..=20_i64 {
                    let values = [draw.normal()];
                    let samples = (0..3).map(|i| Sample {
                        time_ns: k * 100_000_000 - 30_000_000 + 7_000_000 * i,
                        sensor: i as usize % 2,
                        values: &values,
                        held_before: None,
                    });
                    let mut used = 0;
                    let count = counter::allocations(|| {
                        used = estimator
                            .advance(&mut posterior, k * 100_000_000, samples, &commands)
                            .used;
                        fusion.fuse(&posterior);
                        fusion.read_amplitudes(&posterior, 0);
                    });
                    assert_eq!((count, used), (0, 3), "{form:?} {plant:?} at {k}");
                }
            }
        }
    }
}
