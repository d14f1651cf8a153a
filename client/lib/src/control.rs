//! Control of a running daemon.

use std::time::Duration;

use residual_shared::alarm::AlarmNumber;
use residual_shared::control::{
    Alarms, CheckpointOutcome, DiagnoserDescription, LIST_PAGE, Listing, ReloadOutcome, Request, Response,
    Which,
};
use residual_shared::names::Instance;
use residual_shared::transport::{ControlClient, RequestError};

/// How long a request waits for its answer unless told otherwise: longer than the daemon gives its step thread, so
/// that a step thread that hangs is reported as such.
pub const DEFAULT_TIMEOUT: Duration = Duration::from_secs(5);

/// Control of a running daemon, for processes of the daemon's own user.
///
/// Every request waits until it is answered, at most the timeout. Nothing happens between requests; a control may be
/// kept over restarts of the daemon.
#[derive(Debug)]
pub struct Control {
    client: ControlClient,
    timeout: Duration,
}

/// What the log was and is filtered by.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLevel {
    /// Until now.
    pub before: String,
    /// From now on.
    pub now: String,
}

impl Control {
    /// Connects to the daemon of an instance.
    ///
    /// # Errors
    /// [`RequestError::NoDaemon`]; [`RequestError::Transport`], above all for another user than the daemon's.
    pub fn connect(instance: &Instance) -> Result<Self, RequestError> {
        Ok(Self {
            client: ControlClient::connect(instance)?,
            timeout: DEFAULT_TIMEOUT,
        })
    }

    /// With another timeout than [`DEFAULT_TIMEOUT`]. A reload may have to find gains: give it minutes.
    pub fn with_timeout(self, timeout: Duration) -> Self {
        Self { timeout, ..self }
    }

    /// Sends any request.
    ///
    /// # Errors
    /// See [`RequestError`]: the daemon refused, ended, or did not answer in time.
    pub fn request(&self, request: &Request) -> Result<Response, RequestError> {
        self.client.request(request, self.timeout)
    }

    /// The daemon itself and all of its diagnosers.
    ///
    /// # Errors
    /// As for [`request`](Self::request), and so for all that follows.
    pub fn list(&self) -> Result<Listing, RequestError> {
        let mut listing = self.page(0)?;
        while listing.diagnosers.len() < listing.total as usize {
            let more = self.page(listing.diagnosers.len() as u32)?;
            // After a reload there may be fewer.
            if more.diagnosers.is_empty() {
                break;
            }
            listing.diagnosers.extend(more.diagnosers);
        }
        Ok(listing)
    }

    /// At most [`LIST_PAGE`] diagnosers, from the slot `first` on.
    fn page(&self, first: u32) -> Result<Listing, RequestError> {
        match self.request(&Request::List { first })? {
            Response::List(listing) if listing.diagnosers.len() <= LIST_PAGE => Ok(listing),
            _ => Err(RequestError::OtherAnswer),
        }
    }

    /// All that is known of one diagnoser.
    ///
    /// # Errors
    /// `Refused` if there is none of this name.
    pub fn describe(&self, diagnoser: &str) -> Result<DiagnoserDescription, RequestError> {
        let diagnoser = diagnoser.into();
        match self.request(&Request::Describe { diagnoser })? {
            Response::Description(description) => Ok(description),
            _ => Err(RequestError::OtherAnswer),
        }
    }

    /// Returns a diagnoser to the state right after its construction. Its next record has the flag RESET.
    ///
    /// # Errors
    /// `Refused` if there is none of this name.
    pub fn reset(&self, diagnoser: &str) -> Result<(), RequestError> {
        self.reset_which(Which::Diagnoser(diagnoser.into())).map(drop)
    }

    /// Resets all diagnosers; gives their number.
    ///
    /// # Errors
    /// As for [`request`](Self::request).
    pub fn reset_all(&self) -> Result<u32, RequestError> {
        self.reset_which(Which::All)
    }

    fn reset_which(&self, which: Which) -> Result<u32, RequestError> {
        match self.request(&Request::Reset { which })? {
            Response::Reset { diagnosers } => Ok(diagnosers),
            _ => Err(RequestError::OtherAnswer),
        }
    }

    /// Acknowledges the alarm of a diagnoser; false: none waited for it.
    ///
    /// # Errors
    /// `Refused` if there is no diagnoser of this name.
    pub fn acknowledge(&self, diagnoser: &str) -> Result<bool, RequestError> {
        let alarms = Alarms::Diagnoser(diagnoser.into());
        Ok(self.acknowledge_which(alarms)? > 0)
    }

    /// Acknowledges the alarm that this transition belongs to; false: it did not wait for it.
    ///
    /// # Errors
    /// `Refused` if the transition is not in the ring any more, or the diagnoser has raised another alarm since.
    pub fn acknowledge_number(&self, number: AlarmNumber) -> Result<bool, RequestError> {
        Ok(self.acknowledge_which(number.into())? > 0)
    }

    /// Acknowledges the alarms of all diagnosers; gives the number of those that waited for it.
    ///
    /// # Errors
    /// As for [`request`](Self::request).
    pub fn acknowledge_all(&self) -> Result<u32, RequestError> {
        self.acknowledge_which(Alarms::All)
    }

    fn acknowledge_which(&self, alarms: Alarms) -> Result<u32, RequestError> {
        match self.request(&Request::Acknowledge { alarms })? {
            Response::Acknowledged { alarms } => Ok(alarms),
            _ => Err(RequestError::OtherAnswer),
        }
    }

    /// Saves the state of all diagnosers now.
    ///
    /// # Errors
    /// `Refused` if the daemon could not.
    pub fn checkpoint(&self) -> Result<CheckpointOutcome, RequestError> {
        match self.request(&Request::Checkpoint)? {
            Response::Checkpoint(outcome) => Ok(outcome),
            _ => Err(RequestError::OtherAnswer),
        }
    }

    /// Has the daemon read its configuration again and go on with it.
    ///
    /// # Errors
    /// `Refused` with all mistakes of the new configuration; the daemon goes on with the one it has.
    pub fn reload(&self) -> Result<ReloadOutcome, RequestError> {
        match self.request(&Request::Reload)? {
            Response::Reload(outcome) => Ok(outcome),
            _ => Err(RequestError::OtherAnswer),
        }
    }

    /// Changes what the daemon logs, for example to `debug` or `warn,residuald=debug`, until it ends.
    ///
    /// # Errors
    /// `Refused` if it is no filter.
    pub fn set_log_level(&self, filter: &str) -> Result<LogLevel, RequestError> {
        let filter = filter.into();
        match self.request(&Request::SetLogLevel { filter })? {
            Response::LogLevel { before, now } => Ok(LogLevel { before, now }),
            _ => Err(RequestError::OtherAnswer),
        }
    }
}
