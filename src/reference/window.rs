//! A part of a picture.

use crate::camera::Intrinsics;

/// A part of the picture, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// First column.
    pub x: u32,
    /// First row.
    pub y: u32,
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl Window {
    /// The whole picture.
    pub fn whole(intrinsics: &Intrinsics) -> Self {
        Self { x: 0, y: 0, width: intrinsics.width, height: intrinsics.height }
    }
}
