//! Simultaneous iterative reconstruction: what a field over the corners of cells must be so that places in the cells
//! show what they do. Each corner moves by the weighed mean of what is left around it, which needs no matrix.

use super::grid::{Grid, weights};

/// Places that say something of a field over corners, by colour: which corners each is between, and how much it counts.
pub(crate) struct Places {
    between: Vec<([u32; 8], [f32; 8])>,
    weights: Vec<[f32; 3]>,
    /// By corner: the sum of the weights around it.
    total: Vec<[f32; 3]>,
}

impl Places {
    /// Of cells, places within them and weights, as many as there are places.
    pub(crate) fn new(grid: &Grid, places: impl Iterator<Item = (u32, [f32; 3], [f32; 3])>) -> Self {
        let mut new = Self { between: Vec::new(), weights: Vec::new(), total: vec![[0.0; 3]; grid.count()] };
        for (cell, local, weight) in places {
            let (corners, parts) = (grid.of_cell[cell as usize], weights(local));
            for (corner, part) in corners.iter().zip(parts) {
                (0..3).for_each(|c| new.total[*corner as usize][c] += part * weight[c]);
            }
            new.between.push((corners, parts));
            new.weights.push(weight);
        }
        new
    }

    /// By corner: how many places are around it.
    pub(crate) fn seen(&self) -> Vec<f32> {
        let mut seen = vec![0.0; self.total.len()];
        for (corners, parts) in &self.between {
            corners.iter().zip(parts).for_each(|(corner, part)| seen[*corner as usize] += part);
        }
        seen
    }

    /// The field that explains what places show, in so many passes; `left` becomes what it leaves of that.
    pub(crate) fn reconstructed(&self, left: &mut [[f32; 3]], passes: usize) -> Vec<[f32; 3]> {
        let mut field = vec![[0.0f32; 3]; self.total.len()];
        for _ in 0..passes {
            let step = self.means(left);
            for (left, place) in left.iter_mut().zip(&self.between) {
                let by = at(&step, place);
                (0..3).for_each(|c| left[c] -= by[c]);
            }
            field.iter_mut().zip(&step).for_each(|(a, b)| (0..3).for_each(|c| a[c] += b[c]));
        }
        field
    }

    /// What a field is at each place.
    pub(crate) fn of<'a>(&'a self, field: &'a [[f32; 3]]) -> impl Iterator<Item = [f32; 3]> + 'a {
        self.between.iter().map(|place| at(field, place))
    }

    /// Weighed means of what is left around each corner.
    fn means(&self, left: &[[f32; 3]]) -> Vec<[f32; 3]> {
        let mut sums = vec![[0.0f32; 3]; self.total.len()];
        for (((corners, parts), weight), left) in self.between.iter().zip(&self.weights).zip(left) {
            for (corner, part) in corners.iter().zip(parts) {
                (0..3).for_each(|c| sums[*corner as usize][c] += part * weight[c] * left[c]);
            }
        }
        for (sum, total) in sums.iter_mut().zip(&self.total) {
            (0..3).for_each(|c| sum[c] /= total[c].max(1e-6));
        }
        sums
    }
}

/// What a field over corners is at a place between some of them.
fn at(field: &[[f32; 3]], (corners, parts): &([u32; 8], [f32; 8])) -> [f32; 3] {
    let mut sum = [0.0f32; 3];
    for (&corner, part) in corners.iter().zip(parts) {
        let Some(value) = field.get(corner as usize) else { continue };
        (0..3).for_each(|c| sum[c] += part * value[c]);
    }
    sum
}

/// What a field over corners is at a place of a cell.
pub(crate) fn mixed(grid: &Grid, field: &[[f32; 3]], cell: u32, local: [f32; 3]) -> [f32; 3] {
    at(field, &(grid.of_cell[cell as usize], weights(local)))
}
