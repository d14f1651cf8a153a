//! What the gains achieve, in the words that all methods share.

use super::{
    certificate::{Certificate, Time},
    channels::prefix,
    filter::{ResidualFilter, Threshold},
    main_filter::MainFilter,
    options::HinfFilterOptions,
    problem::Problem,
    report::Guarantee,
    sensitivity::{StepResponse, Visibility},
    verified::CheckedBlind,
};
use crate::achieved::{
    Achieved, Delay, FalseAlarms, FaultSensitivity, Inequality, Need, Norm, NotStated, Poles, Separation,
    SizeOf, Threshold as Settled, TimeDomain,
};
use crate::decomposition::{SingularDecomposition, eigenvalues};
use nalgebra::{Complex, DMatrix};
use statrs::function::erf::erfc;

/// Standard deviations of noise that the bounds of residuals and energies leave room for (method sheet 3.7).
const PEAK_DEVIATIONS: f64 = 6.0;
const ENERGY_DEVIATIONS: f64 = 5.0;

/// One filter as it runs.
pub(super) struct RunningFilter<'a> {
    pub filter: &'a ResidualFilter,
    /// Ac, n x n.
    pub closed: &'a DMatrix<f64>,
    /// How a sample enters the error, n x q.
    pub gain: &'a DMatrix<f64>,
    /// V, s x q.
    pub v: &'a DMatrix<f64>,
}

/// Everything that was put together.
pub(super) struct Assembly<'a> {
    pub problem: &'a Problem,
    pub options: &'a HinfFilterOptions,
    pub main: &'a MainFilter,
    /// The detecting filter, the blind ones, the estimating one.
    pub running: Vec<RunningFilter<'a>>,
    /// The blind filters as they were checked.
    pub blind: &'a [CheckedBlind],
    pub guarantee: &'a Guarantee,
}

impl Assembly<'_> {
    pub fn achieved(&self) -> Achieved {
        let seen: Vec<Option<Vec<Visibility>>> = self
            .running
            .iter()
            .map(|running| self.visibility(running))
            .collect();
        Achieved {
            false_alarms: Some(self.false_alarms()),
            norms: self.norms(),
            poles: self.poles(),
            inequalities: self.inequalities(),
            faults: self.faults(&seen),
            not_stated: self.not_stated(&seen),
            isolability: self.isolability(&seen),
            thresholds: self.thresholds(&seen),
        }
    }

    fn bank(&self) -> usize {
        self.problem.faults.blind.len()
    }

    /// What the peak test of a filter sees; `None` without a peak test.
    fn visibility(&self, running: &RunningFilter<'_>) -> Option<Vec<Visibility>> {
        let Threshold::Guaranteed(bounds) = &running.filter.threshold else {
            return None;
        };
        if !running.filter.peak_test {
            return None;
        }
        let (plant, sampled) = (&self.problem.plant, &self.problem.sampled);
        let response = StepResponse {
            closed: running.closed,
            input: &sampled.bfd - running.gain * &plant.df,
            output: running.v * &plant.c,
            direct: running.v * &plant.df,
        };
        Some(response.visibility(&bounds.settled()))
    }

    fn false_alarms(&self) -> FalseAlarms {
        let (probability, provided_that) = match self.guarantee {
            Guarantee::Complete => (Some(0.0), self.conditions()),
            Guarantee::Probable => (
                Some(self.alarms_by_noise()),
                format!(
                    "{}; measurement noise is white and normal, the probability is an upper bound",
                    self.conditions()
                ),
            ),
            Guarantee::None(reason) => (None, reason.clone()),
        };
        let instants = 3600.0 / self.problem.sampled.sample_time_s;
        FalseAlarms {
            probability_per_instant: probability,
            expected_per_hour: probability.map(|probability| probability * instants),
            provided_that,
        }
    }

    fn alarms_by_noise(&self) -> f64 {
        let tails = |deviations: f64| erfc(deviations / std::f64::consts::SQRT_2);
        let tests = self.running.iter().take(1 + self.bank());
        tests
            .map(|running| {
                let rows = if running.filter.peak_test {
                    running.filter.tested
                } else {
                    0
                };
                rows as f64 * tails(PEAK_DEVIATIONS) + tails(ENERGY_DEVIATIONS) / 2.0
            })
            .sum()
    }

    fn conditions(&self) -> String {
        let disturbance = match (
            &self.options.disturbance.amplitude,
            &self.options.disturbance.slew,
        ) {
            (Some(_), Some(_)) => "disturbances keep their amplitude and slew",
            (Some(_), None) => "disturbances keep their amplitude and change at sampling instants only",
            (None, _) => "the energy of the disturbances in every window keeps its bound",
        };
        let plant = match self.problem.listed.is_empty() {
            true => "the plant is the model",
            false => "the plant is the model or a listed one",
        };
        format!("{disturbance}; the initial error keeps its bound; {plant}; commands are those really held")
    }

    fn norms(&self) -> Vec<Norm> {
        let mut norms = Vec::new();
        if let Some(continuous) = &self.main.continuous {
            norms.extend(self.norms_of(continuous, " (continuous)"));
        }
        norms.extend(self.norms_of(&self.main.certificate, ""));
        if let Some((value, optimum)) = self.main.weighted {
            norms.push(Norm {
                name: "largest gain from weighted disturbance and noise to residual".to_owned(),
                value,
                lower_bound: optimum,
            });
        }
        for (set, checked) in self.problem.faults.blind.iter().zip(self.blind) {
            norms.push(Norm {
                name: format!("what the filter {} passes of them", self.blind_name(set)),
                value: checked.leak,
                lower_bound: None,
            });
        }
        norms
    }

    fn norms_of(&self, certificate: &Certificate, suffix: &str) -> Vec<Norm> {
        let norm = |name: &str, value: f64, lower_bound: Option<f64>| Norm {
            name: format!("{name}{suffix}"),
            value,
            lower_bound,
        };
        let direct_fault = SingularDecomposition::new(&self.problem.plant.df).largest();
        let mut norms = vec![
            norm(
                "largest gain from disturbance to residual",
                certificate.disturbance,
                Some(certificate.lower_bound),
            ),
            norm(
                "largest gain from disturbance to filtered residual",
                certificate.weighted_disturbance,
                None,
            ),
            norm(
                "largest gain from fault to residual",
                certificate.fault,
                Some(direct_fault),
            ),
            norm(
                "smallest gain from fault to filtered residual",
                certificate.fault_index,
                None,
            ),
        ];
        for (name, index) in self.problem.faults.names.iter().zip(&certificate.fault_indices) {
            let name = format!("smallest gain from the fault {name} to filtered residual");
            norms.push(norm(&name, *index, None));
        }
        norms.push(norm("norm of the gain", certificate.gain, None));
        if let Some(paper) = certificate.paper {
            norms.push(norm("norm of the reference model", paper.reference, None));
            norms.push(norm("objective of the paper", paper.objective, None));
        }
        norms
    }

    fn poles(&self) -> Vec<Poles> {
        let mut found = Vec::new();
        if let Some(continuous) = &self.main.continuous {
            found.push(poles(
                "the filter (continuous)",
                Time::Continuous,
                continuous.poles.clone(),
            ));
        }
        let held = self.main.certificate.time == Time::Continuous;
        if held {
            let own = self.main.certificate.poles.clone();
            found.push(poles("the filter (continuous)", Time::Continuous, own));
        }
        for (i, running) in self.running.iter().enumerate() {
            let name = match i.checked_sub(1) {
                None => "the filter".to_owned(),
                Some(i) => match self.problem.faults.blind.get(i) {
                    Some(set) => format!("the filter {}", self.blind_name(set)),
                    None => "the fault estimate".to_owned(),
                },
            };
            let values = eigenvalues(running.closed).unwrap_or_default();
            found.push(poles(&name, Time::Discrete, values));
        }
        found
    }

    fn blind_name(&self, set: &[usize]) -> String {
        let names: Vec<_> = set
            .iter()
            .map(|j| self.problem.faults.names[*j].as_str())
            .collect();
        format!("blind to {}", names.join(", "))
    }

    /// Conditions that hold with a margin; what an uncertified gain violates stands with the false alarms and among the
    /// warnings.
    fn inequalities(&self) -> Vec<Inequality> {
        let mut found: Vec<Inequality> = self
            .main
            .conditions()
            .filter(|condition| condition.holds() && !condition.sharp)
            .map(super::conditions::Condition::inequality)
            .collect();
        found.push(Inequality {
            name: "norm of the gain <= max_gain".to_owned(),
            margin: self.options.synthesis.max_gain - self.main.certificate.gain,
        });
        found
    }

    fn faults(&self, seen: &[Option<Vec<Visibility>>]) -> Vec<FaultSensitivity> {
        let assurance = match self.guarantee {
            // What a fault does to the residual then depends on the plant, and the thresholds on the commands.
            _ if !self.problem.listed.is_empty() => 0.0,
            Guarantee::Complete => 1.0,
            Guarantee::Probable => 1.0 - erfc(PEAK_DEVIATIONS / std::f64::consts::SQRT_2),
            Guarantee::None(_) => 0.0,
        };
        let detected = seen.first().and_then(Option::as_ref).filter(|_| assurance > 0.0);
        let period = self.problem.sampled.sample_time_s;
        let names = self.problem.faults.names.iter().enumerate();
        names
            .map(|(j, name)| {
                let visibility = detected.and_then(|faults| faults.get(j));
                FaultSensitivity {
                    fault: name.clone(),
                    unit: String::new(),
                    assurance,
                    provided_that: String::new(),
                    detectable: visibility.and_then(Visibility::smallest),
                    isolable: if assurance > 0.0 {
                        self.isolable(j, seen)
                    } else {
                        None
                    },
                    delays: visibility.map_or_else(Vec::new, |visibility| {
                        let delays = visibility.delays.iter();
                        let delay = |(instants, size): &(usize, f64)| Delay {
                            within_s: *instants as f64 * period,
                            size: *size,
                        };
                        delays.map(delay).collect()
                    }),
                }
            })
            .collect()
    }

    /// Sizes need bounds that are guaranteed, and peak tests of them.
    fn not_stated(&self, seen: &[Option<Vec<Visibility>>]) -> Vec<NotStated> {
        let untested = "only the peak test has a formula for constant faults, and it is off";
        let because = |untested_filter: bool| match self.guarantee {
            Guarantee::None(reason) => Some(reason.clone()),
            _ => untested_filter.then(|| untested.to_owned()),
        };
        let blind = seen.get(1..=self.bank()).unwrap_or_default();
        let detectable = because(seen.first().is_none_or(Option::is_none));
        let isolable = because(blind.iter().any(Option::is_none)).filter(|_| self.bank() > 0);
        let sizes = [(SizeOf::Detectable, detectable), (SizeOf::Isolable, isolable)];
        let sizes = sizes.into_iter().filter_map(|(size, because)| {
            Some(NotStated {
                size,
                faults: Vec::new(),
                because: because?,
            })
        });
        sizes.collect()
    }

    /// Blind filters that tell fault `j` from fault `other`, with what they see of `j`.
    fn separating<'a>(
        &'a self,
        j: usize,
        other: usize,
        seen: &'a [Option<Vec<Visibility>>],
    ) -> impl Iterator<Item = &'a Visibility> {
        let blind = self.problem.faults.blind.iter().zip(seen.iter().skip(1));
        blind
            .filter(move |(set, _)| set.contains(&other) && !set.contains(&j))
            .filter_map(move |(_, seen)| seen.as_ref()?.get(j))
    }

    /// The smallest fault j that is told from every other: for each of them, some filter that is blind to it is sure to
    /// fire. No more than its declared bound, beyond which the filters that are blind to j may fire as well.
    fn isolable(&self, j: usize, seen: &[Option<Vec<Visibility>>]) -> Option<f64> {
        if self.bank() == 0 {
            return None;
        }
        let mut needed = 0.0_f64;
        for other in (0..self.problem.faults.names.len()).filter(|other| *other != j) {
            let sizes = self.separating(j, other, seen).filter_map(Visibility::smallest);
            needed = needed.max(sizes.fold(f64::INFINITY, f64::min));
        }
        (needed <= self.problem.faults.bound[j]).then_some(needed)
    }

    fn isolability(&self, seen: &[Option<Vec<Visibility>>]) -> Vec<Separation> {
        if self.bank() == 0 || !self.problem.listed.is_empty() {
            return Vec::new();
        }
        let names = &self.problem.faults.names;
        let mut found = Vec::new();
        for (j, fault) in names.iter().enumerate() {
            for (other, from) in names.iter().enumerate().filter(|(other, _)| *other != j) {
                let instants = self
                    .separating(j, other, seen)
                    .filter_map(|seen| seen.first)
                    .min();
                found.push(Separation {
                    fault: fault.clone(),
                    from: from.clone(),
                    instants: instants.map(|instants| instants as u64),
                    need: Need::Instants,
                });
            }
        }
        found
    }

    fn thresholds(&self, seen: &[Option<Vec<Visibility>>]) -> Vec<Settled> {
        let mut found = Vec::new();
        let bank = self.bank();
        for (i, (running, seen)) in self.running.iter().zip(seen).enumerate() {
            if i > bank {
                self.estimates(running, &mut found);
                continue;
            }
            let blind = i
                .checked_sub(1)
                .map_or(&[][..], |i| &self.problem.faults.blind[i]);
            let prefix = prefix(&self.problem.faults, i);
            // Over all samples since the start the threshold never settles.
            if let Some((settled, insensitive)) = self.settled_energy(running) {
                found.push(Settled {
                    channel: format!("{prefix}energy"),
                    settled,
                    never_fires: None,
                    insensitive,
                });
            }
            let Threshold::Guaranteed(bounds) = &running.filter.threshold else {
                continue;
            };
            for (row, bound) in bounds
                .settled()
                .into_iter()
                .take(running.filter.tested)
                .enumerate()
            {
                let (never_fires, insensitive) = match seen {
                    None => (Some("it is not tested".to_owned()), None),
                    Some(seen) => self.unseen(seen, row, blind),
                };
                found.push(Settled {
                    channel: format!("{prefix}r{}", row + 1),
                    settled: bound,
                    never_fires,
                    insensitive,
                });
            }
        }
        found
    }

    /// Threshold of a filter's energy, and why it never alarms first; `None` over all samples, where it grows.
    fn settled_energy(&self, running: &RunningFilter<'_>) -> Option<(f64, Option<String>)> {
        let bounds = match &running.filter.threshold {
            Threshold::Constant(threshold) => return Some((*threshold, None)),
            Threshold::Guaranteed(bounds) => bounds,
        };
        let length = self.problem.window? as f64 * self.problem.sampled.sample_time_s;
        let energy = bounds.settled_energy(length);
        let tested = &bounds.settled()[..running.filter.tested];
        let by_peaks = (length * tested.iter().map(|bound| bound * bound).sum::<f64>()).sqrt();
        let preceded = running.filter.peak_test && by_peaks <= energy * (1.0 + 1e-9);
        let first = "once settled, a residual beyond its own bound always alarms first";
        Some((energy, preceded.then(|| first.to_owned())))
    }

    /// Why no fault moves a residual at all, or none that is declared moves it beyond its bound for sure.
    fn unseen(&self, seen: &[Visibility], row: usize, blind: &[usize]) -> (Option<String>, Option<String>) {
        if !self.problem.listed.is_empty() {
            return (None, None);
        }
        let faults = seen.iter().enumerate().filter(|(j, _)| !blind.contains(j));
        let sizes: Vec<(usize, f64)> = faults
            .map(|(j, fault)| (j, fault.by_row.get(row).copied().unwrap_or(f64::INFINITY)))
            .collect();
        if sizes.iter().all(|(_, size)| size.is_infinite()) {
            return (Some("no fault reaches this residual".to_owned()), None);
        }
        let declared = self.options.isolation.is_some();
        let beyond = sizes
            .iter()
            .all(|(j, size)| *size > self.problem.faults.bound[*j]);
        let small = "no fault within its declared bound is sure to exceed it";
        (None, (declared && beyond).then(|| small.to_owned()))
    }

    fn estimates(&self, running: &RunningFilter<'_>, found: &mut Vec<Settled>) {
        let Threshold::Guaranteed(bounds) = &running.filter.threshold else {
            return;
        };
        for (name, bound) in self.problem.faults.names.iter().zip(bounds.settled()) {
            found.push(Settled {
                channel: format!("fault_estimate_{name}"),
                settled: bound,
                never_fires: Some("it is an estimate, no test".to_owned()),
                insensitive: None,
            });
        }
    }
}

fn poles(name: &str, time: Time, mut values: Vec<Complex<f64>>) -> Poles {
    values.sort_by(|x, y| {
        let modulus = y.norm().total_cmp(&x.norm());
        modulus.then(x.re.total_cmp(&y.re)).then(x.im.total_cmp(&y.im))
    });
    Poles {
        name: name.to_owned(),
        time: match time {
            Time::Continuous => TimeDomain::Continuous,
            Time::Discrete => TimeDomain::Discrete,
        },
        values: values.iter().map(|value| [value.re, value.im]).collect(),
    }
}
