//! Packet loss put into a replay: samples are left out at random, their numbers count on, so the loss is known.

use std::str::FromStr;

use rand::{RngExt as _, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::mapping::TimedSample;
use super::recording::Run;
use crate::configuration::Configuration;

/// Stands for every input that is not named.
const EVERY_INPUT: &str = "all";

/// Which share of the samples of which inputs is lost; each sample independently of all others.
#[derive(Clone, Debug, PartialEq)]
pub struct Loss {
    /// Inputs and the probability, 0 to 1, that a sample of theirs is lost.
    pub shares: Vec<(String, f64)>,
    /// Seed: the same one loses the same samples.
    pub seed: u64,
}

/// Why a loss could not be understood or injected.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LossError {
    /// The text is not of the form.
    #[error("`{text}`: {reason}; write for example `gyroscope=0.3,seed=1` or `all=0.1`")]
    Syntax {
        /// What was given.
        text: String,
        /// What is wrong with it.
        reason: String,
    },
    /// There is no such input.
    #[error("there is no input `{input}` to lose samples of; the inputs are: {inputs}")]
    NoInput {
        /// What was named.
        input: String,
        /// The inputs there are.
        inputs: String,
    },
}

impl FromStr for Loss {
    type Err = LossError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let syntax = |reason: String| LossError::Syntax {
            text: text.into(),
            reason,
        };
        let (mut shares, mut seed) = (Vec::new(), 0);
        for part in text.split(',').map(str::trim) {
            let (key, value) = part
                .split_once('=')
                .ok_or_else(|| syntax(format!("`{part}` is not key=value")))?;
            if key == "seed" {
                seed = value
                    .parse()
                    .map_err(|_| syntax(format!("the seed `{value}` is not a whole number from 0 on")))?;
                continue;
            }
            let share = value.parse().ok().filter(|share| (0.0..=1.0).contains(share));
            let share = share.ok_or_else(|| syntax(format!("`{value}` is no share from 0 to 1")))?;
            shares.push((key.to_owned(), share));
        }
        if shares.is_empty() {
            return Err(syntax("no input is named".into()));
        }
        Ok(Self { shares, seed })
    }
}

impl Loss {
    /// Refuses names that no input has.
    pub fn check(&self, configuration: &Configuration) -> Result<(), LossError> {
        let known = |name: &str| configuration.inputs.iter().any(|input| input.name == name);
        let unknown = self
            .shares
            .iter()
            .find(|(name, _)| name != EVERY_INPUT && !known(name));
        let names = configuration.inputs.iter().map(|input| input.name.as_str());
        match unknown {
            None => Ok(()),
            Some((input, _)) => Err(LossError::NoInput {
                input: input.clone(),
                inputs: names.collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// Takes the lost samples of a run away.
    ///
    /// What one input of one run loses depends on neither the other inputs nor the selection of runs.
    pub fn inject(&self, configuration: &Configuration, run: &Run, samples: &mut Vec<TimedSample>) {
        let mut inputs: Vec<_> = (0..)
            .zip(&configuration.inputs)
            .map(|(stream, input)| {
                let mut generator = ChaCha8Rng::seed_from_u64(self.seed);
                generator.set_stream(((run.position as u64) << 32) | stream);
                (self.share_of(&input.name), generator)
            })
            .collect();
        samples.retain(|sample| {
            let (share, generator) = &mut inputs[sample.input];
            generator.random::<f64>() >= *share
        });
    }

    fn share_of(&self, input: &str) -> f64 {
        let named = |wanted: &str| self.shares.iter().find(|(name, _)| name == wanted);
        named(input)
            .or_else(|| named(EVERY_INPUT))
            .map_or(0.0, |(_, share)| *share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TWO_INPUTS: &str = include_str!("../../../../deploy/config/vtol.toml");

    fn samples(rows: u64) -> Vec<TimedSample> {
        let sample = |row, input| TimedSample {
            time_ns: row,
            input,
            sequence: row,
            elements: vec![0.0],
        };
        (0..rows)
            .flat_map(|row| [sample(row, 0), sample(row, 1)])
            .collect()
    }

    fn numbers(loss: &str, position: usize, input: usize) -> Vec<u64> {
        let configuration = Configuration::from_text("vtol.toml", TWO_INPUTS)
            .unwrap()
            .configuration;
        let run = Run {
            position,
            ..Run::default()
        };
        let mut samples = samples(1000);
        let loss: Loss = loss.parse().unwrap();
        loss.inject(&configuration, &run, &mut samples);
        let left = samples.iter().filter(|sample| sample.input == input);
        left.map(|sample| sample.sequence).collect()
    }

    #[test]
    fn the_share_of_an_input_is_lost_and_the_numbers_count_on() {
        let left = numbers("aircraft_sensors=0.3,seed=7", 0, 0);
        // Binomial with a standard deviation of 14.5.
        assert!((640..=760).contains(&left.len()), "{}", left.len());
        assert!(left.windows(2).all(|pair| pair[0] < pair[1]));
        assert_eq!(numbers("aircraft_sensors=0.3,seed=7", 0, 1).len(), 1000);
        assert_eq!(numbers("all=1", 0, 0).len(), 0);
    }

    #[test]
    fn what_is_lost_depends_on_seed_run_and_input_alone() {
        let reference = numbers("aircraft_sensors=0.3,seed=7", 3, 0);
        assert_eq!(reference, numbers("all=0.9,aircraft_sensors=0.3,seed=7", 3, 0));
        assert_ne!(reference, numbers("aircraft_sensors=0.3,seed=8", 3, 0));
        assert_ne!(reference, numbers("aircraft_sensors=0.3,seed=7", 4, 0));
        assert_ne!(numbers("all=0.3", 0, 0), numbers("all=0.3", 0, 1));
    }

    #[test]
    fn mistakes_are_named() {
        let message = |text: &str| text.parse::<Loss>().unwrap_err().to_string();
        assert!(message("gyroscope").contains("not key=value"));
        assert!(message("gyroscope=1.2").contains("no share from 0 to 1"));
        assert!(message("gyroscope=nan").contains("no share from 0 to 1"));
        assert!(message("seed=1").contains("no input is named"));
        assert!(message("all=0.1,seed=-1").contains("the seed `-1`"));
        let configuration = Configuration::from_text("vtol.toml", TWO_INPUTS)
            .unwrap()
            .configuration;
        let refused = "gyro=0.1"
            .parse::<Loss>()
            .unwrap()
            .check(&configuration)
            .unwrap_err();
        assert!(
            refused
                .to_string()
                .contains("aircraft_sensors, aircraft_commands")
        );
    }
}
