//! When an alarm is raised and cleared, and how long the raising takes.

/// Longest window m: one bit of a word for each step.
pub const MAX_WINDOW: u32 = u64::BITS;

/// The rules of one alarm; notation in the [module](super)'s table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rules {
    /// n, 1 to m.
    pub raise_steps: u32,
    /// m, n to [`MAX_WINDOW`].
    pub raise_window: u32,
    /// c, at least 1.
    pub clear_steps: u32,
    /// ρ, above 0 and at most 1.
    pub clear_ratio: f64,
    /// Whether a raised alarm stays until it is acknowledged.
    pub latch: bool,
    /// s in sampling instants: those less than s after the first evaluated one.
    pub suppressed_instants: u64,
}

impl Default for Rules {
    /// Raised by the first violation. Five quiet steps in a row clear it: a residual that noise throws to either
    /// side of its bound with even odds then clears it by chance at one instant in 32, while a true end of the
    /// fault shows five periods late; nothing waits for it.
    fn default() -> Self {
        Self {
            raise_steps: 1,
            raise_window: 1,
            clear_steps: 5,
            clear_ratio: 1.0,
            latch: false,
            suppressed_instants: 0,
        }
    }
}

impl Rules {
    /// Sampling instants of a start-up suppression of `suppression_ns`: those k with k · `period_ns` below it.
    pub fn suppressed_instants(suppression_ns: u64, period_ns: u64) -> u64 {
        suppression_ns.div_ceil(period_ns.max(1))
    }

    /// Periods from the first violating instant to the raising one if every evaluated step violates: n − 1.
    pub fn persistent_delay_steps(&self) -> u32 {
        self.raise_steps.saturating_sub(1)
    }

    /// Periods from the first of n violating instants within a window to the raising one, at worst: m − 1; 0 for
    /// n = 1.
    pub fn intermittent_delay_steps(&self) -> u32 {
        if self.raise_steps > 1 {
            self.raise_window.saturating_sub(1)
        } else {
            0
        }
    }
}
