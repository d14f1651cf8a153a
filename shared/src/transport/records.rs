//! Every step record, for recorders: one publisher in the daemon, any number of subscribers of the same user.

use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{ZeroCopySend, ipc};
use iceoryx2::service::port_factory::PortFactory as _;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::{MAX_NODES, Node, SendError, TransportError, open_error, refused, room, service_name};
use crate::names::Instance;
use crate::record::StepRecord;

/// How many recorders may be attached at once; each costs the buffer below in shared memory, about 2 MB.
const MAX_RECORDERS: usize = 4;

/// Records kept for a recorder between two receptions: ten seconds of one diagnoser at 100 Hz.
const RECORDER_BUFFER: usize = 1024;

/// User header of a step record on the wire.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ZeroCopySend)]
#[type_name("residual.RecordHeader.v2")]
pub struct RecordHeader {
    /// Number of the record, rising by 1 over all diagnosers and epochs of one publisher; a step above 1 is a known
    /// loss.
    pub sequence: u64,
    /// The diagnoser: its slot in the bounds table with this `epoch`.
    pub slot: u64,
    /// Epoch of the bounds table that the slot belongs to. It rises with every reload and restart of the daemon, in
    /// order with the records; a slot of another epoch may be another diagnoser.
    pub epoch: u64,
}

type RecordService = PortFactory<ipc::Service, StepRecord, RecordHeader>;

/// The daemon's end of the stream of step records.
pub struct RecordPublisher {
    publisher: Publisher<ipc::Service, StepRecord, RecordHeader>,
    service: String,
    sequence: u64,
}

impl RecordPublisher {
    /// Creates the service, or opens it when recorders have kept it alive.
    pub fn create(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        let name = instance.record_service();
        let service: RecordService = node
            .service_builder(&service_name(&name)?)
            .publish_subscribe::<StepRecord>()
            .user_header::<RecordHeader>()
            .enable_safe_overflow(true)
            .subscriber_max_buffer_size(RECORDER_BUFFER)
            .max_subscribers(MAX_RECORDERS)
            .max_nodes(MAX_NODES)
            .open_or_create()
            .map_err(|error| refused(&name, error))?;
        let publisher = service
            .publisher_builder()
            .create()
            .map_err(|error| refused(&name, error))?;
        room::reserve(instance)?;
        Ok(Self {
            publisher,
            service: name,
            sequence: 0,
        })
    }

    /// Sends one record of the diagnoser in `slot` of the table with this `epoch`. Allocates: never call it on the
    /// step thread.
    pub fn send(&mut self, epoch: u64, slot: usize, record: &StepRecord) -> Result<(), SendError> {
        let failed = |reason: String| SendError::Delivery {
            service: self.service.clone(),
            reason,
        };
        let sample = self
            .publisher
            .loan_uninit()
            .map_err(|error| failed(format!("{error:?}")))?;
        let mut sample = sample.write_payload(*record);
        *sample.user_header_mut() = RecordHeader {
            sequence: self.sequence,
            slot: slot as u64,
            epoch,
        };
        sample.send().map_err(|error| failed(format!("{error:?}")))?;
        self.sequence += 1;
        Ok(())
    }
}

/// Whether there is anybody to send step records to.
pub struct RecordAudience {
    service: RecordService,
}

impl RecordAudience {
    /// Opens the service that a [`RecordPublisher`] has created.
    pub fn open(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        Ok(Self {
            service: open_service(node, &instance.record_service())?,
        })
    }

    /// Whether nobody listens. One look at shared memory: no allocation and no system call.
    pub fn is_empty(&self) -> bool {
        self.service.dynamic_config().number_of_subscribers() == 0
    }
}

fn open_service(node: &Node, name: &str) -> Result<RecordService, TransportError> {
    node.service_builder(&service_name(name)?)
        .publish_subscribe::<StepRecord>()
        .user_header::<RecordHeader>()
        .open()
        .map_err(|error| open_error(name, error))
}

/// A recorder's end of the stream of step records.
pub struct RecordSubscriber {
    subscriber: Subscriber<ipc::Service, StepRecord, RecordHeader>,
}

impl RecordSubscriber {
    /// Opens the daemon's stream; records from now on are received.
    pub fn open(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        let name = instance.record_service();
        let subscriber = open_service(node, &name)?
            .subscriber_builder()
            .buffer_size(RECORDER_BUFFER)
            .create()
            .map_err(|error| refused(&name, error))?;
        Ok(Self { subscriber })
    }

    /// Hands every waiting record to `take`, oldest first; returns how many.
    pub fn receive(&self, mut take: impl FnMut(RecordHeader, &StepRecord)) -> usize {
        self.receive_with_publisher(|_, header, record| take(header, record))
    }

    /// Hands every waiting record to `take` as (publisher, header, record), oldest first; returns how many. Each
    /// life of the daemon is another publisher, whose sequence numbers begin with 0.
    pub fn receive_with_publisher(&self, mut take: impl FnMut(u128, RecordHeader, &StepRecord)) -> usize {
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
