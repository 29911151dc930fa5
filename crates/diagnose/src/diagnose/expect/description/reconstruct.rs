//! Simultaneous iterative reconstruction: what a field over the corners of cells must be so that places in the cells
//! show what they do. Each corner moves by the weighed mean of what is left around it, which needs no matrix.

use rayon::prelude::*;

use super::grid::{Grid, weights};

/// Places that say something of a field over corners, by colour: which corners each is between, and how much it counts.
pub(crate) struct Places {
    between: Vec<([u32; 8], [f32; 8])>,
    weights: Vec<[f32; 3]>,
    around: Around,
    /// By corner: the sum of the weights around it.
    total: Vec<[f32; 3]>,
}

/// By corner: the places around it, in their order, and its part in each.
struct Around {
    /// Where the places of each corner begin, and the end of the last.
    from: Vec<usize>,
    places: Vec<(u32, f32)>,
}

impl Around {
    fn new(corners: usize, between: &[([u32; 8], [f32; 8])]) -> Self {
        let mut from = vec![0; corners + 1];
        between.iter().flat_map(|(of, _)| of).for_each(|corner| from[*corner as usize + 1] += 1);
        (0..corners).for_each(|i| from[i + 1] += from[i]);
        let (mut next, mut places) = (from.clone(), vec![(0, 0.0); 8 * between.len()]);
        for (place, (of, parts)) in between.iter().enumerate() {
            for (corner, part) in of.iter().zip(parts) {
                let to = &mut next[*corner as usize];
                places[*to] = (place as u32, *part);
                *to += 1;
            }
        }
        Self { from, places }
    }

    /// By corner, of all corners at once.
    fn each<T: Send>(&self, sum: impl Fn(&[(u32, f32)]) -> T + Sync) -> Vec<T> {
        self.from.par_windows(2).with_min_len(256).map(|w| sum(&self.places[w[0]..w[1]])).collect()
    }
}

impl Places {
    /// Of cells, places within them and weights, as many as there are places.
    pub(crate) fn new(grid: &Grid, places: impl Iterator<Item = (u32, [f32; 3], [f32; 3])>) -> Self {
        let of = |(cell, local, weight): (u32, _, _)| ((grid.of_cell[cell as usize], weights(local)), weight);
        let (between, weights): (Vec<_>, Vec<[f32; 3]>) = places.map(of).unzip();
        let around = Around::new(grid.count(), &between);
        let total = around.each(|places| {
            let mut sum = [0.0f32; 3];
            for (place, part) in places {
                (0..3).for_each(|c| sum[c] += part * weights[*place as usize][c]);
            }
            sum
        });
        Self { between, weights, around, total }
    }

    /// By corner: how many places are around it.
    pub(crate) fn seen(&self) -> Vec<f32> {
        self.around.each(|places| places.iter().map(|(_, part)| part).sum())
    }

    /// The field that explains what places show, in so many passes; `left` becomes what it leaves of that.
    pub(crate) fn reconstructed(&self, left: &mut [[f32; 3]], passes: usize) -> Vec<[f32; 3]> {
        let mut field = vec![[0.0f32; 3]; self.total.len()];
        for _ in 0..passes {
            let step = self.means(left);
            left.par_iter_mut().zip(&self.between).with_min_len(1024).for_each(|(left, place)| {
                let by = at(&step, place);
                (0..3).for_each(|c| left[c] -= by[c]);
            });
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
        let mut sums = self.around.each(|places| {
            let mut sum = [0.0f32; 3];
            for (place, part) in places {
                let (weight, left) = (&self.weights[*place as usize], &left[*place as usize]);
                (0..3).for_each(|c| sum[c] += part * weight[c] * left[c]);
            }
            sum
        });
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
