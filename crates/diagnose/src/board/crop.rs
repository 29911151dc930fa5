//! The part of a picture that a lens of five coefficients can describe. Through a very wide lens the fitted polynomial
//! turns back before the picture's corners: no ray reaches them, and a camera with that lens cannot be simulated. The
//! corners are left out then.

use shutterbug::camera::{Distortion, Intrinsics, Lens};

/// Sides of what is cut are multiples of this, px: blocks of JPEG stay where they were, also with halved colours.
const BLOCK_PX: u32 = 16;

/// Columns and rows that are cut on each side so that the lens is one-to-one on what is left, and on a block more: a
/// fit needs room. Nothing where it is on the whole picture, or on no part of it that is worth having.
pub(super) fn cut(k: &Intrinsics, lens: Distortion) -> [u32; 2] {
    let holds = |cut: [u32; 2]| Lens::new(cropped(k, cut), lens).is_ok();
    if holds([0; 2]) {
        return [0; 2];
    }
    let steps = k.width.max(k.height) / (4 * BLOCK_PX);
    let at = |step: u32| {
        // As much of each side as it is long.
        let of = |side: u32| (step * side / k.width.max(k.height)).max(1) * BLOCK_PX;
        [of(k.width), of(k.height)]
    };
    (1..=steps).find(|s| holds(at(*s))).map_or([0; 2], |s| at(s + 1))
}

/// The camera of what is left.
pub(super) fn cropped(k: &Intrinsics, [across, down]: [u32; 2]) -> Intrinsics {
    Intrinsics {
        width: k.width - 2 * across,
        height: k.height - 2 * down,
        cx: k.cx - f64::from(across),
        cy: k.cy - f64::from(down),
        ..*k
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn corners_that_no_ray_reaches_are_cut_and_no_others() {
        let k = Intrinsics { width: 1280, height: 960, fx: 560.0, fy: 561.0, cx: 652.0, cy: 500.0 };
        // An action camera's, as OpenCV fits it.
        let wide = Distortion::BrownConrady { k: [-0.2315, 0.0606, -0.0073], p: [0.0; 2] };
        assert!(Lens::new(k, wide).is_err(), "control: the whole picture is too much");
        let cut_px = cut(&k, wide);
        let left = cropped(&k, cut_px);
        assert!(Lens::new(left, wide).is_ok());
        assert!(cut_px.iter().all(|c| *c > 0 && c % 16 == 0), "{cut_px:?}");
        assert!(left.width > 800, "no more than is needed: {left:?}");
        let mild = Distortion::BrownConrady { k: [-0.1, 0.01, 0.0], p: [0.0; 2] };
        assert_eq!(cut(&k, mild), [0; 2]);
    }
}
