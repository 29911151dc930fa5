//! Closed forms from which the fit begins: the homography of each view, a pinhole that agrees with all of them (Zhang,
//! IEEE PAMI 22, 2000), and the pose that each then has.

use glam::{DMat3, DQuat, DVec2, DVec3};
use nalgebra::{Matrix3, SMatrix, SymmetricEigen};

use shutterbug::camera::{Intrinsics, Pose};

/// Smallest determinant of a homography of normalised points: of a board seen at one degree it is a thousand times
/// larger.
const LEAST_DETERMINANT: f64 = 1e-7;

/// The homography that takes points of the plane to points of the picture, by least squares on normalised points
/// (Hartley, IEEE PAMI 19, 1997); `None` for fewer than four points, or where all lie on a line.
pub(super) fn homography(from: &[DVec2], to: &[DVec2]) -> Option<DMat3> {
    if from.len() < 4 || from.len() != to.len() {
        return None;
    }
    let (a, b) = (normalising(from)?, normalising(to)?);
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for (p, q) in from.iter().zip(to) {
        let (p, q) = (a * p.extend(1.0), b * q.extend(1.0));
        let rows = [
            [p.x, p.y, 1.0, 0.0, 0.0, 0.0, -q.x * p.x, -q.x * p.y, -q.x],
            [0.0, 0.0, 0.0, p.x, p.y, 1.0, -q.y * p.x, -q.y * p.y, -q.y],
        ];
        for row in rows {
            let row = SMatrix::<f64, 9, 1>::from_row_slice(&row);
            normal += row * row.transpose();
        }
    }
    let eigen = SymmetricEigen::try_new(normal, 1e-15, 1000)?;
    let mut order: Vec<usize> = (0..9).collect();
    order.sort_by(|i, j| eigen.eigenvalues[*i].total_cmp(&eigen.eigenvalues[*j]));
    // A second solution: the points lie on a line.
    if eigen.eigenvalues[order[1]] <= 1e-9 * eigen.eigenvalues[order[8]] {
        return None;
    }
    let h = eigen.eigenvectors.column(order[0]);
    let h = DMat3::from_cols(
        DVec3::new(h[0], h[3], h[6]),
        DVec3::new(h[1], h[4], h[7]),
        DVec3::new(h[2], h[5], h[8]),
    );
    // Its nine numbers have length 1. Points that lie on a line in the picture alone are met by a mapping onto that
    // line.
    if h.determinant().abs() < LEAST_DETERMINANT {
        return None;
    }
    let h = b.inverse() * h * a;
    h.is_finite().then_some(h)
}

/// Moves the mean to the origin and the mean distance to sqrt 2.
fn normalising(points: &[DVec2]) -> Option<DMat3> {
    let n = points.len() as f64;
    let mean = points.iter().sum::<DVec2>() / n;
    let spread = points.iter().map(|p| (*p - mean).length()).sum::<f64>() / n;
    if !(spread > 0.0) {
        return None;
    }
    let s = 2f64.sqrt() / spread;
    Some(DMat3::from_cols(DVec3::X * s, DVec3::Y * s, DVec3::new(-s * mean.x, -s * mean.y, 1.0)))
}

/// Focal lengths that make the axes of every board orthogonal and equally long, with the principal point in the
/// picture's middle. `None` where no view is tilted enough to tell.
pub(super) fn focal_lengths(homographies: &[DMat3], size: [u32; 2]) -> Option<[f64; 2]> {
    let centre = DVec2::new(f64::from(size[0]), f64::from(size[1])) * 0.5;
    let to_centre = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::new(-centre.x, -centre.y, 1.0));
    // Two unknowns, 1 / fx^2 and 1 / fy^2, by least squares.
    let (mut a, mut b) = ([[0.0; 2]; 2], [0.0; 2]);
    let mut add = |row: [f64; 2], right: f64| {
        for i in 0..2 {
            (0..2).for_each(|j| a[i][j] += row[i] * row[j]);
            b[i] += row[i] * right;
        }
    };
    for h in homographies {
        let h = to_centre * *h;
        // Right angles of the axes and of their diagonals: the axes are equally long, as they stand.
        let (u, v) = (h.x_axis.normalize(), h.y_axis.normalize());
        let (sum, difference) = ((h.x_axis + h.y_axis).normalize(), (h.x_axis - h.y_axis).normalize());
        add([u.x * v.x, u.y * v.y], -u.z * v.z);
        add([sum.x * difference.x, sum.y * difference.y], -sum.z * difference.z);
    }
    let determinant = a[0][0] * a[1][1] - a[0][1] * a[1][0];
    let x = (b[0] * a[1][1] - b[1] * a[0][1]) / determinant;
    let y = (b[1] * a[0][0] - b[0] * a[1][0]) / determinant;
    (x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()).then(|| [x.sqrt().recip(), y.sqrt().recip()])
}

/// The board's pose in front of a pinhole, from its homography: camera from board.
pub(super) fn pose(h: &DMat3, k: &Intrinsics) -> Option<Pose> {
    let ray = |v: DVec3| DVec3::new((v.x - k.cx * v.z) / k.fx, (v.y - k.cy * v.z) / k.fy, v.z);
    let (x, y, t) = (ray(h.x_axis), ray(h.y_axis), ray(h.z_axis));
    let scale = 2.0 / (x.length() + y.length());
    // The board lies in front of the camera.
    let scale = if t.z < 0.0 { -scale } else { scale };
    let (x, y, t) = (x * scale, y * scale, t * scale);
    let z = x.cross(y);
    let m = Matrix3::new(x.x, y.x, z.x, x.y, y.y, z.y, x.z, y.z, z.z);
    let svd = m.svd(true, true);
    let r = svd.u? * svd.v_t?;
    let column = |i: usize| DVec3::new(r[(0, i)], r[(1, i)], r[(2, i)]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let found = Pose { rotation: DQuat::from_mat3(&rotation).normalize(), translation_m: t };
    (rotation.determinant() > 0.0 && t.is_finite() && t.z > 0.0).then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    const K: Intrinsics = Intrinsics { width: 640, height: 480, fx: 500.0, fy: 510.0, cx: 320.0, cy: 240.0 };

    fn board() -> Vec<DVec2> {
        (0..54).map(|i| DVec2::new(0.03 * f64::from(i % 9), 0.03 * f64::from(i / 9))).collect()
    }

    fn poses() -> Vec<Pose> {
        let tilts = [(0.3, 0.2, 0.0), (-0.4, 0.1, 0.5), (0.1, -0.5, -0.2)];
        let pose = |(x, y, z)| Pose {
            rotation: DQuat::from_euler(glam::EulerRot::XYZ, x, y, z),
            translation_m: DVec3::new(-0.1, -0.05, 0.5),
        };
        tilts.map(pose).to_vec()
    }

    fn seen(pose: &Pose) -> Vec<DVec2> {
        board().iter().map(|p| K.project(pose.transform(p.extend(0.0))).expect("in front")).collect()
    }

    #[test]
    fn the_closed_forms_give_the_camera_and_the_poses_back() {
        let truth = poses();
        let all: Vec<DMat3> =
            truth.iter().map(|p| homography(&board(), &seen(p)).expect("a plane")).collect();
        let [fx, fy] = focal_lengths(&all, [640, 480]).expect("tilted");
        assert!((fx - 500.0).abs() < 1e-6 && (fy - 510.0).abs() < 1e-6, "{fx} {fy}");
        for (h, truth) in all.iter().zip(&truth) {
            let found = pose(h, &K).expect("in front");
            assert!(found.rotation.angle_between(truth.rotation) < 1e-7);
            assert!((found.translation_m - truth.translation_m).length() < 1e-8);
        }
        // Control: another camera sees other poses.
        let other = pose(&all[0], &Intrinsics { fx: 600.0, ..K }).expect("in front");
        assert!(other.rotation.angle_between(truth[0].rotation) > 1e-2);
    }

    #[test]
    fn points_on_a_line_have_no_homography() {
        let line: Vec<DVec2> = (0..9).map(|i| DVec2::new(f64::from(i), 2.0 * f64::from(i))).collect();
        assert!(homography(&line, &line).is_none());
        assert!(homography(&board()[..3], &board()[..3]).is_none());
        assert!(homography(&board(), &board()).is_some(), "control");
    }
}
