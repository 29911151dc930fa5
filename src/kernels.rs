//! The table of compiled shaders that `build.rs` writes, and the check that a host struct has the layout of a shader's
//! push-constant block: a difference is a compile error.

/// How a binding is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A picture read through a sampler.
    SampledImage,
    /// A picture read and written by texel.
    StorageImage,
    /// A uniform buffer.
    UniformBuffer,
    /// A storage buffer.
    StorageBuffer,
    /// A buffer fetched by texel.
    TexelBuffer,
}

/// One binding of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Descriptor set.
    pub set: u32,
    /// Number within the set.
    pub binding: u32,
    /// How it is bound.
    pub kind: BindingKind,
    /// Its name in the shader.
    pub name: &'static str,
    /// Where a buffer is an array of structs: the members of one.
    pub members: &'static [Member],
}

/// One member of the push-constant block, or of a buffer's element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// Its name.
    pub name: &'static str,
    /// Offset in the block, bytes.
    pub offset: usize,
    /// Size, bytes.
    pub bytes: usize,
}

/// One compiled shader.
#[derive(Clone, Copy, Debug)]
pub struct Kernel {
    /// File name in `glsl/`.
    pub file: &'static str,
    /// Workgroup size (1, 1, 1 for graphics stages).
    pub local_size: [u32; 3],
    /// Bindings by set and number.
    pub bindings: &'static [Binding],
    /// Members of the push-constant block, empty when there is none.
    pub push_members: &'static [Member],
    /// SPIR-V.
    pub words: &'static [u32],
}

/// All shaders, by file name.
pub const TABLE: &[Kernel] = include!(concat!(env!("OUT_DIR"), "/kernel_table.rs"));

/// Stems of the effects that `pointwise.comp` fuses, in its order: a stem's place is its slot of parameters, and the
/// number of its specialization constant less one.
pub const POINTWISE: &[&str] = include!(concat!(env!("OUT_DIR"), "/pointwise.rs"));

/// The shader of that file name; usable in constants, where a wrong name is a compile error.
///
/// # Panics
/// If there is none.
pub const fn kernel(file: &str) -> &'static Kernel {
    let mut i = 0;
    while i < TABLE.len() {
        if same(TABLE[i].file, file) {
            return &TABLE[i];
        }
        i += 1;
    }
    panic!("no shader of that name in glsl/")
}

impl Kernel {
    /// Size of the push-constant block, bytes.
    pub const fn push_bytes(&self) -> usize {
        match self.push_members.last() {
            Some(last) => last.offset + last.bytes,
            None => 0,
        }
    }
}

/// Members of the struct that the buffer `name` of a shader holds an array of; usable in constants.
///
/// # Panics
/// If the shader has no such buffer.
pub const fn element_members(file: &str, name: &str) -> &'static [Member] {
    let bindings = kernel(file).bindings;
    let mut i = 0;
    while i < bindings.len() {
        if same(bindings[i].name, name) {
            return bindings[i].members;
        }
        i += 1;
    }
    panic!("no buffer of that name in the shader")
}

/// Compares strings in constants.
pub const fn same(a: &str, b: &str) -> bool {
    let (a, b) = (a.as_bytes(), b.as_bytes());
    if a.len() != b.len() {
        return false;
    }
    let mut i = 0;
    while i < a.len() {
        if a[i] != b[i] {
            return false;
        }
        i += 1;
    }
    true
}

/// Asserts at compile time that a `repr(C)` struct has the names, offsets and size of a shader's push-constant block.
#[macro_export]
macro_rules! assert_push_layout {
    ($file:literal, $name:ident { $($field:ident),+ $(,)? }) => {
        const _: () = {
            $crate::assert_members!($crate::kernels::kernel($file).push_members, $name { $($field),+ });
            assert!(core::mem::size_of::<$name>() <= 128, "Vulkan promises 128 bytes of push constants");
        };
    };
}

/// Asserts at compile time that a `repr(C)` struct has the names, offsets and size of the elements of a shader's
/// buffer.
#[macro_export]
macro_rules! assert_element_layout {
    ($file:literal, $buffer:literal, $name:ident { $($field:ident),+ $(,)? }) => {
        const _: () = {
            $crate::assert_members!($crate::kernels::element_members($file, $buffer), $name { $($field),+ });
        };
    };
}

/// What both of the above check, in a constant.
#[doc(hidden)]
#[macro_export]
macro_rules! assert_members {
    ($members:expr, $name:ident { $($field:ident),+ }) => {
        let members = $members;
        let mut i = 0;
        $(
            assert!(i < members.len(), "the host struct has more members than the shader's");
            assert!(
                $crate::kernels::same(members[i].name, stringify!($field)),
                concat!("the shader's member at the place of `", stringify!($field), "` has another name")
            );
            assert!(
                members[i].offset == core::mem::offset_of!($name, $field),
                concat!("the shader's member `", stringify!($field), "` has another offset")
            );
            i += 1;
        )+
        assert!(i == members.len(), "the shader's struct has more members than the host's");
        let end = members[i - 1].offset + members[i - 1].bytes;
        assert!(end == core::mem::size_of::<$name>(), "the host struct has another size than the shader's");
    };
}
