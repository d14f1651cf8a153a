//! The peer of the bounds table: an iceoryx2 blackboard with one entry of the same size.

use anyhow::{Context, Result};
use iceoryx2::port::reader::{EntryHandle, Reader};
use iceoryx2::port::writer::{EntryHandleMut, Writer};
use iceoryx2::prelude::{LogLevel, ipc, set_log_level};
use iceoryx2::service::port_factory::blackboard::PortFactory;
use residual_shared::names::Instance;
use residual_shared::transport::{self, Node};

use super::RECORD_WORDS;

/// As large as the record.
pub type Value = [u64; RECORD_WORDS];

const SERVICE: &str = "bench/blackboard";
const KEY: u64 = 1;
/// More than there are readers, and the writer.
const PROCESSES: usize = 80;

/// The writer's end.
pub struct Board {
    /// The entry; goes first.
    pub entry: EntryHandleMut<ipc::Service, u64, Value>,
    _writer: Writer<ipc::Service, u64>,
    _service: PortFactory<ipc::Service, u64>,
    _node: Node,
}

/// What a reader's entry lives on.
pub struct Ports {
    _reader: Reader<ipc::Service, u64>,
    _service: PortFactory<ipc::Service, u64>,
    _node: Node,
}

impl Board {
    /// Creates the blackboard.
    ///
    /// # Errors
    /// iceoryx2 refuses.
    pub fn create(instance: &Instance) -> Result<Self> {
        let node = open_node(instance)?;
        let service = node
            .service_builder(&SERVICE.try_into().context("the name of the blackboard")?)
            .blackboard_creator::<u64>()
            .max_readers(PROCESSES)
            .max_nodes(PROCESSES)
            .add::<Value>(KEY, [0; RECORD_WORDS])
            .create()?;
        let writer = service.writer_builder().create()?;
        Ok(Self {
            entry: writer.entry::<Value>(&KEY)?,
            _writer: writer,
            _service: service,
            _node: node,
        })
    }
}

/// Opens it for reading.
///
/// # Errors
/// There is none.
pub fn attach(instance: &Instance) -> Result<(Ports, EntryHandle<ipc::Service, u64, Value>)> {
    let node = open_node(instance)?;
    let service = node
        .service_builder(&SERVICE.try_into().context("the name of the blackboard")?)
        .blackboard_opener::<u64>()
        .open()?;
    let reader = service.reader_builder().create()?;
    let entry = reader.entry::<Value>(&KEY)?;
    let ports = Ports {
        _reader: reader,
        _service: service,
        _node: node,
    };
    Ok((ports, entry))
}

/// A node whose blackboards say nothing of iceoryx2's implicit configuration, which they read and do not use.
fn open_node(instance: &Instance) -> Result<Node> {
    set_log_level(LogLevel::Error);
    Ok(transport::open_node(instance)?)
}
