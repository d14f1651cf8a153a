//! What the residuals of a bank are compared with once its filters have settled (method sheet 4.8).

use super::{achieved::Inspection, modes::FaultMode, sensitivity::certificate_floor, settled::Settled};
use crate::achieved::Threshold;

impl Inspection<'_> {
    /// The bounds of all tests in the settled state, and which of them can never alarm or are inert.
    pub fn thresholds(&self) -> Vec<Threshold> {
        let mut all = Vec::new();
        for (mode, filter, settled) in self.filters() {
            let prefix = format!("mode_{}", mode.mode.label());
            let Some(settled) = settled else { continue };
            for (j, half_width) in settled.outputs.iter().enumerate() {
                all.push(self.row(
                    format!("{prefix}_output_{j}"),
                    *half_width,
                    settled,
                    filter.responses(&self.bank.plant, j).filter(|_| !settled.grows),
                    mode.mode,
                ));
            }
            let others = mode.mode.other_actuators(self.model.actuator_count());
            for (j, half_width) in others.zip(&settled.matched) {
                all.push(self.row(
                    format!("{prefix}_matched_{j}"),
                    *half_width,
                    settled,
                    None,
                    mode.mode,
                ));
            }
            if let Some(norm) = settled.norm {
                all.push(self.row(format!("{prefix}_norm"), Some(norm), settled, None, mode.mode));
            }
            for test in &mode.parity {
                let floor = certificate_floor(test, &self.bank.nominal.state);
                all.push(Threshold {
                    channel: format!("{prefix}_parity_{}_{}", test.fault(), test.length()),
                    settled: test.half_width_at(&self.bank.nominal.state),
                    never_fires: None,
                    insensitive: self.inert(test.fault(), floor),
                });
            }
        }
        all
    }

    /// The threshold of a test row; `responses` to unit faults of all actuators where they are known.
    fn row(
        &self,
        channel: String,
        half_width: Option<f64>,
        settled: &Settled,
        responses: Option<Vec<f64>>,
        mode: FaultMode,
    ) -> Threshold {
        let never_fires = half_width.is_none().then(|| {
            "blind: the faults of the mode reach this output alone, so that nothing is left to test"
                .to_owned()
        });
        let insensitive = match half_width {
            None => None,
            Some(_) if settled.grows => Some(
                "the set of the filter grows without end, and this bound with it, so that no fault is sure to exceed \
                 it"
                .to_owned(),
            ),
            Some(half_width) => responses.and_then(|responses| self.inert_row(mode, half_width, &responses)),
        };
        Threshold {
            channel,
            settled: half_width.unwrap_or(0.0),
            never_fires,
            insensitive,
        }
    }

    /// Why a row is sure of no fault of interest.
    fn inert_row(&self, mode: FaultMode, half_width: f64, responses: &[f64]) -> Option<String> {
        let others: Vec<usize> = mode.other_actuators(responses.len()).collect();
        let floors = others.iter().map(|&j| (j, 2.0 * half_width / responses[j].abs()));
        let mut reasons = floors.map(|(j, floor)| self.inert(j, floor));
        let first = reasons.next()??;
        reasons.all(|reason| reason.is_some()).then_some(first)
    }

    /// Why a test that is sure to see only faults from `floor` on is inert.
    fn inert(&self, actuator: usize, floor: f64) -> Option<String> {
        let interest = *self.options.filter.fault_of_interest.as_ref()?.get(actuator)?;
        (floor > interest).then(|| {
            let actuator = &self.model.actuators()[actuator].name;
            format!(
                "inert (THRESHOLD_INERT): no fault of {actuator} as small as `filter.fault_of_interest` is certain to \
                 exceed it"
            )
        })
    }
}
