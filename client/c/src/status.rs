//! Error codes, the text of the last error, and the wall that no panic passes.

use std::any::Any;
use std::cell::RefCell;
use std::ffi::{CStr, CString, c_char};
use std::panic::{AssertUnwindSafe, catch_unwind};

use residual::{InstanceNameError, MonitorError, OpenError, ReadError};

/// What a function gives back.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum residual_status {
    /// It worked.
    Ok = 0,
    /// There is no event, or none came in time. Not an error: residual_last_error() is as it was.
    Nothing = 1,
    /// A pointer is NULL, a text is not UTF-8, or a name or an index cannot be.
    InvalidArgument = 2,
    /// There is no bounds table: the daemon has not been started, or has another instance name or directory.
    NoDaemon = 3,
    /// This user may not read the bounds table.
    PermissionDenied = 4,
    /// The daemon is of a release with another layout of the table.
    OtherLayout = 5,
    /// The file is damaged, or no bounds table at all.
    Damaged = 6,
    /// The daemon has no diagnoser of this name (any more).
    NoSuchDiagnoser = 7,
    /// The daemon overtook every attempt to read; try again.
    Overtaken = 8,
    /// The operating system refused something else.
    System = 9,
    /// A defect of this library; the handle must only be closed.
    Internal = 10,
}

/// An error before it becomes a code.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    #[error("`{0}` is NULL")]
    Null(&'static str),
    #[error("`{0}` is not UTF-8")]
    NotUtf8(&'static str),
    #[error("there is no {what} {index}; there are {count}")]
    NoSuch {
        what: &'static str,
        index: usize,
        count: usize,
    },
    #[error("{0} is no start of a listener; use one of RESIDUAL_ALARM_START_…")]
    Start(u32),
    #[error(transparent)]
    Name(#[from] InstanceNameError),
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Monitor(#[from] MonitorError),
    #[error("no bounds table has been found yet")]
    NoTable,
}

impl Failure {
    fn status(&self) -> residual_status {
        match self {
            Self::Null(_) | Self::NotUtf8(_) | Self::NoSuch { .. } | Self::Start(_) => {
                residual_status::InvalidArgument
            }
            Self::Name(_) => residual_status::InvalidArgument,
            Self::NoTable | Self::Open(OpenError::NotFound { .. }) => residual_status::NoDaemon,
            Self::Open(OpenError::PermissionDenied { .. }) => residual_status::PermissionDenied,
            Self::Open(OpenError::OtherLayout { .. }) => residual_status::OtherLayout,
            Self::Open(
                OpenError::NotATable { .. } | OpenError::Truncated { .. } | OpenError::Damaged { .. },
            ) => residual_status::Damaged,
            Self::Open(OpenError::Io { .. }) => residual_status::System,
            Self::Monitor(MonitorError::NoSuchDiagnoser { .. }) => residual_status::NoSuchDiagnoser,
            Self::Monitor(MonitorError::Read(ReadError::Contended { .. })) => residual_status::Overtaken,
            Self::Monitor(MonitorError::ForeignHandle | MonitorError::Read(_)) => {
                residual_status::InvalidArgument
            }
        }
    }
}

thread_local! {
    static LAST_ERROR: RefCell<CString> = RefCell::default();
}

/// Runs a function of the interface: keeps the text of its error, and turns a panic into a code.
pub(crate) fn guarded(action: impl FnOnce() -> Result<residual_status, Failure>) -> residual_status {
    // After a panic the handle is only good for being closed, as the code says; nothing else is shared.
    match catch_unwind(AssertUnwindSafe(action)) {
        Ok(Ok(status)) => status,
        Ok(Err(failure)) => {
            remember(failure.to_string());
            failure.status()
        }
        Err(panic) => {
            remember(format!("defect of the library: {}", message(&*panic)));
            residual_status::Internal
        }
    }
}

fn message(panic: &(dyn Any + Send)) -> &str {
    let text = panic.downcast_ref::<&str>().copied();
    text.or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("unknown")
}

fn remember(text: String) {
    // Names of a table hold no zero byte; a path cannot either.
    let text = CString::new(text).unwrap_or_default();
    LAST_ERROR.with_borrow_mut(|last| *last = text);
}

/// The text of the last error of the calling thread; empty if there has been none.
///
/// Valid until the next function of this library fails in the same thread.
#[unsafe(no_mangle)]
pub extern "C" fn residual_last_error() -> *const c_char {
    LAST_ERROR.with_borrow(|last| last.as_ptr())
}

/// The text behind a pointer of the caller.
///
/// # Safety
/// `pointer` is NULL or points to a text that ends with a zero byte and stays as it is during `'a`.
pub(crate) unsafe fn text<'a>(pointer: *const c_char, name: &'static str) -> Result<&'a str, Failure> {
    if pointer.is_null() {
        return Err(Failure::Null(name));
    }
    // SAFETY: it is not NULL, and the rest is the caller's promise.
    let text = unsafe { CStr::from_ptr(pointer) };
    text.to_str().map_err(|_| Failure::NotUtf8(name))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn last_error() -> String {
        // SAFETY: the function gives a text with a zero byte, and nothing fails before it is copied.
        unsafe { CStr::from_ptr(residual_last_error()) }
            .to_str()
            .unwrap()
            .into()
    }

    #[test]
    fn a_panic_becomes_a_code_with_its_text() {
        let status = guarded(|| std::panic::resume_unwind(Box::new("broken")));
        assert_eq!(status, residual_status::Internal);
        assert_eq!(last_error(), "defect of the library: broken");
    }

    #[test]
    fn the_last_error_stays_until_the_next_one_and_belongs_to_its_thread() {
        assert_eq!(
            guarded(|| Err(Failure::Null("monitor"))),
            residual_status::InvalidArgument
        );
        assert_eq!(guarded(|| Ok(residual_status::Ok)), residual_status::Ok);
        assert_eq!(last_error(), "`monitor` is NULL");
        assert_eq!(std::thread::spawn(last_error).join().unwrap(), "");
    }
}
