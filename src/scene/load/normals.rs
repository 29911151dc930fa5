//! Normals of faces that bring none.

use std::collections::HashMap;

use glam::DVec3;

use super::obj::{Face, Geometry};
use super::triangulate::newell;

/// Area-weighted normals at the corners of smoothing groups.
pub(super) struct Smooth {
    /// Sum over the faces around a position, by smoothing group and index of the position.
    sums: HashMap<(u32, u32), DVec3>,
}

impl Smooth {
    /// Sums up the faces that are in a group (`s`) and bring no normals.
    pub(super) fn new(geometry: &Geometry) -> Self {
        let mut sums = HashMap::new();
        let mut first = 0;
        for face in &geometry.faces {
            let corners = first..first + face.corners;
            first = corners.end;
            if face.smoothing != 0 && !face.has_normals {
                let weighted = newell(&positions(geometry, corners.clone()));
                for position in &geometry.mesh.indices[corners] {
                    *sums.entry((face.smoothing, *position)).or_insert(DVec3::ZERO) += weighted;
                }
            }
        }
        Self { sums }
    }

    /// Normal of a corner of `face` whose position has this index; `flat` where the face is in no group or its
    /// neighbours cancel.
    pub(super) fn at(&self, face: &Face, position: u32, flat: [f32; 3]) -> [f32; 3] {
        let sum = self.sums.get(&(face.smoothing, position)).filter(|_| face.smoothing != 0);
        sum.and_then(|s| s.try_normalize()).map_or(flat, |n| n.as_vec3().to_array())
    }
}

/// Positions of some corners, m.
pub(super) fn positions(geometry: &Geometry, corners: std::ops::Range<usize>) -> Vec<DVec3> {
    let position = |index: &u32| {
        let at = 3 * *index as usize;
        let p = &geometry.mesh.positions[at..at + 3];
        DVec3::new(p[0].into(), p[1].into(), p[2].into())
    };
    geometry.mesh.indices[corners].iter().map(position).collect()
}
