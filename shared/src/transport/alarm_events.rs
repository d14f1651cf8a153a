//! News of alarms for processes that wait in iceoryx2, for instance in a `WaitSet` beside other services.
//!
//! An event says that there is something new in the alarm ring of the [bounds table](crate::bounds_table), where
//! the transition itself is read. Its id is the number of the alarm's new [`AlarmState`]:
//!
//! | id | new state |
//! |---|---|
//! | 0 | cleared |
//! | 1 | pending |
//! | 2 | raised |
//! | 3 | isolated |
//!
//! Events of one id that nobody has taken yet become one with a count. The service has no other ids, and no event
//! of its own when ports come or go. A listener that does not take its events, or is dead, holds up nobody.

use std::time::Duration;

use iceoryx2::port::listener::{Listener, ListenerCreateError};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{EventId, ipc};
use iceoryx2::service::builder::event::EventOpenError;

use super::{MAX_NODES, Node, SendError, TransportError, refused, room, service_name};
use crate::alarm::AlarmState;
use crate::names::Instance;

/// How many listeners may be attached at once.
const MAX_LISTENERS: usize = 16;

/// The daemon, and one that was killed and is not cleared away yet.
const MAX_NOTIFIERS: usize = 2;

/// The largest event id.
const MAX_EVENT_ID: usize = AlarmState::Isolated as usize;

/// The daemon's end: wakes all listeners.
#[derive(Debug)]
pub struct AlarmNotifier {
    notifier: Notifier<ipc::Service>,
    service: String,
}

impl AlarmNotifier {
    /// Creates the service, or opens it when listeners have kept it alive.
    ///
    /// # Errors
    /// See [`TransportError`].
    pub fn create(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        let name = instance.alarm_service();
        let service = node
            .service_builder(&service_name(&name)?)
            .event()
            .max_listeners(MAX_LISTENERS)
            .max_notifiers(MAX_NOTIFIERS)
            .max_nodes(MAX_NODES)
            .event_id_max_value(MAX_EVENT_ID)
            .disable_deadline()
            .disable_notifier_created_event()
            .disable_notifier_dropped_event()
            .disable_notifier_dead_event()
            .open_or_create()
            .map_err(|error| refused(&name, error))?;
        let notifier = service
            .notifier_builder()
            .create()
            .map_err(|error| refused(&name, error))?;
        room::reserve(instance)?;
        Ok(Self {
            notifier,
            service: name,
        })
    }

    /// Tells that an alarm has this state now; gives the number of listeners. One system call for each listener
    /// that has taken all its events: not for the step thread.
    ///
    /// # Errors
    /// [`SendError::Delivery`].
    pub fn notify(&self, state: AlarmState) -> Result<usize, SendError> {
        self.notifier
            .notify_with_custom_event_id(EventId::new(state as usize))
            .map_err(|error| SendError::Delivery {
                service: self.service.clone(),
                reason: format!("{error:?}"),
            })
    }
}

/// A consumer's end.
#[derive(Debug)]
pub struct AlarmEvents {
    listener: Listener<ipc::Service>,
    service: String,
}

impl AlarmEvents {
    /// Opens the daemon's service; events from now on are received.
    ///
    /// # Errors
    /// [`TransportError::NoService`] without a daemon; [`TransportError::Service`].
    pub fn open(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        let name = instance.alarm_service();
        let service = node
            .service_builder(&service_name(&name)?)
            .event()
            .open()
            .map_err(|error| match error {
                EventOpenError::DoesNotExist => TransportError::NoService {
                    service: name.clone(),
                },
                other => refused(&name, other),
            })?;
        let listener = service.listener_builder().create().map_err(|error| match error {
            ListenerCreateError::ResourceCreationFailed if !instance.has_room_for_sockets() => {
                TransportError::Path {
                    path: instance.iceoryx_root(),
                }
            }
            other => refused(&name, other),
        })?;
        Ok(Self {
            listener,
            service: name,
        })
    }

    /// The listener, to be attached to a `WaitSet`; whoever it wakes calls [`wait`](Self::wait) without a timeout,
    /// because a `WaitSet` takes no events itself.
    pub fn listener(&self) -> &Listener<ipc::Service> {
        &self.listener
    }

    /// Sleeps until there are events, at most `timeout`, and hands each state with the number of its events to
    /// `take`.
    ///
    /// # Errors
    /// [`TransportError::Service`].
    pub fn wait(
        &self,
        timeout: Duration,
        mut take: impl FnMut(AlarmState, u64),
    ) -> Result<(), TransportError> {
        let mut hand = |id: EventId, count: u64| {
            let number = u32::try_from(id.as_value()).ok();
            if let Some(state) = number.and_then(AlarmState::from_number) {
                take(state, count);
            }
        };
        let waited = if timeout.is_zero() {
            (self.listener).try_wait(|activation| hand(activation.id, activation.count))
        } else {
            (self.listener).timed_wait(|activation| hand(activation.id, activation.count), timeout)
        };
        waited.map_err(|error| refused(&self.service, error)).map(drop)
    }
}
