//! The diagnosis methods: from the tables of a diagnoser to a method with its options.

use super::deserialise::{keys_of, read};
use super::locate::Mistakes;
use super::schema::Method;
use residual_diagnosis::async_imm::options::AsyncImmTables;
use residual_diagnosis::chi_square::ChiSquareOptions;
use residual_diagnosis::gains::FoundGains;
use residual_diagnosis::gains::file::hash_of_inputs;
use residual_diagnosis::hinf_filter::options::HinfFilterOptions;
use residual_diagnosis::method::{Designed, MethodOptions, Refusal};
use residual_diagnosis::reduced_order_observer::options::ReducedOrderObserverOptions;
use residual_diagnosis::response::Response;
use residual_diagnosis::unknown_input_filter::tables::UnknownInputFilterTables;
#[cfg(feature = "synthesis")]
use residual_synthesis::{hinf_filter, reduced_order_observer, unknown_input_filter};
use serde::Serialize;
use std::ops::Range;
use toml::de::DeTable;
use toml::{Table, Value};

/// A method with its model and options.
#[derive(Clone, Debug, PartialEq)]
pub enum MethodConfiguration {
    /// `method = "unknown_input_filter"`: bank of zonotopic unknown-input set-membership filters.
    UnknownInputFilter(UnknownInputFilterTables),
    /// `method = "reduced_order_observer"`: decoupled observers with zonotopic bounds.
    ReducedOrderObserver(ReducedOrderObserverOptions),
    /// `method = "async_imm"`: interacting multiple models on asynchronous sensors under packet loss.
    AsyncImm(AsyncImmTables),
    /// `method = "hinf_filter"`: H∞ fault-detection filter with windowed energy.
    HinfFilter(HinfFilterOptions),
    /// `method = "chi_square"`: state and residual χ² tests, likelihood ratio, cumulative sums.
    ChiSquare(ChiSquareOptions),
}

/// The same expression for the tables of whichever method it is.
macro_rules! for_each_method {
    ($configuration:expr, $tables:ident => $result:expr) => {
        match $configuration {
            MethodConfiguration::UnknownInputFilter($tables) => $result,
            MethodConfiguration::ReducedOrderObserver($tables) => $result,
            MethodConfiguration::AsyncImm($tables) => $result,
            MethodConfiguration::HinfFilter($tables) => $result,
            MethodConfiguration::ChiSquare($tables) => $result,
        }
    };
}

/// Gains of any method in the form that a gains file holds.
fn tabulated<G: Serialize>(found: FoundGains<G>) -> Result<FoundGains<Table>, Refusal> {
    Ok(FoundGains {
        gains: Table::try_from(&found.gains).map_err(|error| Refusal::new("gains", &error))?,
        solver: found.solver,
        warnings: found.warnings,
    })
}

/// The gains of this method out of a gains file.
fn gains_of<T: MethodOptions>(_tables: &T, gains: &Table) -> Result<T::Gains, Refusal> {
    Value::Table(gains.clone())
        .try_into()
        .map_err(|error: toml::de::Error| Refusal::new("gains", &error.message()))
}

fn constructed<T: MethodOptions>(tables: &T, sample_time_s: f64, gains: &Table) -> Result<Designed, Refusal> {
    tables.with_gains(sample_time_s, &gains_of(tables, gains)?)
}

#[cfg(not(feature = "synthesis"))]
fn without_solver<T: MethodOptions>(tables: &T, sample_time_s: f64) -> Result<FoundGains<Table>, Refusal> {
    let Some(refusal) = tables.needs_solver() else {
        return tabulated(tables.find_gains(sample_time_s)?);
    };
    let reason = refusal.message.split("; ").next().unwrap_or_default();
    Err(Refusal {
        key: refusal.key,
        message: format!(
            "{reason}, and this program has no solver; write a gains file with `residuald design` of a program with \
             the feature `synthesis` and name it in `daemon.gains_file`"
        ),
    })
}

fn name_of<T: MethodOptions>(_tables: &T) -> &'static str {
    T::METHOD
}

impl MethodConfiguration {
    /// The method's name, as written in the configuration.
    pub fn name(&self) -> &'static str {
        for_each_method!(self, tables => name_of(tables))
    }

    /// How many measurements and commands the tables speak of.
    pub fn signal_counts(&self) -> (usize, usize) {
        for_each_method!(self, tables => tables.signal_counts())
    }

    /// Checks all that needs no design: shapes, bounds, options that do not fit together.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn validate(&self, sample_time_s: f64) -> Result<(), Refusal> {
        for_each_method!(self, tables => tables.validate(sample_time_s))
    }

    /// Hash of all that the gains depend on.
    ///
    /// # Errors
    /// Numbers that cannot be written.
    pub fn hash_of_inputs(&self, sample_time_s: f64) -> Result<String, Refusal> {
        for_each_method!(self, tables => hash_of_inputs(tables, sample_time_s))
            .map_err(|error| Refusal::new("method", &error))
    }

    /// Finds the gains: the methods' synthesis. `progress` is told before each longer piece of work.
    ///
    /// # Errors
    /// The first condition that does not hold.
    #[cfg(feature = "synthesis")]
    pub fn find_gains(
        &self,
        sample_time_s: f64,
        progress: &mut dyn FnMut(&str),
    ) -> Result<FoundGains<Table>, Refusal> {
        match self {
            Self::UnknownInputFilter(tables) => {
                tabulated(unknown_input_filter::find_gains(tables, sample_time_s, progress)?)
            }
            Self::ReducedOrderObserver(tables) => tabulated(reduced_order_observer::find_gains(
                tables,
                sample_time_s,
                progress,
            )?),
            Self::AsyncImm(tables) => tabulated(tables.find_gains(sample_time_s)?),
            Self::HinfFilter(tables) => tabulated(hinf_filter::find_gains(tables, sample_time_s, progress)?),
            Self::ChiSquare(tables) => tabulated(tables.find_gains(sample_time_s)?),
        }
    }

    /// Finds the gains as far as no solver is needed; this program has none.
    ///
    /// # Errors
    /// The first condition that does not hold; gains that need a solver.
    #[cfg(not(feature = "synthesis"))]
    pub fn find_gains(
        &self,
        sample_time_s: f64,
        _progress: &mut dyn FnMut(&str),
    ) -> Result<FoundGains<Table>, Refusal> {
        for_each_method!(self, tables => without_solver(tables, sample_time_s))
    }

    /// Constructs the diagnoser on these gains; all that they achieve is recomputed.
    ///
    /// # Errors
    /// The first condition that does not hold; its key begins with `gains` where the gains are to blame.
    pub fn with_gains(&self, sample_time_s: f64, gains: &Table) -> Result<Designed, Refusal> {
        for_each_method!(self, tables => constructed(tables, sample_time_s, gains))
    }

    /// How residuals answer to disturbances and faults at each frequency, with these gains; empty where a method has
    /// no such answer.
    ///
    /// # Errors
    /// The first condition that does not hold.
    pub fn responses(&self, sample_time_s: f64, gains: &Table) -> Result<Vec<Response>, Refusal> {
        for_each_method!(self, tables => tables.responses(sample_time_s, &gains_of(tables, gains)?))
    }

    /// Fills in names and units of measurements and commands, where the tables state none, with those of the
    /// signals (name, unit); names only if they are unique.
    pub(super) fn name_signals(&mut self, measurements: &[(String, String)], commands: &[(String, String)]) {
        for_each_method!(self, tables => tables.name_signals(measurements, commands));
    }
}

impl Method {
    /// The keys of a diagnoser's table that belong to the method.
    pub(super) fn keys(self) -> &'static [&'static str] {
        match self {
            Self::UnknownInputFilter => keys_of::<UnknownInputFilterTables>(),
            Self::ReducedOrderObserver => keys_of::<ReducedOrderObserverOptions>(),
            Self::AsyncImm => keys_of::<AsyncImmTables>(),
            Self::HinfFilter => keys_of::<HinfFilterOptions>(),
            Self::ChiSquare => keys_of::<ChiSquareOptions>(),
        }
    }

    /// Reads the method's tables from the diagnoser's table; keys in `others` are not the method's.
    pub(super) fn read(
        self,
        table: &DeTable<'_>,
        span: Range<usize>,
        path: &str,
        others: &[String],
        mistakes: &mut Mistakes<'_>,
    ) -> Option<MethodConfiguration> {
        match self {
            Self::UnknownInputFilter => {
                read(table, span, path, others, mistakes).map(MethodConfiguration::UnknownInputFilter)
            }
            Self::ReducedOrderObserver => {
                read(table, span, path, others, mistakes).map(MethodConfiguration::ReducedOrderObserver)
            }
            Self::AsyncImm => read(table, span, path, others, mistakes).map(MethodConfiguration::AsyncImm),
            Self::HinfFilter => {
                read(table, span, path, others, mistakes).map(MethodConfiguration::HinfFilter)
            }
            Self::ChiSquare => read(table, span, path, others, mistakes).map(MethodConfiguration::ChiSquare),
        }
    }
}
