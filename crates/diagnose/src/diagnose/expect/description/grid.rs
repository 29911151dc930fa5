//! The places of a scene that may be brighter or darker than described: a grid of cells on every surface.
//!
//! A cell belongs to one object, one material and one direction that a surface faces: paint ends where a material does,
//! and light where a surface turns. Within these a factor is linear between the corners of its cells. A pixel at a
//! border sees several, each with its share of the light.

use std::collections::HashMap;

use glam::Vec3;

/// Directions of a surface along each axis, to each side.
const STEPS: f32 = 8.0;
/// What stands for no surface.
pub(crate) const NONE: u32 = u32::MAX;
/// Parts of a pixel at a border.
pub(crate) const PARTS: usize = 8;

/// Corners and cells that have been seen, by number.
#[derive(Default)]
pub(crate) struct Grid {
    /// Side of a cell, m.
    side_m: f32,
    corners: HashMap<(u32, [i32; 3]), u32>,
    cells: HashMap<(u32, [i32; 3]), u32>,
    groups: HashMap<(u32, [i8; 3]), u32>,
    /// What was asked for last: the next pixel sees the same as a rule.
    last_cell: Option<((u32, [i32; 3]), u32)>,
    last_group: Option<((u32, Vec3), u32)>,
    /// By cell: its corners.
    pub of_cell: Vec<[u32; 8]>,
    /// By corner: the group (object, material, direction) that it belongs to.
    pub group: Vec<u32>,
    /// By group: the surface (object and material) that it belongs to.
    pub surface: Vec<u32>,
}

/// What the pixels of one picture see, shape `[height, width]`.
pub(crate) struct Surface {
    /// Cell, or [`NONE`].
    pub cell: Vec<u32>,
    /// Place within it, 0 to 1 along each axis.
    pub local: Vec<[f32; 3]>,
    /// Whether all pixels around it see the same: no edge lies near.
    pub clean: Vec<bool>,
    /// Pixels at a border, and what their parts see.
    pub mixed: Vec<(u32, [Part; PARTS])>,
}

/// What a part of a pixel sees.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    pub cell: u32,
    pub local: [f32; 3],
    /// Its share of the pixel's light, by colour.
    pub share: [f32; 3],
}

impl Surface {
    pub(crate) fn bytes(&self) -> usize {
        17 * self.cell.len() + size_of::<(u32, [Part; PARTS])>() * self.mixed.len()
    }
}

impl Grid {
    pub(crate) fn new(side_m: f32) -> Self {
        Self { side_m, ..Self::default() }
    }

    /// Number of corners.
    pub(crate) fn count(&self) -> usize {
        self.group.len()
    }

    /// A place of one group.
    #[cfg(test)]
    pub(crate) fn place_for_tests(&mut self, at: Vec3) -> (u32, [f32; 3]) {
        self.surface.resize(1, 0);
        self.place(0, at)
    }

    /// The group of a surface that faces a direction, in steps of some seven degrees.
    pub(crate) fn group_of(&mut self, surface: u32, normal: Vec3) -> u32 {
        if let Some((_, group)) = self.last_group.filter(|(key, _)| *key == (surface, normal)) {
            return group;
        }
        let faces = (STEPS * normal.normalize_or_zero()).round();
        let next = self.groups.len() as u32;
        let key = (surface, [faces.x as i8, faces.y as i8, faces.z as i8]);
        let group = *self.groups.entry(key).or_insert(next);
        if group == next {
            self.surface.push(surface);
        }
        self.last_group = Some(((surface, normal), group));
        group
    }

    /// The cell of a place of a group, and the place within it.
    pub(crate) fn place(&mut self, group: u32, at: Vec3) -> (u32, [f32; 3]) {
        let scaled = at / self.side_m;
        let low = scaled.floor();
        let key = low.as_ivec3().to_array();
        let local = (scaled - low).to_array();
        let cell = match self.last_cell.filter(|(last, _)| *last == (group, key)) {
            Some((_, cell)) => cell,
            None => self.cell(group, key),
        };
        self.last_cell = Some(((group, key), cell));
        (cell, local)
    }

    fn cell(&mut self, group: u32, key: [i32; 3]) -> u32 {
        if let Some(&cell) = self.cells.get(&(group, key)) {
            return cell;
        }
        let corners = std::array::from_fn(|i| {
            let corner = [0, 1, 2].map(|a| key[a] + (i >> a & 1) as i32);
            let next = self.group.len() as u32;
            let number = *self.corners.entry((group, corner)).or_insert(next);
            if number == next {
                self.group.push(group);
            }
            number
        });
        let cell = self.of_cell.len() as u32;
        self.of_cell.push(corners);
        self.cells.insert((group, key), cell);
        cell
    }
}

/// Weights of the corners of a cell for a place in it.
pub(crate) fn weights([x, y, z]: [f32; 3]) -> [f32; 8] {
    let mut out = [0.0; 8];
    for (i, weight) in out.iter_mut().enumerate() {
        let part = |bit: usize, v: f32| if i >> bit & 1 == 1 { v } else { 1.0 - v };
        *weight = part(0, x) * part(1, y) * part(2, z);
    }
    out
}
