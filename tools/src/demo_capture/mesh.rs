//! A mesh of planar quads and its OBJ text.

use std::collections::HashMap;
use std::fmt::Write as _;

use glam::{DAffine3, DVec3};

/// Longest side of a piece of a large face, m: exporters cut large faces, and a motion image taken at the corners
/// is closer to the truth on small ones.
pub const MAX_SIDE_M: f64 = 0.5;

/// One corner: position m, texture coordinate (u right, v up), unit normal.
pub type Corner = (DVec3, [f64; 2], DVec3);

/// Polygons by object and material, with shared `v`, `vt` and `vn` lines.
#[derive(Default)]
pub struct Mesh {
    lines: [Pool; 3],
    faces: String,
    material: &'static str,
    /// Where what is added next stands: applied to every corner. No scaling.
    pub place: DAffine3,
    /// Every face as it was added, for checks.
    pub polygons: Vec<Vec<Corner>>,
}

#[derive(Default)]
struct Pool {
    index: HashMap<String, usize>,
    text: String,
}

impl Pool {
    fn index_of(&mut self, keyword: &str, values: &[f64]) -> usize {
        let mut line = keyword.to_owned();
        for value in values {
            // Adding zero turns -0 into 0, so that equal corners have equal text.
            write!(line, " {:.4}", (value * 1e4).round() / 1e4 + 0.0)
                .expect("writing to a String cannot fail");
        }
        let next = self.index.len() + 1;
        if let Some(&at) = self.index.get(&line) {
            return at;
        }
        self.text.push_str(&line);
        self.text.push('\n');
        self.index.insert(line, next);
        next
    }
}

impl Mesh {
    /// Starts an object (`o`).
    pub fn object(&mut self, name: &str) {
        self.faces += &format!("o {name}\n");
        self.material = "";
    }

    /// Adds one planar face, counter-clockwise seen from the side its normal points to.
    pub fn face(&mut self, material: &'static str, corners: &[Corner]) {
        if self.material != material {
            self.faces += &format!("usemtl {material}\n");
            self.material = material;
        }
        self.faces.push('f');
        let placed = |(p, uv, n): &Corner| -> Corner {
            (self.place.transform_point3(*p), *uv, self.place.transform_vector3(*n))
        };
        let corners: Vec<Corner> = corners.iter().map(placed).collect();
        for (position, uv, normal) in &corners {
            let v = self.lines[0].index_of("v", &position.to_array());
            let vt = self.lines[1].index_of("vt", uv);
            let vn = self.lines[2].index_of("vn", &normal.to_array());
            write!(self.faces, " {v}/{vt}/{vn}").expect("writing to a String cannot fail");
        }
        self.faces.push('\n');
        self.polygons.push(corners);
    }

    /// A rectangle from `origin` along `right` and `up`, m, cut into pieces; it faces `right x up`. Texture
    /// coordinates run over `tiles` along both.
    pub fn rectangle(
        &mut self,
        material: &'static str,
        origin: DVec3,
        right: DVec3,
        up: DVec3,
        tiles: [f64; 2],
    ) {
        self.rectangle_in(MAX_SIDE_M, material, [origin, right, up], tiles);
    }

    /// The same (`[origin, right, up]`) in pieces of at most `piece_m`.
    pub fn rectangle_in(
        &mut self,
        piece_m: f64,
        material: &'static str,
        [origin, right, up]: [DVec3; 3],
        tiles: [f64; 2],
    ) {
        let normal = right.cross(up).normalize();
        let pieces = [right, up].map(|side| (side.length() / piece_m - 1e-9).ceil().max(1.0) as u32);
        let corner = |i: u32, j: u32| {
            let (a, b) = (f64::from(i) / f64::from(pieces[0]), f64::from(j) / f64::from(pieces[1]));
            (origin + a * right + b * up, [a * tiles[0], b * tiles[1]], normal)
        };
        for j in 0..pieces[1] {
            for i in 0..pieces[0] {
                self.face(
                    material,
                    &[corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)],
                );
            }
        }
    }

    /// A box between two corners, m, facing outwards.
    pub fn cuboid(&mut self, material: &'static str, min: DVec3, max: DVec3) {
        let d = max - min;
        let (x, y, z) = (DVec3::X * d.x, DVec3::Y * d.y, DVec3::Z * d.z);
        let mut side = |origin, right, up| self.rectangle(material, origin, right, up, [0.0; 2]);
        side(min, y, x);
        side(min + z, x, y);
        side(min, x, z);
        side(min + y + x, -x, z);
        side(min + y, -y, z);
        side(min + x, y, z);
    }

    /// A round bar from `from` to `to`, m, with smooth normals and without caps.
    pub fn bar(&mut self, material: &'static str, from: DVec3, to: DVec3, radius_m: f64) {
        const SIDES: u32 = 12;
        let axis = (to - from).normalize();
        let (a, b) = axis.any_orthonormal_pair();
        let around = |i: u32| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i % SIDES) / f64::from(SIDES)).sin_cos();
            cos * a + sin * b
        };
        let pieces = ((to - from).length() / MAX_SIDE_M).ceil() as u32;
        for j in 0..pieces {
            let at = |j: u32| from.lerp(to, f64::from(j) / f64::from(pieces));
            for i in 0..SIDES {
                let corner = |i, j| (at(j) + radius_m * around(i), [0.0; 2], around(i));
                self.face(
                    material,
                    &[corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)],
                );
            }
        }
    }

    /// A ball about the origin with smooth normals; `material(sector, ring)` gives each patch its colour.
    pub fn ball(&mut self, radius_m: f64, material: impl Fn(u32, u32) -> &'static str) {
        const SECTORS: u32 = 16;
        const RINGS: u32 = 10;
        let corner = |i: u32, j: u32| {
            let (sin_a, cos_a) =
                (std::f64::consts::TAU * f64::from(i % SECTORS) / f64::from(SECTORS)).sin_cos();
            let (sin_b, cos_b) = (std::f64::consts::PI * f64::from(j) / f64::from(RINGS)).sin_cos();
            let normal = DVec3::new(sin_b * cos_a, sin_b * sin_a, -cos_b);
            (radius_m * normal, [0.0; 2], normal)
        };
        for j in 0..RINGS {
            for i in 0..SECTORS {
                let patch = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                match j {
                    0 => self.face(material(i, j), &[patch[0], patch[2], patch[3]]),
                    _ if j == RINGS - 1 => self.face(material(i, j), &patch[..3]),
                    _ => self.face(material(i, j), &patch),
                }
            }
        }
    }

    /// A plain ball about a point, m, of 36 triangles.
    pub fn ball_at(&mut self, centre_m: DVec3, radius_m: f64, material: &'static str) {
        let before = self.place;
        self.place = before * DAffine3::from_translation(centre_m);
        let profile: Vec<[f64; 2]> = (0..=4)
            .map(|j| {
                let (sin, cos) = (std::f64::consts::PI * f64::from(j) / 4.0).sin_cos();
                [if j % 4 == 0 { 0.0 } else { radius_m * sin }, -radius_m * cos]
            })
            .collect();
        self.lathe(material, &profile, 6);
        self.place = before;
    }

    /// A body of revolution about the z axis with smooth normals: `profile` holds (radius, height) in m from the lowest
    /// point to the highest; a radius of 0 closes an end.
    pub fn lathe(&mut self, material: &'static str, profile: &[[f64; 2]], sides: u32) {
        let slopes: Vec<[f64; 2]> =
            profile.windows(2).map(|p| [p[1][0] - p[0][0], p[1][1] - p[0][1]]).collect();
        // Outward normal of a corner of the profile: that of its neighbours' mean direction.
        let normal_at = |j: usize| -> [f64; 2] {
            let (a, b) = (slopes[j.saturating_sub(1)], slopes[j.min(slopes.len() - 1)]);
            let unit = |s: [f64; 2]| s[0].hypot(s[1]).recip();
            let (ua, ub) = (unit(a), unit(b));
            [a[1] * ua + b[1] * ub, -a[0] * ua - b[0] * ub]
        };
        let corner = |i: u32, j: usize| -> Corner {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i % sides) / f64::from(sides)).sin_cos();
            let ([radius_m, z], [out, up]) = (profile[j], normal_at(j));
            let normal = DVec3::new(out * cos, out * sin, up).normalize_or(DVec3::Z * up.signum());
            (DVec3::new(radius_m * cos, radius_m * sin, z), [0.0; 2], normal)
        };
        for j in 0..profile.len() - 1 {
            for i in 0..sides {
                let patch = [corner(i, j), corner(i + 1, j), corner(i + 1, j + 1), corner(i, j + 1)];
                match (profile[j][0] == 0.0, profile[j + 1][0] == 0.0) {
                    (true, _) => self.face(material, &[patch[0], patch[2], patch[3]]),
                    (_, true) => self.face(material, &patch[..3]),
                    _ => self.face(material, &patch),
                }
            }
        }
    }

    /// Number of triangles when every face is cut into a fan.
    pub fn triangle_count(&self) -> usize {
        self.polygons.iter().map(|p| p.len() - 2).sum()
    }

    /// The OBJ text; `head` stands in front.
    pub fn obj(&self, head: &str) -> String {
        let [v, vt, vn] = &self.lines;
        [head, &v.text, &vt.text, &vn.text, &self.faces].concat()
    }
}
