//! The print as rectangles: columns and rows of cells, dark, bright or nothing. Cells share their corners, so that no
//! gap opens between them, and their edges are exact where a texture's would be blurred.

use std::fmt::Write as _;

use super::target::Target;

/// What is printed in a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ink {
    Dark,
    Bright,
}

/// A print.
#[derive(Clone, Debug)]
pub(super) struct Sheet {
    /// Borders of the columns and rows of cells, m.
    pub x_m: Vec<f64>,
    pub y_m: Vec<f64>,
    /// Row by row.
    pub cells: Vec<Ink>,
}

impl Sheet {
    /// A checkerboard, with so much of the squares around its inner corners as `reach` says: left, right, above, below,
    /// in squares.
    pub(super) fn checkerboard(target: &Target, even_is_dark: bool, reach: [f64; 4]) -> Self {
        let borders = |axis: usize| {
            let [before, behind] = [reach[2 * axis], reach[2 * axis + 1]];
            let inner = (0..target.size[axis]).map(|i| target.at_m(axis, i));
            let side_m = target.square_m[axis];
            let last_m = target.at_m(axis, target.size[axis] - 1);
            let first = (before > 0.0).then_some(-before * side_m);
            let last = (behind > 0.0).then_some(last_m + behind * side_m);
            let first_cell = if before > 0.0 { 1 } else { 0 };
            (first.into_iter().chain(inner).chain(last).collect::<Vec<f64>>(), first_cell)
        };
        let ((x_m, left), (y_m, above)) = (borders(0), borders(1));
        let (columns, rows) = (x_m.len() - 1, y_m.len() - 1);
        let ink = |i: usize, j: usize| {
            // The first square between inner corners is number 0 along both.
            let even = (i + left + j + above).is_multiple_of(2);
            if even == even_is_dark { Ink::Dark } else { Ink::Bright }
        };
        let cells =
            (0..rows).flat_map(|j| (0..columns).map(move |i| (i, j))).map(|(i, j)| ink(i, j)).collect();
        Self { x_m, y_m, cells }
    }

    /// Seen straight on, of a size in px: where its origin lies, px, and px a metre along x and y.
    #[cfg(test)]
    pub(super) fn picture(
        &self,
        size: [usize; 2],
        origin: glam::DVec2,
        px_per_m: glam::DVec2,
    ) -> shutterbug::plane::Plane<u8> {
        let cell = |borders: &[f64], m: f64| {
            let k = borders.partition_point(|b| *b <= m);
            (k > 0 && k < borders.len()).then(|| k - 1)
        };
        shutterbug::plane::Plane::from_fn(size[0], size[1], |x, y| {
            let at_m = (glam::DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - origin) / px_per_m;
            match (cell(&self.x_m, at_m.x), cell(&self.y_m, at_m.y)) {
                (Some(i), Some(j)) if self.cells[j * (self.x_m.len() - 1) + i] == Ink::Dark => [25],
                (Some(_), Some(_)) => [230],
                _ => [130],
            }
        })
    }

    /// As the text of an OBJ file with the materials `dark` and `bright`.
    pub(super) fn to_obj(&self) -> String {
        let mut text =
            String::from("# The board: its plane is z = 0, x along its columns, y along its rows, metres.\n");
        text += "mtllib scene.mtl\n";
        for y in &self.y_m {
            for x in &self.x_m {
                let _ = writeln!(text, "v {x:.9} {y:.9} 0");
            }
        }
        let across = self.x_m.len();
        for (name, ink) in [("dark", Ink::Dark), ("bright", Ink::Bright)] {
            let _ = writeln!(text, "usemtl {name}");
            for (n, _) in self.cells.iter().enumerate().filter(|(_, c)| **c == ink) {
                let (i, j) = (n % (across - 1), n / (across - 1));
                let at = |i: usize, j: usize| j * across + i + 1;
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let _ = writeln!(text, "f {a} {b} {c} {d}");
            }
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_checkerboard_keeps_its_colours_whatever_of_its_border_is_there() {
        let target = Target::checkerboard([3, 3], [0.1; 2]);
        let whole = Sheet::checkerboard(&target, true, [1.0, 1.0, 1.0, 1.0]);
        assert_eq!((whole.x_m.len(), whole.cells.len()), (5, 16));
        // The square right of and below the first inner corner.
        assert_eq!(whole.cells[5], Ink::Dark);
        let cut = Sheet::checkerboard(&target, true, [0.0, 0.5, 1.0, 1.0]);
        assert_eq!(cut.cells[3], Ink::Dark, "the same square");
        assert!((cut.x_m[3] - 0.25).abs() < 1e-12);
        // Control: the other print.
        assert_eq!(Sheet::checkerboard(&target, false, [1.0; 4]).cells[5], Ink::Bright);
        let obj = whole.to_obj();
        assert_eq!(obj.matches("\nv ").count(), 25);
        assert_eq!(obj.matches("\nf ").count(), 16);
    }
}
