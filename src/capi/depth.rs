//! Finds depth images that the host cannot have meant.

use crate::engine::OutsidePixels;

/// One of this many pixels is checked.
const STEP: usize = 67;

/// What is odd about a picture of depth; `decode`: as of [`crate::engine::OutsideMotion`].
pub(super) fn complaint(
    bytes: &[u8],
    pixels: &OutsidePixels<'_>,
    [width, height]: [u32; 2],
    decode: Option<[f32; 3]>,
) -> Option<String> {
    let (mut seen, mut nan, mut behind, mut beyond) = (0, 0, 0, 0);
    for i in (0..width as usize * height as usize).step_by(STEP) {
        let at = (i / width as usize) * pixels.stride_bytes + (i % width as usize) * 4;
        let value = f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]]);
        seen += 1;
        nan += usize::from(value.is_nan());
        match decode {
            None => behind += usize::from(value < 0.0),
            // Beyond infinitely far: behind the camera.
            Some([_, constant, slope]) => beyond += usize::from(constant + slope * value < -1e-6),
        }
    }
    let share = |count: usize| 100 * count / seen;
    match (nan, behind, beyond) {
        (0, 0, 0) => None,
        (0, 0, n) => {
            Some(format!("depth: {} % of the pixels are beyond infinity by the convention given", share(n)))
        }
        (0, n, _) => Some(format!(
            "depth: {} % of the pixels are below 0, behind the camera: taken as infinitely far",
            share(n)
        )),
        (n, ..) => {
            Some(format!("depth: {} % of the pixels are no number: taken as infinitely far", share(n)))
        }
    }
}
