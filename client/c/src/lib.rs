//! The client library for C and whatever can call it.
//!
//! `include/residual_client.h` is generated from this crate; a test keeps it so. Every function checks its pointers
//! for NULL, gives a
//! [`residual_status`](status::residual_status), keeps the text of an error for
//! [`residual_last_error`](status::residual_last_error), and lets no panic out.
//!
//! References in the signatures are pointers in C: `Option<&mut T>` is one that may be NULL, `MaybeUninit` marks
//! what is only written, `Option<Box<T>>` is one that the library made and takes back. So what remains of unsafe code
//! is the reading of texts.
// Functions that C calls by their names, and texts behind pointers of the caller.
#![allow(unsafe_code)]
// Types have the names that they have in C.
#![allow(non_camel_case_types)]

pub mod alarms;
pub mod monitor;
pub mod record;
pub mod status;
pub mod text;
