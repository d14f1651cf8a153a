//! The diagnoser: packets in, records out, with roll-back for late packets (method sheet 4).

use super::{
    channels,
    checks::{CheckReport, check},
    design::ImmDesign,
    design_error::DesignError,
    estimator::ImmEstimator,
    fusion::Fusion,
    memory::{Counters, Memory},
    settings::Settings,
    state::Posterior,
};
use crate::{
    diagnoser::{
        Channel, Description, Diagnoser, PacketRules, Packets, RestoreError, StepInput, StepRecord, Verdict,
        flags,
    },
    state::StateFormat,
};

/// Version of the saved state.
const STATE_VERSION: u16 = 1;

/// Asynchronous interacting-multiple-model fusion: a bank of mode filters on time-stamped packets.
///
/// It uses [`StepInput::packets`] and [`StepInput::instant_ns`] only. The first interval begins one period before
/// the first instant. An instant that is not after the last one takes packets but does not fuse.
#[derive(Clone)]
pub struct AsyncImm {
    pub(super) settings: Settings,
    pub(super) estimator: ImmEstimator,
    pub(super) fusion: Fusion,
    pub(super) memory: Memory,
    pub(super) sensor_rows: Vec<usize>,
    description: Description,
    format: StateFormat,
    report: CheckReport,
    /// First interval of the latest step.
    pub(super) recomputed_from: u64,
}

impl AsyncImm {
    /// Builds the diagnoser of a design.
    ///
    /// # Errors
    /// [`DesignError`]: the first condition that does not hold.
    pub fn new(design: &ImmDesign, settings: Settings) -> Result<Self, DesignError> {
        let report = check(design)?;
        settings.check(design)?;
        let slots = settings.max_packets_per_step.saturating_mul(design.sensors.len());
        let estimator = ImmEstimator::new(design, slots)?;
        let sensor_rows: Vec<usize> = design
            .sensors
            .iter()
            .map(|sensor| sensor.measurement_matrix.nrows())
            .collect();
        let memory = Memory::new(
            &estimator.prior,
            &settings,
            sensor_rows.len(),
            design.widest_sensor(),
        );
        Ok(Self {
            description: Description {
                method: "async_imm",
                channels: channels::descriptions(design, &settings),
                faults: settings.channels.iter().map(|(name, _)| name.clone()).collect(),
                measurement_count: sensor_rows.iter().sum(),
                command_count: settings.initial_command.len(),
                packets: Some(PacketRules {
                    sensor_rows: sensor_rows.clone(),
                    max_packets_per_step: settings.max_packets_per_step,
                    rollback_steps: settings.rollback_steps,
                }),
            },
            // The text of a number tells all its bits.
            format: StateFormat::new("async_imm", STATE_VERSION, &format!("{design:?} {settings:?}")),
            fusion: Fusion::new(design),
            settings,
            estimator,
            memory,
            sensor_rows,
            report,
            recomputed_from: 0,
        })
    }

    /// What the off-line checks found.
    pub fn report(&self) -> &CheckReport {
        &self.report
    }

    /// Packets and steps that deserve attention, since the start.
    pub fn counters(&self) -> &Counters {
        &self.memory.counters
    }

    /// The posterior at the latest instant.
    pub fn posterior(&self) -> &Posterior {
        self.memory.posterior(self.memory.step)
    }

    /// The posterior `steps` fusion instants ago, as far back as late packets can still change it; `None` beyond.
    pub fn earlier_posterior(&self, steps: usize) -> Option<&Posterior> {
        let number = self.memory.step.checked_sub(steps as u64)?;
        (steps <= self.settings.rollback_steps + 1).then(|| self.memory.posterior(number))
    }

    /// The estimator, with the log-likelihoods of the latest interval.
    pub fn estimator(&self) -> &ImmEstimator {
        &self.estimator
    }

    /// The first interval, counted from 1, that the latest step filtered (again).
    pub fn recomputed_from(&self) -> u64 {
        self.recomputed_from
    }

    /// The declared fault mode at the latest instant; 0 if none.
    pub fn declared_mode(&self) -> usize {
        self.settings.decision.declared_mode(&self.posterior().decision)
    }

    /// Whether a fault is detected at the latest instant.
    pub fn fault_detected(&self) -> bool {
        self.settings.decision.fault_detected(&self.posterior().decision)
    }
}

impl Diagnoser for AsyncImm {
    fn description(&self) -> &Description {
        &self.description
    }

    fn step(&mut self, input: &StepInput<'_>, record: &mut StepRecord) {
        let instant_ns = i64::try_from(input.instant_ns).unwrap_or(i64::MAX);
        self.fuse(instant_ns, input.packets, record);
    }

    /// The instant one period after the last one, without packets; those that come later belong to it all the same
    /// (without roll-back they are too old then). Before the first step nothing happens: time is not known yet.
    fn skip(&mut self, record: &mut StepRecord) {
        if self.memory.started {
            let instant_ns = self
                .posterior()
                .instant_ns
                .saturating_add(self.settings.period_ns);
            self.fuse(instant_ns, Packets::default(), record);
        } else {
            record.verdict = Verdict::Starting as u32;
            record.flags |= flags::INPUT_MISSING;
            record.inputs_valid = 0;
            (record.certainly_faulty, record.possibly_faulty) = (0, 0);
            (record.fault_estimate, record.fault_estimate_half_width) = (f64::NAN, f64::NAN);
            record.channels_mut().fill(Channel::NOT_EVALUATED);
        }
    }

    fn reset(&mut self) {
        self.memory.clear(&self.estimator.prior, &self.settings);
        self.recomputed_from = 0;
    }

    fn boxed_clone(&self) -> Box<dyn Diagnoser> {
        Box::new(self.clone())
    }

    fn save(&self, state: &mut Vec<u8>) {
        self.format.encode(&self.memory, state);
    }

    fn state_size(&self) -> usize {
        self.format.size(&self.memory)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RestoreError> {
        let memory: Memory = self.format.decode(state)?;
        if !memory.fits(&self.memory, &self.sensor_rows) {
            return Err(RestoreError::Damaged);
        }
        self.memory = memory;
        self.recomputed_from = 0;
        Ok(())
    }
}
