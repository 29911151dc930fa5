//! Where a corner is to a fraction of a pixel: the point that the gradients around it are at right angles to (Foerstner
//! and Guelch 1987, as in OpenCV's cornerSubPix).

use glam::{DMat2, DVec2};

use shutterbug::plane::Plane;

/// Widest window, px to each side: OpenCV's usual one. Over more, edges through a lens are no straight lines any more.
const WIDEST_PX: f64 = 5.0;
/// Narrowest: less holds no gradients.
const NARROWEST_PX: f64 = 2.0;
/// Share of the way to the nearest other point that a window may take: beyond half of a square lies another edge.
const SHARE: f64 = 0.25;
/// Most steps; px below which a step ends them.
const MOST_STEPS: usize = 30;
const CLOSE_PX: f64 = 1e-3;

/// The refined place of a corner near `px` whose nearest neighbour is `free_px` away, found in a picture that was
/// `shrunk` so many times; `None` where the window leaves the picture, is flat, or the corner is elsewhere.
pub(super) fn refined(grey: &Plane<u8>, px: DVec2, free_px: f64, shrunk: usize) -> Option<DVec2> {
    let half = (SHARE * free_px).min(WIDEST_PX * shrunk as f64).max(NARROWEST_PX).ceil();
    let mut at = px;
    for _ in 0..MOST_STEPS {
        let next = crossing(grey, at, half)?;
        // Another corner than the one that was found.
        if (next - px).length() > half {
            return None;
        }
        let moved = (next - at).length();
        at = next;
        if moved < CLOSE_PX {
            break;
        }
    }
    Some(at)
}

/// One step: where lines along the edges around `at` meet.
fn crossing(grey: &Plane<u8>, at: DVec2, half: f64) -> Option<DVec2> {
    if !is_inside(grey, at, half + 1.5) {
        return None;
    }
    let (mut a, mut b) = (DMat2::ZERO, DVec2::ZERO);
    let n = half as i32;
    for j in -n..=n {
        for i in -n..=n {
            let offset = DVec2::new(f64::from(i), f64::from(j));
            let p = at + offset;
            let slope = |d: DVec2| 0.5 * (sample(grey, p + d) - sample(grey, p - d));
            let g = DVec2::new(slope(DVec2::X), slope(DVec2::Y));
            let weight = (-offset.length_squared() / (half * half)).exp();
            let gg = DMat2::from_cols(g * g.x, g * g.y) * weight;
            a += gg;
            b += gg * offset;
        }
    }
    // Of one edge alone the place along it is free.
    let (trace, determinant) = (a.x_axis.x + a.y_axis.y, a.determinant());
    (determinant > 1e-4 * trace * trace).then(|| at + a.inverse() * b)
}

/// Whether a place is that far from the borders of the picture, px.
pub(super) fn is_inside(grey: &Plane<u8>, at: DVec2, reach: f64) -> bool {
    let free = DVec2::new(grey.width as f64, grey.height as f64) - reach;
    at.min_element() >= reach && at.cmple(free).all()
}

/// Value at a place of the picture, between the centres of pixels; inside of the picture by at least one pixel.
pub(super) fn sample(grey: &Plane<u8>, px: DVec2) -> f64 {
    let (x, y) = (px.x - 0.5, px.y - 0.5);
    let (x0, y0) = (x.floor(), y.floor());
    let (fx, fy) = (x - x0, y - y0);
    let at = |dx: usize, dy: usize| {
        let x = (x0.max(0.0) as usize + dx).min(grey.width - 1);
        let y = (y0.max(0.0) as usize + dy).min(grey.height - 1);
        f64::from(grey.data[y * grey.width + x])
    };
    (at(0, 0) * (1.0 - fx) + at(1, 0) * fx) * (1.0 - fy) + (at(0, 1) * (1.0 - fx) + at(1, 1) * fx) * fy
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A corner of four squares, turned, as a lens shows it: values are means over squares of 2 px.
    fn corner(centre: DVec2, turn: f64) -> Plane<u8> {
        let (a, b) = (DVec2::from_angle(turn), DVec2::from_angle(turn + 1.4));
        Plane::from_fn(40, 40, |x, y| {
            let point = |i: usize| {
                let part = |k: usize| 2.0 * (k as f64 + 0.5) / 8.0 - 0.5;
                let (sx, sy) = (part(i % 8), part(i / 8));
                let p = DVec2::new(x as f64 + sx, y as f64 + sy) - centre;
                if (a.perp_dot(p) > 0.0) == (b.perp_dot(p) > 0.0) { 30.0 } else { 220.0 }
            };
            [((0..64).map(point).sum::<f64>() / 64.0) as u8]
        })
    }

    #[test]
    fn a_corner_is_found_to_less_than_a_tenth_of_a_pixel() {
        for (centre, turn) in [((20.3, 19.1), 0.2), ((18.77, 21.5), 1.0), ((20.0, 20.0), 2.9)] {
            let centre = DVec2::from(centre);
            let grey = corner(centre, turn);
            let found = refined(&grey, centre + DVec2::new(1.2, -0.9), 20.0, 1).expect("a corner");
            assert!((found - centre).length() < 0.08, "{found} for {centre}");
            // Control: the centre of the nearest pixel is far worse.
            let nearest = centre.floor() + 0.5;
            assert!((nearest - centre).length() > 0.1);
        }
    }

    #[test]
    fn an_edge_and_a_flat_place_have_none() {
        let edge = Plane::from_fn(40, 40, |x, _| [if x < 20 { 20u8 } else { 200 }]);
        assert!(refined(&edge, DVec2::splat(20.0), 20.0, 1).is_none());
        let flat = Plane::from_fn(40, 40, |_, _| [100u8]);
        assert!(refined(&flat, DVec2::splat(20.0), 20.0, 1).is_none());
        assert!(refined(&edge, DVec2::splat(1.0), 20.0, 1).is_none(), "at the border");
    }
}
