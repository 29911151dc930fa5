//! Files in and out, for everything that reads or writes one.
//!
//! In: regular files only and of limited size, because captures come from strangers ([`read`]). Out: a file appears
//! complete or not at all ([`write_atomic`]). A caller can register a watcher of reads and writes ([`set_watcher`]).

mod read;
mod watch;
mod write;

pub use read::{Limit, is_there, open_regular, read, read_as, read_if_there};
pub use watch::{Watcher, set_watcher};
pub use write::{Existing, Staged, identity, is_temporary, put, stage, write_atomic, write_single};
