//! Files in and out, for everything that reads or writes one.
//!
//! In: regular files only and of limited size, because captures come from strangers ([`read`]). Out: a file appears complete or
//! not at all ([`write_atomic`]), and the folder of a command's `--out` holds only what this program made there ([`Out`]).

mod large;
mod lock;
mod manifest;
mod out;
mod overlap;
mod read;
mod write;

pub use large::Large;
pub use manifest::MANIFEST_FILE;
pub use out::{Out, OutRules, grows, made_elsewhere};
pub use overlap::refuse_overlap;
pub use read::{Limit, read, read_as, read_if_there, record_reads, recorded_reads};
pub use write::{write_atomic, write_single};

/// SHA-256 as 64 hexadecimal digits.
pub fn sha256_hex(bytes: &[u8]) -> String {
    use sha2::Digest as _;
    sha2::Sha256::digest(bytes).iter().map(|b| format!("{b:02x}")).collect()
}
