//! The iceoryx2 services of an instance: samples in, step records and the news of alarms out, control requests and
//! answers.
//!
//! The daemon creates every service, so its limits hold; publishers and recorders only open. Everyone who may
//! write into this memory is one trust domain (same user); readers outside it use the
//! [bounds table](crate::bounds_table).
//!
//! Overflow is always on: a slow receiver loses the oldest sample and no publisher ever waits. Loss shows as a
//! gap in the sequence numbers.

use std::fs;
use std::io;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use iceoryx2::config::Config;
use iceoryx2::node::{Node as IceoryxNode, NodeBuilder, NodeState};
use iceoryx2::prelude::{
    CallbackProgression, FileName, Path as IceoryxPath, SemanticString, ServiceName, SignalHandlingMode, ipc,
};
use iceoryx2::service::builder::publish_subscribe::PublishSubscribeOpenError;

use crate::names::Instance;
use nix::unistd::{Uid, User};

mod alarm_events;
mod control;
mod records;
mod room;
mod samples;

pub use alarm_events::{AlarmEvents, AlarmNotifier};
pub use control::{Asker, ControlClient, ControlServer, RequestError};
pub use records::{RecordAudience, RecordHeader, RecordPublisher, RecordSubscriber};
pub use samples::{SamplePublisher, SampleSubscriber, SendError};

/// A process's access to the iceoryx2 services of one instance.
pub type Node = IceoryxNode<ipc::Service>;

/// Where iceoryx2 keeps its shared memory, whatever its root directory is.
const SHARED_MEMORY: &str = "/dev/shm";

/// How many processes may be attached to one service; iceoryx2's own default is 20.
const MAX_NODES: usize = 40;

/// Why a node, service or port could not be had.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// The path does not fit iceoryx2's limits.
    #[error(
        "iceoryx2 cannot use the directory `{path}`: its sockets would have too long paths; choose a shorter \
         instance name or runtime directory"
    )]
    Path {
        /// The refused path.
        path: PathBuf,
    },
    /// The operating system refused a directory or file.
    #[error("cannot prepare `{path}`: {source}")]
    Directory {
        /// The path.
        path: PathBuf,
        /// The system's reason.
        source: io::Error,
    },
    /// A file system is full.
    #[error(
        "`{directory}` has no room for {} KiB of shared memory; free some of it or make it larger \
         (mount -o remount,size=…)",
        bytes.div_ceil(1024)
    )]
    NoRoom {
        /// Where there is no room.
        directory: PathBuf,
        /// What is needed, bytes.
        bytes: u64,
    },
    /// Another user runs the instance.
    #[error(
        "the iceoryx2 services of instance `{instance}` (samples, step records, control) are open to the user \
         `{user}` only, who runs it: work as that user (sudo -u {user} …), or read the bounds table instead"
    )]
    OtherUser {
        /// The instance.
        instance: String,
        /// Name of the user, or the uid.
        user: String,
    },
    /// The node could not be created.
    #[error("cannot join iceoryx2 of instance `{instance}`: {reason}")]
    Node {
        /// The instance.
        instance: String,
        /// iceoryx2's reason.
        reason: String,
    },
    /// The service does not exist: nobody has created it.
    #[error("service `{service}` does not exist: start residuald with this instance first")]
    NoService {
        /// The service's name.
        service: String,
    },
    /// The service exists but does not fit, or iceoryx2 refused it.
    #[error("cannot use service `{service}`: {reason}")]
    Service {
        /// The service's name.
        service: String,
        /// iceoryx2's reason.
        reason: String,
    },
}

/// Opens a node of this process on the instance. Signals stay the process's own business.
pub fn open_node(instance: &Instance) -> Result<Node, TransportError> {
    let root = instance.iceoryx_root();
    refuse_other_users(instance, &root)?;
    create_private_directory(&root)?;
    room::check(instance)?;
    let config = configuration(instance)?;
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .map_err(|error| TransportError::Node {
            instance: instance.name.to_string(),
            reason: format!("{error:?}"),
        })?;
    restrict_management_segments(instance);
    Ok(node)
}

/// Removes what dead processes left behind, provided that no process of the instance is alive.
///
/// Only the holder of the instance's lock may call it, before opening its own node.
pub fn remove_leftovers(instance: &Instance) -> Result<(), TransportError> {
    let root = instance.iceoryx_root();
    if !root.exists() {
        return Ok(());
    }
    let mut in_use = false;
    let listed = Node::list(&configuration(instance)?, |state| {
        in_use |= matches!(state, NodeState::Alive(_) | NodeState::Inaccessible(_));
        CallbackProgression::Continue
    });
    if in_use || listed.is_err() {
        return Ok(());
    }
    fs::remove_dir_all(&root).map_err(|source| TransportError::Directory { path: root, source })?;
    for path in management_files(instance) {
        fs::remove_file(&path).map_err(|source| TransportError::Directory { path, source })?;
    }
    Ok(())
}

/// iceoryx2's configuration for an instance; never the machine's implicit one.
fn configuration(instance: &Instance) -> Result<Config, TransportError> {
    let root = instance.iceoryx_root();
    let refused = |_| TransportError::Path { path: root.clone() };
    let mut config = Config::default();
    let path = IceoryxPath::new(root.as_os_str().as_encoded_bytes()).map_err(refused)?;
    config.global.set_root_path(&path);
    config.global.prefix = FileName::new(instance.iceoryx_prefix().as_bytes()).map_err(refused)?;
    Ok(config)
}

/// Says whose the instance is, where iceoryx2 would only say that it failed. Root may do everything.
fn refuse_other_users(instance: &Instance, root: &Path) -> Result<(), TransportError> {
    let own = Uid::effective();
    match fs::metadata(root).map(|metadata| Uid::from_raw(metadata.uid())) {
        Ok(owner) if owner != own && !own.is_root() => Err(TransportError::OtherUser {
            instance: instance.name.to_string(),
            user: (User::from_uid(owner).ok().flatten()).map_or_else(|| owner.to_string(), |user| user.name),
        }),
        _ => Ok(()),
    }
}

fn create_private_directory(path: &Path) -> Result<(), TransportError> {
    let error = |source| TransportError::Directory {
        path: path.into(),
        source,
    };
    match fs::create_dir(path) {
        Ok(()) => fs::set_permissions(path, fs::Permissions::from_mode(0o700)).map_err(error),
        Err(exists) if exists.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        Err(source) => Err(error(source)),
    }
}

/// Takes the world's write permission from iceoryx2's management memory: any user could otherwise truncate it
/// and keep every later process of the instance from starting.
fn restrict_management_segments(instance: &Instance) {
    for path in management_files(instance) {
        if let Ok(metadata) = fs::metadata(&path)
            && metadata.permissions().mode() & 0o007 != 0
        {
            // Another user's file cannot be changed; its owner has done so already.
            let _ = fs::set_permissions(&path, fs::Permissions::from_mode(0o660));
        }
    }
}

/// Shared memory of the instance.
fn management_files(instance: &Instance) -> Vec<PathBuf> {
    let prefix = instance.iceoryx_prefix();
    let belongs = |path: &PathBuf| {
        path.file_name()
            .is_some_and(|name| name.as_encoded_bytes().starts_with(prefix.as_bytes()))
    };
    let entries = fs::read_dir(SHARED_MEMORY).into_iter().flatten().flatten();
    entries.map(|entry| entry.path()).filter(belongs).collect()
}

fn service_name(name: &str) -> Result<ServiceName, TransportError> {
    ServiceName::new(name).map_err(|error| TransportError::Service {
        service: name.into(),
        reason: format!("{error:?}"),
    })
}

fn refused(service: &str, reason: impl std::fmt::Debug) -> TransportError {
    TransportError::Service {
        service: service.into(),
        reason: format!("{reason:?}"),
    }
}

fn open_error(service: &str, error: PublishSubscribeOpenError) -> TransportError {
    match error {
        PublishSubscribeOpenError::DoesNotExist => TransportError::NoService {
            service: service.into(),
        },
        other => refused(service, other),
    }
}
