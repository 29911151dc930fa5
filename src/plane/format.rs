//! How a caller's pixels lie in memory.

/// Layout of one pixel. Values of several bytes are little-endian. The numbers are those of the C header and of the
/// unpacking kernels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum PixelFormat {
    /// Three bytes: red, green, blue.
    Rgb8 = 1,
    /// Four bytes: red, green, blue, alpha.
    Rgba8 = 2,
    /// Four bytes: blue, green, red, alpha.
    Bgra8 = 3,
    /// Four half floats.
    Rgba16f = 4,
    /// Four floats.
    Rgba32f = 5,
    /// One float: depth.
    R32f = 6,
    /// Two half floats: motion.
    Rg16f = 7,
    /// Two floats: motion.
    Rg32f = 8,
    /// One word: ids.
    R32u = 9,
    /// Two bytes: ids.
    R16u = 10,
    /// One byte: ids.
    R8u = 11,
}

impl PixelFormat {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Rgb8,
        Self::Rgba8,
        Self::Bgra8,
        Self::Rgba16f,
        Self::Rgba32f,
        Self::R32f,
        Self::Rg16f,
        Self::Rg32f,
        Self::R32u,
        Self::R16u,
        Self::R8u,
    ];

    /// The format of that number.
    pub fn from_code(code: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|f| *f as u32 == code)
    }

    /// Bytes a pixel.
    pub fn bytes(self) -> usize {
        match self {
            Self::R8u => 1,
            Self::R16u => 2,
            Self::Rgb8 => 3,
            Self::Rgba8 | Self::Bgra8 | Self::R32f | Self::Rg16f | Self::R32u => 4,
            Self::Rgba16f | Self::Rg32f => 8,
            Self::Rgba32f => 16,
        }
    }

    /// Bytes that one value takes: addresses and strides are multiples of it.
    pub fn alignment(self) -> usize {
        match self {
            Self::Rgb8 | Self::Rgba8 | Self::Bgra8 | Self::R8u => 1,
            Self::Rgba16f | Self::Rg16f | Self::R16u => 2,
            Self::Rgba32f | Self::R32f | Self::Rg32f | Self::R32u => 4,
        }
    }

    /// Whether it holds colour.
    pub fn is_color(self) -> bool {
        matches!(self, Self::Rgb8 | Self::Rgba8 | Self::Bgra8 | Self::Rgba16f | Self::Rgba32f)
    }

    /// Whether it holds ids.
    pub fn is_ids(self) -> bool {
        matches!(self, Self::R32u | Self::R16u | Self::R8u)
    }

    /// Whether it holds motion.
    pub fn is_motion(self) -> bool {
        matches!(self, Self::Rg16f | Self::Rg32f)
    }
}
