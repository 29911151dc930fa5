//! Polygons to triangles. Convex ones become a fan from their first corner, as every exporter expects; others go
//! through ear clipping in the plane on which the polygon covers the most area.

use glam::{DVec2, DVec3};

/// Twice the area of the polygon times its unit normal (Newell's sum: right-handed, the mean plane where the corners
/// are not exactly in one).
pub(super) fn newell(points: &[DVec3]) -> DVec3 {
    // Relative to the first corner: far from the origin the products would cancel.
    let origin = points[0];
    let next = points.iter().cycle().skip(1);
    points.iter().zip(next).map(|(a, b)| (*a - origin).cross(*b - origin)).sum()
}

/// What became of a polygon.
#[derive(Debug, PartialEq)]
pub(super) enum Outcome {
    /// Triangles as corner numbers, wound like the polygon. Those without area are left out.
    Triangles(Vec<[usize; 3]>),
    /// No area.
    Degenerate,
    /// It crosses itself in its mean plane: the fan from its first corner, which at least has no holes.
    Crossed(Vec<[usize; 3]>),
}

impl Outcome {
    fn map(self, change: impl FnOnce(Vec<[usize; 3]>) -> Vec<[usize; 3]>) -> Self {
        match self {
            Self::Triangles(triangles) => Self::Triangles(change(triangles)),
            Self::Crossed(triangles) => Self::Crossed(change(triangles)),
            Self::Degenerate => Self::Degenerate,
        }
    }
}

/// Triangulates a polygon of at least three corners.
pub(super) fn triangulate(points: &[DVec3]) -> Outcome {
    let normal = newell(points);
    let extent = points.iter().map(|p| (*p - points[0]).length_squared()).fold(0.0, f64::max);
    // f32 coordinates carry 2^-24 relative error: an area below that of a sliver so thin is rounding, not area. Corners
    // far from the origin are no matter, since f64 differences of f32 values are exact enough.
    if normal.length() <= extent * SLIVER {
        return Outcome::Degenerate;
    }
    if points.len() == 3 {
        return Outcome::Triangles(vec![[0, 1, 2]]);
    }
    let area = |t: &[usize; 3]| doubled_area(points, *t).length();
    let with_area =
        |triangles: Vec<[usize; 3]>| triangles.into_iter().filter(|t| area(t) > extent * SLIVER).collect();
    if points.len() == 4 {
        return quad(points).map(with_area);
    }
    let fan: Vec<[usize; 3]> = (2..points.len()).map(|i| [0, i - 1, i]).collect();
    let flat = project(points, normal);
    if is_convex(&flat, extent * SLIVER) {
        return Outcome::Triangles(with_area(fan));
    }
    match ears(&flat) {
        Some(triangles) => Outcome::Triangles(with_area(triangles)),
        None => Outcome::Crossed(with_area(fan)),
    }
}

/// A quad needs no plane, and exporters bend it: cut along the diagonal from its first corner, as every reader does,
/// unless that turns the halves against each other and the other diagonal does not (a corner that points inward).
fn quad(points: &[DVec3]) -> Outcome {
    let agree = |[a, b]: [[usize; 3]; 2]| doubled_area(points, a).dot(doubled_area(points, b)) >= 0.0;
    let (first, second) = ([[0, 1, 2], [0, 2, 3]], [[0, 1, 3], [1, 2, 3]]);
    match (agree(first), agree(second)) {
        (true, _) => Outcome::Triangles(first.to_vec()),
        (false, true) => Outcome::Triangles(second.to_vec()),
        (false, false) => Outcome::Crossed(first.to_vec()),
    }
}

/// Clips ears; `None` if the triangles do not cover what the outline encloses, which those of a simple outline do
/// exactly.
fn ears(flat: &[DVec2]) -> Option<Vec<[usize; 3]>> {
    let coordinates: Vec<f64> = flat.iter().flat_map(|p| p.to_array()).collect();
    let clipped = earcutr::earcut(&coordinates, &[], 2).ok()?;
    let wound = clipped.chunks_exact(3).map(|t| {
        let t = [t[0], t[1], t[2]];
        if cross(flat, t) < 0.0 { [t[0], t[2], t[1]] } else { t }
    });
    let triangles: Vec<[usize; 3]> = wound.collect();
    let total: f64 = (2..flat.len()).map(|i| cross(flat, [0, i - 1, i])).sum();
    let covered: f64 = triangles.iter().map(|t| cross(flat, *t)).sum();
    ((covered - total).abs() <= 1e-6 * total).then_some(triangles)
}

fn doubled_area(points: &[DVec3], [a, b, c]: [usize; 3]) -> DVec3 {
    (points[b] - points[a]).cross(points[c] - points[a])
}

/// Twice the area over the squared extent below which a face counts as degenerate.
const SLIVER: f64 = 1e-12;

/// Drops the coordinate along which the normal is longest, keeping the winding counter-clockwise.
fn project(points: &[DVec3], normal: DVec3) -> Vec<DVec2> {
    let axis = normal.abs().max_position();
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let origin = points[0];
    let flat = points.iter().map(|p| *p - origin);
    if normal[axis] > 0.0 {
        flat.map(|p| DVec2::new(p[u], p[v])).collect()
    } else {
        flat.map(|p| DVec2::new(p[v], p[u])).collect()
    }
}

fn cross(flat: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    (flat[b] - flat[a]).perp_dot(flat[c] - flat[a])
}

/// No corner turns inward and no triangle of the fan is turned over (which a star that winds twice would show).
fn is_convex(flat: &[DVec2], tolerance: f64) -> bool {
    let n = flat.len();
    let corners = (0..n).map(|i| [i, (i + 1) % n, (i + 2) % n]);
    let fan = (2..n).map(|i| [0, i - 1, i]);
    corners.chain(fan).all(|t| cross(flat, t) >= -tolerance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn area(points: &[DVec3], triangles: &[[usize; 3]]) -> f64 {
        let each = |t: &[usize; 3]| (points[t[1]] - points[t[0]]).cross(points[t[2]] - points[t[0]]);
        let normal = newell(points).normalize();
        triangles.iter().map(|t| each(t).dot(normal) / 2.0).sum()
    }

    /// An L of area 3 in any plane.
    fn l_shape(u: DVec3, v: DVec3) -> Vec<DVec3> {
        [(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
            .map(|(a, b)| u * a + v * b)
            .to_vec()
    }

    #[test]
    fn a_concave_polygon_keeps_area_and_winding_in_every_plane_and_from_every_corner() {
        for (u, v) in [(DVec3::X, DVec3::Y), (DVec3::Y, DVec3::X), (DVec3::Y, DVec3::Z), (DVec3::Z, DVec3::X)]
        {
            for start in 0..6 {
                let mut points = l_shape(u, v);
                points.rotate_left(start);
                let Outcome::Triangles(triangles) = triangulate(&points) else { panic!("{u} {v} {start}") };
                assert_eq!(triangles.len(), 4);
                assert!((area(&points, &triangles) - 3.0).abs() < 1e-12);
                // Signed areas alone would let a fan pass: none may be turned over.
                assert!(triangles.iter().all(|t| area(&points, &[*t]) > 0.0));
            }
        }
        let points = l_shape(DVec3::X, DVec3::Y);
        let rotated: Vec<DVec3> = (0..6).map(|i| points[(i + 1) % 6]).collect();
        let fan: Vec<[usize; 3]> = (2..6).map(|i| [0, i - 1, i]).collect();
        assert!(fan.iter().any(|t| area(&rotated, &[*t]) <= 0.0), "control: a fan turns one over");
    }

    #[test]
    fn a_convex_polygon_is_a_fan() {
        let quad = [DVec3::ZERO, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        assert_eq!(triangulate(&quad), Outcome::Triangles(vec![[0, 1, 2], [0, 2, 3]]));
        // Further corners on an edge leave the empty triangles out and keep the area.
        let edge = [DVec3::ZERO, DVec3::X * 0.5, DVec3::X, DVec3::new(1.0, 1.0, 0.0), DVec3::Y];
        let Outcome::Triangles(triangles) = triangulate(&edge) else { panic!() };
        assert_eq!(area(&edge, &triangles), 1.0);
    }

    #[test]
    fn quads_may_be_concave_or_bent() {
        let dart = |i: usize| [DVec3::ZERO, DVec3::X * 4.0, DVec3::new(1.0, 1.0, 0.0), DVec3::Y * 4.0][i % 4];
        for start in 0..4 {
            let points = [0, 1, 2, 3].map(|i| dart(i + start));
            let Outcome::Triangles(triangles) = triangulate(&points) else { panic!("{start}") };
            assert!((area(&points, &triangles) - 4.0).abs() < 1e-12 && triangles.len() == 2, "{start}");
            assert!(triangles.iter().all(|t| area(&points, &[*t]) > 0.0), "{start}");
        }
        // One half stands upright, so that it has no area seen along the mean normal's main axis; it must not be lost.
        let step =
            [DVec3::ZERO, DVec3::new(0.0, 0.0, 0.5), DVec3::new(0.01, 1.0, 0.5), DVec3::new(0.01, 1.0, 0.4)];
        assert_eq!(triangulate(&step), Outcome::Triangles(vec![[0, 1, 2], [0, 2, 3]]));
    }

    #[test]
    fn no_area_and_crossing_are_told() {
        assert_eq!(triangulate(&[DVec3::ZERO, DVec3::X, DVec3::X * 3.0]), Outcome::Degenerate);
        assert_eq!(triangulate(&[DVec3::ONE; 5]), Outcome::Degenerate);
        let star = |i: usize| {
            DVec3::new(
                (i as f64 * 0.8 * std::f64::consts::PI).cos(),
                (i as f64 * 0.8 * std::f64::consts::PI).sin(),
                0.0,
            )
        };
        assert!(matches!(triangulate(&[0, 1, 2, 3, 4].map(star)), Outcome::Crossed(_)));
        let tie = [DVec3::ZERO, DVec3::X * 2.0, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];
        assert!(matches!(triangulate(&tie), Outcome::Crossed(_)));
        let far = [DVec3::X * 8e3, DVec3::new(8e3, 1e-3, 0.0), DVec3::new(8e3, 0.0, 1e-3)];
        assert_eq!(triangulate(&far), Outcome::Triangles(vec![[0, 1, 2]]));
    }
}
