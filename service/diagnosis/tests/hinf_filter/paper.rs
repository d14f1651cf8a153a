//! The paper's example: its plant, its runs, and how a filter is built and driven.

use crate::kernels::matrix;
use crate::support::{channel_of, reference_of, rows};
use nalgebra::{DMatrix, DVector};
use residual_diagnosis::{
    diagnoser::{Channel, Diagnoser, StepInput, StepRecord},
    hinf_filter::{HinfFilter, options::HinfFilterOptions, plant::Plant},
};
use serde_json::Value;

pub const TS: f64 = 0.01;

/// The plant of a reference file.
pub fn plant(value: &Value) -> Plant {
    let [a, b, c, d, bd, dd, bf, df] =
        ["A", "B", "C", "D", "Bd", "Dd", "Bf", "Df"].map(|key| matrix(&value[key]));
    Plant {
        a,
        b,
        c,
        d,
        bd,
        dd,
        bf,
        df,
    }
}

/// The paper's plant.
pub fn paper_plant() -> Plant {
    plant(&reference_of("hinf_filter", "paper_facts.json")["plant"])
}

/// `[model]` of a plant as TOML, with further entries.
pub fn model_table(value: &Value, more: &str) -> String {
    let mut text = format!("[model]\n{more}\n");
    for key in ["A", "B", "C", "D", "Bd", "Dd", "Bf", "Df"] {
        text += &format!("{key} = {}\n", value[key]);
    }
    text
}

/// Options of the paper's plant with further tables.
pub fn paper_options(tables: &str) -> HinfFilterOptions {
    let plant = &reference_of("hinf_filter", "paper_facts.json")["plant"];
    toml::from_str(&format!("{}{tables}", model_table(plant, ""))).unwrap()
}

/// The tables of the reference's windowed runs: |d|, |d'| <= 0.01, window 1 s, from rest.
pub fn windowed(synthesis: &str) -> String {
    format!(
        "[disturbance]\namplitude = [0.01]\nslew = [0.01]\n[synthesis]\n{synthesis}\n[filter]\ninitial = \"given\"\n\
         initial_error_bound = [0, 0]\n"
    )
}

/// The reference's riccati design.
pub const RICCATI: &str = "disturbance_weight = [1.0]\nnoise_weight = [0.002, 0.002]";

/// `key = matrix` of a reference matrix.
pub fn given(key: &str, value: &Value) -> String {
    format!("{key} = {value}\n")
}

/// One step with a sample (or none) and a command.
pub fn step(filter: &mut HinfFilter, y: &[f64], u: &[f64]) -> StepRecord {
    let mut record = StepRecord::new(filter.description().channels.len());
    filter.step(&StepInput::new(y, u), &mut record);
    record
}

/// The channel with this name.
pub fn channel(filter: &HinfFilter, record: &StepRecord, name: &str) -> Channel {
    channel_of(filter, record, name)
}

/// The exact sampled plant of `paper_runs.json` for one of its cases.
pub struct PaperPlant {
    phi: DMatrix<f64>,
    q: DMatrix<f64>,
    z: DVector<f64>,
    scales: (f64, f64),
    /// Phase of the disturbance, rad.
    pub phase: f64,
    k: usize,
}

impl PaperPlant {
    pub fn new(case: &str) -> Self {
        let file = reference_of("hinf_filter", "paper_runs.json");
        let generator = &file["generator"];
        let scale = |key: &str| generator["cases"][case][key].as_f64().unwrap();
        Self {
            phi: matrix(&generator["Phi"]),
            q: matrix(&generator["Q"]),
            z: DVector::zeros(9),
            scales: (scale("f1_scale"), scale("f2_scale")),
            phase: 0.0,
            k: 0,
        }
    }

    /// f1, f2 at t_k and their rates.
    pub fn faults(&self) -> [f64; 4] {
        let (s1, s2) = self.scales;
        // The edges lie on sampling instants; k decides, not a rounded time.
        let t = self.k as f64 * TS;
        let (f1, rate) = match self.k {
            1500..2000 => (0.04 * (t - 15.0), 0.04),
            2000..2500 => (0.2 - 0.04 * (t - 20.0), -0.04),
            _ => (0.0, 0.0),
        };
        let f2 = if (1500..2000).contains(&self.k) { 0.2 } else { 0.0 };
        [f1 * s1, f2 * s2, rate * s1, 0.0]
    }

    /// y_k, and on to the next instant.
    pub fn next(&mut self) -> Vec<f64> {
        let t = self.k as f64 * TS;
        self.z[2] = 1.0;
        self.z[3] = 0.01 * (t + self.phase).sin();
        self.z[4] = 0.01 * (t + self.phase).cos();
        for (i, value) in self.faults().into_iter().enumerate() {
            self.z[5 + i] = value;
        }
        let y = &self.q * &self.z;
        self.z = &self.phi * &self.z;
        self.k += 1;
        y.as_slice().to_vec()
    }
}

#[test]
fn the_generator_gives_the_samples_of_the_reference() {
    let file = reference_of("hinf_filter", "paper_runs.json");
    let mut plant = PaperPlant::new("1");
    for (k, expected) in rows(&file["y_full_case_1"]["y"]).iter().enumerate() {
        let y = plant.next();
        assert!(
            (0..2).all(|i| (y[i] - expected[i]).abs() < 1e-12),
            "{k}: {y:?} {expected:?}"
        );
    }
}
