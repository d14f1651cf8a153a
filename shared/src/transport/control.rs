//! Control requests: one server in the daemon, clients of the same user.
//!
//! iceoryx2's request-response has no wait, and a request without a server is sent all the same and never
//! answered. So the client looks again and again until its time is over, and meanwhile whether the daemon is
//! still there.

use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::active_request::ActiveRequest;
use iceoryx2::pending_response::PendingResponse;
use iceoryx2::port::client::Client;
use iceoryx2::port::server::Server;
use iceoryx2::prelude::{AllocationStrategy, ipc};
use iceoryx2::service::builder::request_response::RequestResponseOpenError;
use iceoryx2::service::port_factory::request_response::PortFactory;
use nix::errno::Errno;
use nix::sys::signal::kill;
use nix::unistd::Pid;

use super::{MAX_NODES, Node, TransportError, open_node, refused, room, service_name};
use crate::bounds_table::{Liveness, TableReader};
use crate::clock::monotonic_ns;
use crate::control::{
    Answer, ControlCounters, ControlError, DecodeError, EncodeError, MAX_ANSWER_BYTES, MAX_REQUEST_BYTES,
    Request, Response, decode_answer, decode_request, encode_answer, encode_request,
};
use crate::names::Instance;

/// Clients at the same time: people and scripts, not programs in a loop. Each costs the daemon some answers' room.
const MAX_CLIENTS: usize = 8;

/// Servers at the same time: the daemon, and the remains of one that was killed just before.
const MAX_SERVERS: usize = 2;

/// Requests of one client on the way: it waits for each answer.
const MAX_ACTIVE_REQUESTS: usize = 1;

/// Requests taken in one call of [`ControlServer::receive`], so that a flood of them does not keep the companion
/// from its other work.
const REQUESTS_PER_CALL: usize = 2 * MAX_CLIENTS;

/// First pause between two looks for an answer; it doubles up to [`LONGEST_PAUSE`].
const FIRST_PAUSE: Duration = Duration::from_micros(100);

/// Longest pause between two looks for an answer: a fraction of what the companion takes to see a request.
const LONGEST_PAUSE: Duration = Duration::from_millis(2);

/// How often a waiting client looks whether the daemon is still there.
const LIVENESS_PERIOD: Duration = Duration::from_millis(100);

type ControlService = PortFactory<ipc::Service, [u8], (), [u8], ()>;

/// A request that waits for its answer.
#[derive(Debug)]
pub struct Asker {
    request: ActiveRequest<ipc::Service, [u8], (), [u8], ()>,
}

/// The daemon's end.
#[derive(Debug)]
pub struct ControlServer {
    server: Server<ipc::Service, [u8], (), [u8], ()>,
    counters: ControlCounters,
}

impl ControlServer {
    /// Creates the service, or opens it when clients have kept it alive.
    ///
    /// # Errors
    /// See [`TransportError`].
    pub fn create(node: &Node, instance: &Instance) -> Result<Self, TransportError> {
        let name = instance.control_service();
        let service: ControlService = node
            .service_builder(&service_name(&name)?)
            .request_response::<[u8], [u8]>()
            .enable_safe_overflow_for_requests(true)
            .enable_safe_overflow_for_responses(true)
            // A request whose client has given up is not obeyed any more.
            .enable_fire_and_forget_requests(false)
            .max_active_requests_per_client(MAX_ACTIVE_REQUESTS)
            .max_loaned_requests(1)
            .max_response_buffer_size(1)
            .max_borrowed_responses_per_pending_response(1)
            .max_servers(MAX_SERVERS)
            .max_clients(MAX_CLIENTS)
            .max_nodes(MAX_NODES)
            .open_or_create()
            .map_err(|error| refused(&name, error))?;
        let server = service
            .server_builder()
            .max_loaned_responses_per_request(1)
            .initial_max_slice_len(MAX_ANSWER_BYTES)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(|error| refused(&name, error))?;
        room::reserve(instance)?;
        Ok(Self {
            server,
            counters: ControlCounters::default(),
        })
    }

    /// Takes the waiting requests without waiting for any. What is none is answered with the reason here, and
    /// counted as rejected.
    pub fn receive(&mut self) -> Vec<(Request, Asker)> {
        let mut requests = Vec::new();
        for _ in 0..REQUESTS_PER_CALL {
            // A connection that cannot be read belongs to a client that died; nobody waits for its answer.
            let Ok(Some(request)) = self.server.receive() else {
                break;
            };
            let decoded = decode_request(request.payload());
            let asker = Asker { request };
            match decoded {
                Ok(request) => requests.push((request, asker)),
                Err(error) => {
                    self.counters.rejected += 1;
                    let _ = asker.send(&Err(error.into()));
                }
            }
        }
        requests
    }

    /// Answers a request, and counts it.
    pub fn answer(&mut self, asker: Asker, answer: &Answer) {
        let in_time = !matches!(answer, Err(ControlError::NotObeyed { .. }));
        match asker.send(answer) {
            Ok(()) if in_time => self.counters.answered += 1,
            Ok(()) | Err(ClientGone) => self.counters.timed_out += 1,
        }
    }

    /// What became of the requests so far.
    pub fn counters(&self) -> ControlCounters {
        self.counters
    }
}

/// The client has ended, or waits no longer.
struct ClientGone;

impl Asker {
    fn send(&self, answer: &Answer) -> Result<(), ClientGone> {
        let bytes = encode_answer(answer).or_else(|_| encode_answer(&Err(ControlError::AnswerTooLong)));
        let bytes = bytes.map_err(|_| ClientGone)?;
        if !self.request.is_connected() {
            return Err(ClientGone);
        }
        let loaned = self
            .request
            .loan_slice_uninit(bytes.len())
            .map_err(|_| ClientGone)?;
        loaned.write_from_slice(&bytes).send().map_err(|_| ClientGone)
    }
}

/// Why a request was not fulfilled.
#[derive(Debug, thiserror::Error)]
pub enum RequestError {
    /// Nobody can answer.
    #[error("there is no daemon of instance `{instance}` to ask; start residuald with this instance")]
    NoDaemon {
        /// The instance.
        instance: String,
    },
    /// The daemon ended before it answered.
    #[error("the daemon ended before it answered; the request may have been obeyed or not")]
    DaemonEnded,
    /// The daemon did not answer in time.
    #[error("no answer within {} s; is the daemon stopped or overloaded? The request may still be obeyed", waited.as_secs_f64())]
    TimedOut {
        /// How long the client waited.
        waited: Duration,
    },
    /// The daemon refused.
    #[error(transparent)]
    Refused(#[from] ControlError),
    /// The request cannot be sent.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The answer cannot be read.
    #[error("the daemon's answer is of no use: {0}")]
    Answer(#[from] DecodeError),
    /// The answer is to something else.
    #[error("the daemon answered something else; use a client of the daemon's release")]
    OtherAnswer,
    /// iceoryx2 refused.
    #[error(transparent)]
    Transport(#[from] TransportError),
}

/// A client's end.
#[derive(Debug)]
pub struct ControlClient {
    client: Client<ipc::Service, [u8], (), [u8], ()>,
    instance: Instance,
    // Last, so that it outlives its port.
    _node: Node,
}

impl ControlClient {
    /// Opens the service that the daemon has created.
    ///
    /// # Errors
    /// [`RequestError::NoDaemon`] if there is none; [`RequestError::Transport`] above all for another user than
    /// the daemon's, who may not ask.
    pub fn connect(instance: &Instance) -> Result<Self, RequestError> {
        let no_daemon = || RequestError::NoDaemon {
            instance: instance.name.to_string(),
        };
        if !instance.iceoryx_root().exists() || is_gone(instance) {
            return Err(no_daemon());
        }
        let name = instance.control_service();
        let node = open_node(instance)?;
        let service: ControlService = node
            .service_builder(&service_name(&name)?)
            .request_response::<[u8], [u8]>()
            .open()
            .map_err(|error| match error {
                RequestResponseOpenError::DoesNotExist => no_daemon(),
                other => refused(&name, other).into(),
            })?;
        let client = service
            .client_builder()
            .initial_max_slice_len(MAX_REQUEST_BYTES)
            .allocation_strategy(AllocationStrategy::Static)
            .create()
            .map_err(|error| refused(&name, error))?;
        room::reserve(instance)?;
        Ok(Self {
            client,
            instance: instance.clone(),
            _node: node,
        })
    }

    /// Sends a request and waits for its answer, at most `timeout`.
    ///
    /// # Errors
    /// See [`RequestError`]; after [`RequestError::TimedOut`] the request is obeyed only if the daemon had begun
    /// with it.
    pub fn request(&self, request: &Request, timeout: Duration) -> Result<Response, RequestError> {
        let bytes = encode_request(request)?;
        let failed = |reason| RequestError::Transport(refused(&self.instance.control_service(), reason));
        let loaned = self
            .client
            .loan_slice_uninit(bytes.len())
            .map_err(|error| failed(format!("{error:?}")))?;
        let pending = loaned
            .write_from_slice(&bytes)
            .send()
            .map_err(|error| failed(format!("{error:?}")))?;
        Ok(self.wait(&pending, timeout)??)
    }

    fn wait(
        &self,
        pending: &PendingResponse<ipc::Service, [u8], (), [u8], ()>,
        timeout: Duration,
    ) -> Result<Answer, RequestError> {
        let begin = Instant::now();
        let (mut pause, mut look_after) = (FIRST_PAUSE, LIVENESS_PERIOD);
        loop {
            match pending.receive() {
                Ok(Some(response)) => return Ok(decode_answer(response.payload())?),
                Ok(None) => {}
                Err(error) => return Err(refused(&self.instance.control_service(), error).into()),
            }
            let waited = begin.elapsed();
            if waited >= look_after {
                look_after += LIVENESS_PERIOD;
                if is_gone(&self.instance) {
                    return Err(RequestError::DaemonEnded);
                }
            }
            if waited >= timeout {
                return Err(RequestError::TimedOut { waited: timeout });
            }
            thread::sleep(pause.min(timeout - waited));
            pause = (2 * pause).min(LONGEST_PAUSE);
        }
    }
}

/// Whether the daemon has certainly ended: in good order, or its process is no more. A daemon that is starting, or
/// stopped, is not gone.
fn is_gone(instance: &Instance) -> bool {
    let Ok(table) = TableReader::open(&instance.bounds_path()) else {
        return false;
    };
    match table.liveness(monotonic_ns()) {
        Liveness::Running => false,
        Liveness::Closed => true,
        Liveness::Hung(_) => {
            kill(Pid::from_raw(table.directory().pid.cast_signed()), None) == Err(Errno::ESRCH)
        }
    }
}
