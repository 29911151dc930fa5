//! Arrays of Python as pictures of the C ABI, read where they lie.
#![allow(unsafe_code)]

use std::ffi::c_void;

use pyo3::buffer::{Element, PyBuffer};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::inspect::PyStaticExpr;
use pyo3::prelude::*;
use shutterbug::capi::shutterbug_image;

use crate::abi::sized;

/// An array of doubles.
pub struct Doubles(pub PyBuffer<f64>);

impl<'a, 'py> FromPyObject<'a, 'py> for Doubles {
    type Error = PyErr;

    /// The type that stubs give: of buffers, type checkers know nothing before Python 3.12.
    const INPUT_TYPE: PyStaticExpr = PyStaticExpr::Subscript {
        value: &PyStaticExpr::Attribute {
            value: &PyStaticExpr::Name { id: "numpy.typing" },
            attr: "NDArray",
        },
        slice: &PyStaticExpr::Attribute { value: &PyStaticExpr::Name { id: "numpy" }, attr: "float64" },
    };

    fn extract(array: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        PyBuffer::extract(array).map(Self)
    }
}

const RGB8: u32 = 1;
const RGBA8: u32 = 2;
const RGBA32F: u32 = 5;
const R32F: u32 = 6;
const RG32F: u32 = 8;
const R32U: u32 = 9;
const R16U: u32 = 10;
const R8U: u32 = 11;
const RGB16: u32 = 13;
const RGBA16: u32 = 14;
const BAYER10: u32 = 15;
const BAYER16: u32 = 18;
const MIPI_RAW10: u32 = 19;
const MIPI_RAW14: u32 = 21;
const BOTTOM_UP: u32 = 0x1_0000;

/// What an array is taken for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// (height, width, 3 or 4) of uint8 or float32.
    Color,
    /// (height, width) of float32.
    Depth,
    /// (height, width) of uint8, uint16, uint32 or int32.
    Ids,
    /// (height, width, 2) of float32.
    Motion,
}

/// What keeps the pixels alive while the library reads them.
#[expect(dead_code, reason = "held, never looked at")]
enum Held {
    U8(PyBuffer<u8>),
    U16(PyBuffer<u16>),
    U32(PyBuffer<u32>),
    I32(PyBuffer<i32>),
    F32(PyBuffer<f32>),
    Packed(Vec<f32>),
}

/// A picture of Python's.
pub struct Picture {
    image: shutterbug_image,
    _held: Held,
}

// SAFETY: the pointer is to memory that `_held` keeps where it is, and that is only read.
unsafe impl Send for Picture {}
// SAFETY: as above.
unsafe impl Sync for Picture {}

impl Picture {
    /// Takes an array as it lies in memory: rows any distance apart, also backwards, pixels side by side. Colour of
    /// three floats is the one thing that is copied, because the library reads four.
    pub fn of(py: Python<'_>, array: &Bound<'_, PyAny>, kind: Kind) -> PyResult<Self> {
        if let Ok(buffer) = PyBuffer::<f32>::get(array) {
            return Self::of_floats(py, buffer, kind);
        }
        match kind {
            Kind::Color => {
                let buffer = PyBuffer::<u8>::get(array).map_err(|_| wrong(kind))?;
                let format = match buffer.shape() {
                    [_, _, 3] => RGB8,
                    [_, _, 4] => RGBA8,
                    _ => return Err(wrong(kind)),
                };
                Ok(Self { image: layout(&buffer, format)?, _held: Held::U8(buffer) })
            }
            Kind::Ids => Self::of_ids(array),
            Kind::Depth | Kind::Motion => Err(wrong(kind)),
        }
    }

    fn of_floats(py: Python<'_>, buffer: PyBuffer<f32>, kind: Kind) -> PyResult<Self> {
        let format = match (kind, buffer.shape()) {
            (Kind::Color, [_, _, 4]) => RGBA32F,
            (Kind::Color, [_, _, 3]) => return Self::packed(py, &buffer),
            (Kind::Depth, [_, _]) => R32F,
            (Kind::Motion, [_, _, 2]) => RG32F,
            _ => return Err(wrong(kind)),
        };
        Ok(Self { image: layout(&buffer, format)?, _held: Held::F32(buffer) })
    }

    fn of_ids(array: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(buffer) = PyBuffer::<i32>::get(array) {
            return Ok(Self { image: layout(&buffer, R32U)?, _held: Held::I32(buffer) });
        }
        if let Ok(buffer) = PyBuffer::<u32>::get(array) {
            return Ok(Self { image: layout(&buffer, R32U)?, _held: Held::U32(buffer) });
        }
        if let Ok(buffer) = PyBuffer::<u16>::get(array) {
            return Ok(Self { image: layout(&buffer, R16U)?, _held: Held::U16(buffer) });
        }
        let buffer = PyBuffer::<u8>::get(array).map_err(|_| wrong(Kind::Ids))?;
        Ok(Self { image: layout(&buffer, R8U)?, _held: Held::U8(buffer) })
    }

    fn packed(py: Python<'_>, buffer: &PyBuffer<f32>) -> PyResult<Self> {
        let [height, width, _] = *buffer.shape() else { return Err(wrong(Kind::Color)) };
        let from = buffer.to_vec(py)?;
        let mut to = vec![1.0f32; width * height * 4];
        for (to, from) in to.chunks_exact_mut(4).zip(from.chunks_exact(3)) {
            to[..3].copy_from_slice(from);
        }
        let mut image = blank(RGBA32F, [width, height])?;
        (image.stride_bytes, image.capacity_bytes) = (width as u64 * 16, to.len() as u64 * 4);
        image.pixels = to.as_mut_ptr().cast();
        Ok(Self { image, _held: Held::Packed(to) })
    }

    /// The picture as the C ABI has it. Its pixels live as long as this.
    pub fn image(&self) -> *const shutterbug_image {
        &raw const self.image
    }
}

fn wrong(kind: Kind) -> PyErr {
    let expected = match kind {
        Kind::Color => "colour is (height, width, 3 or 4) of uint8 or float32",
        Kind::Depth => "depth is (height, width) of float32",
        Kind::Ids => "ids are (height, width) of int32, uint32, uint16 or uint8",
        Kind::Motion => "motion is (height, width, 2) of float32",
    };
    PyTypeError::new_err(expected)
}

fn blank(format: u32, [width, height]: [usize; 2]) -> PyResult<shutterbug_image> {
    let mut image: shutterbug_image = sized();
    let side = |n: usize| {
        u32::try_from(n)
            .ok()
            .filter(|n| *n > 0)
            .ok_or_else(|| PyValueError::new_err("an array has a side of 0 px"))
    };
    (image.format, image.width, image.height) = (format, side(width)?, side(height)?);
    Ok(image)
}

fn layout<T: Element>(buffer: &PyBuffer<T>, format: u32) -> PyResult<shutterbug_image> {
    let (shape, strides, item) = (buffer.shape(), buffer.strides(), buffer.item_size());
    let channels = shape.get(2).copied().unwrap_or(1);
    let pixel_bytes = channels * item;
    let mut image = blank(format, [shape[1], shape[0]])?;
    let row_bytes = shape[1] * pixel_bytes;
    let beside = strides.get(2).is_none_or(|s| *s == item as isize || channels == 1)
        && (strides[1] == pixel_bytes as isize || shape[1] == 1);
    let apart = strides[0].unsigned_abs();
    if !beside || (apart < row_bytes && shape[0] > 1) {
        return Err(PyValueError::new_err(
            "an array's pixels lie not side by side: use numpy.ascontiguousarray",
        ));
    }
    let mut first = buffer.buf_ptr().cast::<u8>();
    if strides[0] < 0 && shape[0] > 1 {
        image.format += BOTTOM_UP;
        // SAFETY: the last row, which is in the array and lowest in memory.
        first = unsafe { first.offset(strides[0] * (shape[0] as isize - 1)) };
    }
    image.stride_bytes = apart.max(row_bytes) as u64;
    image.capacity_bytes = image.stride_bytes * (shape[0] as u64 - 1) + row_bytes as u64;
    image.pixels = first.cast::<c_void>();
    Ok(image)
}

/// An array that a plane is written to, writable and with pixels side by side: (height, width, 3 or 4) of uint8, uint16
/// or float32 (4 alone), raw numbers (height, width) of uint16, or packed rows (height, bytes) of uint8.
pub struct Target {
    image: shutterbug_image,
    _held: Held,
}

// SAFETY: the pointer is to memory that `_held` keeps where it is; who may write to it is Python's affair, as of any
// array.
unsafe impl Send for Target {}
// SAFETY: as above.
unsafe impl Sync for Target {}

impl Target {
    /// Takes the array for a format of `shutterbug_image`.
    pub fn of(array: &Bound<'_, PyAny>, format: u32) -> PyResult<Self> {
        match format {
            RGB8 | RGBA8 => Self::filled(array, format, Some(format as usize + 2), Held::U8),
            RGB16 | RGBA16 => Self::filled(array, format, Some((format - RGB16) as usize + 3), Held::U16),
            RGBA32F => Self::filled(array, format, Some(4), Held::F32),
            BAYER10..=BAYER16 => Self::filled(array, format, None, Held::U16),
            MIPI_RAW10..=MIPI_RAW14 => {
                let mut target = Self::filled(array, format, None, Held::U8)?;
                let bits = 10 + 2 * (format - MIPI_RAW10);
                target.image.width = target.image.width * 8 / bits;
                Ok(target)
            }
            other => Err(PyValueError::new_err(format!("{other} is no format that a plane is read in"))),
        }
    }

    fn filled<T: Element>(
        array: &Bound<'_, PyAny>,
        format: u32,
        channels: Option<usize>,
        held: impl FnOnce(PyBuffer<T>) -> Held,
    ) -> PyResult<Self> {
        let expected = || {
            PyTypeError::new_err(format!("an array of another type or shape is expected for format {format}"))
        };
        let buffer = PyBuffer::<T>::get(array).map_err(|_| expected())?;
        if buffer.readonly() {
            return Err(PyValueError::new_err("the array to write to is read-only"));
        }
        match (buffer.shape(), channels) {
            ([_, _, found], Some(wanted)) if *found == wanted => {}
            ([_, _], None) => {}
            _ => return Err(expected()),
        }
        Ok(Self { image: layout(&buffer, format)?, _held: held(buffer) })
    }

    /// The picture as the C ABI has it.
    pub fn image(&self) -> *const shutterbug_image {
        &raw const self.image
    }
}
