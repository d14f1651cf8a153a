//! Sensor samples: publishers outside, one subscriber per input in the daemon.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{AllocationStrategy, ipc};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::{MAX_NODES, Node, TransportError, open_error, refused, room, service_name};
use crate::names::Instance;
use crate::sample::SampleHeader;

/// Length of the sample slices a publisher prepares; longer ones are refused by [`SamplePublisher::send`].
const MAX_SIGNALS: usize = 64;

type SampleService = PortFactory<ipc::Service, [f64], SampleHeader>;

/// Why a sample could not be sent.
#[derive(Debug, thiserror::Error)]
pub enum SendError {
    /// More elements than any input may have.
    #[error("a sample of {length} elements is too long; at most {MAX_SIGNALS} are possible")]
    TooLong {
        /// Number of elements given.
        length: usize,
    },
    /// iceoryx2 could not deliver.
    #[error("cannot send on `{service}`: {reason}")]
    Delivery {
        /// The service's name.
        service: String,
        /// iceoryx2's reason.
        reason: String,
    },
}

/// The receiving end of one input: the daemon's, or that of a recorder beside it.
pub struct SampleSubscriber {
    subscriber: Subscriber<ipc::Service, [f64], SampleHeader>,
}

impl SampleSubscriber {
    /// Creates the service of `input` (or opens it, when publishers have kept it alive) and subscribes.
    ///
    /// `buffer_samples`: samples kept between two receptions; `max_publishers`: publishers at the same time.
    pub fn create(
        node: &Node,
        instance: &Instance,
        input: &str,
        buffer_samples: usize,
        max_publishers: usize,
    ) -> Result<Self, TransportError> {
        let name = instance.sample_service(input);
        let service: SampleService = node
            .service_builder(&service_name(&name)?)
            .publish_subscribe::<[f64]>()
            .user_header::<SampleHeader>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(buffer_samples)
            .max_publishers(max_publishers)
            .max_nodes(MAX_NODES)
            .open_or_create()
            .map_err(|error| refused(&name, error))?;
        let subscriber = service
            .subscriber_builder()
            .buffer_size(buffer_samples)
            .create()
            .map_err(|error| refused(&name, error))?;
        Ok(Self { subscriber })
    }

    /// Subscribes beside the daemon to the service of `input`, which the daemon has created: samples from now on
    /// are received. Nobody waits for such a reader; what it does not receive in time it loses.
    pub fn open(node: &Node, instance: &Instance, input: &str) -> Result<Self, TransportError> {
        let name = instance.sample_service(input);
        let service: SampleService = node
            .service_builder(&service_name(&name)?)
            .publish_subscribe::<[f64]>()
            .user_header::<SampleHeader>()
            .open()
            .map_err(|error| open_error(&name, error))?;
        let subscriber = service
            .subscriber_builder()
            .create()
            .map_err(|error| refused(&name, error))?;
        Ok(Self { subscriber })
    }

    /// Hands every waiting sample to `take` as (publisher, header, elements), oldest first; returns how many.
    ///
    /// No allocation and no system call. A connection that cannot be read counts as no sample.
    pub fn receive(&self, mut take: impl FnMut(u128, SampleHeader, &[f64])) -> usize {
        let mut count = 0;
        while let Ok(Some(sample)) = self.subscriber.receive() {
            take(
                sample.header().publisher_id().value(),
                *sample.user_header(),
                sample.payload(),
            );
            count += 1;
        }
        count
    }
}

/// A sensor driver's end of one input.
pub struct SamplePublisher {
    publisher: Publisher<ipc::Service, [f64], SampleHeader>,
    service: String,
    sequence: u64,
}

impl SamplePublisher {
    /// Opens the service of `input`, which the daemon has created.
    pub fn open(node: &Node, instance: &Instance, input: &str) -> Result<Self, TransportError> {
        let name = instance.sample_service(input);
        let service: SampleService = node
            .service_builder(&service_name(&name)?)
            .publish_subscribe::<[f64]>()
            .user_header::<SampleHeader>()
            .open()
            .map_err(|error| open_error(&name, error))?;
        let publisher = service
            .publisher_builder()
            .initial_max_slice_len(MAX_SIGNALS)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(|error| refused(&name, error))?;
        room::reserve(instance)?;
        Ok(Self {
            publisher,
            service: name,
            sequence: 0,
        })
    }

    /// Sends one sample taken at `timestamp_ns` (daemon's time) with the next sequence number.
    pub fn send(&mut self, timestamp_ns: u64, elements: &[f64]) -> Result<(), SendError> {
        let header = SampleHeader {
            sequence: self.sequence,
            timestamp_ns,
        };
        self.send_with_header(header, elements)?;
        self.sequence += 1;
        Ok(())
    }

    /// Skips one sequence number: the receiver will know that a sample is lost.
    pub fn skip(&mut self) {
        self.sequence += 1;
    }

    /// Sends one sample under a header of the caller's making.
    pub fn send_with_header(&mut self, header: SampleHeader, elements: &[f64]) -> Result<(), SendError> {
        if elements.len() > MAX_SIGNALS {
            return Err(SendError::TooLong {
                length: elements.len(),
            });
        }
        let failed = |reason: String| SendError::Delivery {
            service: self.service.clone(),
            reason,
        };
        let sample = self
            .publisher
            .loan_slice_uninit(elements.len())
            .map_err(|error| failed(format!("{error:?}")))?;
        let mut sample = sample.write_from_slice(elements);
        *sample.user_header_mut() = header;
        sample.send().map_err(|error| failed(format!("{error:?}")))?;
        Ok(())
    }
}
