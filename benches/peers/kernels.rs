//! Shaders of `benches/peers/glsl/`, compiled by the project's build script for benches alone.

use shutterbug::kernels::{Binding, BindingKind, Kernel, Member};

const TABLE: &[Kernel] = include!(concat!(env!("OUT_DIR"), "/peer_table.rs"));

/// The shader of that file name.
pub fn find(file: &str) -> &'static Kernel {
    TABLE.iter().find(|k| k.file == file).expect("a shader in benches/peers/glsl")
}

// The table names these only where a shader has such members.
const _: Option<(Binding, BindingKind, Member)> = None;
