//! What is printed on a board, and what of it was seen.

use glam::{DVec2, DVec3};

/// A kind of calibration target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Squares; points are the inner corners.
    Checkerboard,
    /// A checkerboard with ArUco markers in its white squares; points are the inner corners.
    Charuco,
    /// Kalibr's AprilGrid: tags with small squares where their corners meet; points are the corners of the tags.
    Aprilgrid,
}

impl Pattern {
    /// Name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Checkerboard => "checkerboard",
            Self::Charuco => "charuco",
            Self::Aprilgrid => "aprilgrid",
        }
    }
}

/// A target: points on a plane, counted along columns (x) and rows (y).
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Its kind.
    pub pattern: Pattern,
    /// Columns and rows of points (checkerboard, charuco: inner corners; aprilgrid: two of each a tag).
    pub size: [usize; 2],
    /// Side of a square along x and y, or of a tag, m.
    pub square_m: [f64; 2],
    /// Aprilgrid: gap between two tags over the side of one.
    pub spacing: f64,
    /// Charuco: side of a marker over that of a square; dictionary, by OpenCV's name.
    pub marker: Option<(f64, String)>,
}

impl Target {
    /// A checkerboard of so many inner corners.
    pub fn checkerboard(size: [usize; 2], square_m: f64) -> Self {
        Self { pattern: Pattern::Checkerboard, size, square_m: [square_m; 2], spacing: 0.0, marker: None }
    }

    /// How many points it has.
    pub fn count(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Place of a column (axis 0) or row (axis 1) of points, m.
    pub fn at_m(&self, axis: usize, index: usize) -> f64 {
        let side_m = self.square_m[axis];
        match self.pattern {
            Pattern::Checkerboard | Pattern::Charuco => index as f64 * side_m,
            Pattern::Aprilgrid => {
                let (tag, far) = (index / 2, index % 2);
                side_m * (tag as f64 * (1.0 + self.spacing) + far as f64)
            }
        }
    }

    /// Place of a point on the board's plane, m.
    pub fn point_m(&self, [column, row]: [usize; 2]) -> DVec3 {
        DVec3::new(self.at_m(0, column), self.at_m(1, row), 0.0)
    }

    /// The name with its size, for messages.
    pub fn describe(&self) -> String {
        let [columns, rows] = self.size;
        match self.pattern {
            Pattern::Aprilgrid => format!("aprilgrid of {}x{} tags", columns / 2, rows / 2),
            pattern => format!("{} of {columns}x{rows} inner corners", pattern.name()),
        }
    }
}

/// A point of the target in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Column and row of the point.
    pub point: [usize; 2],
    /// Where it is, px; the top left pixel's centre is (0.5, 0.5).
    pub px: DVec2,
}

/// What one picture shows of the target.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The picture's place in the list of pictures.
    pub picture: usize,
    /// Its points.
    pub seen: Vec<Seen>,
}

impl View {
    /// Where a point is, if it was seen.
    pub fn px(&self, point: [usize; 2]) -> Option<DVec2> {
        self.seen.iter().find(|s| s.point == point).map(|s| s.px)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_of_an_aprilgrid_lie_at_both_ends_of_each_tag() {
        let target = Target {
            pattern: Pattern::Aprilgrid,
            size: [4, 2],
            square_m: [0.05; 2],
            spacing: 0.3,
            marker: None,
        };
        let x: Vec<f64> = (0..4).map(|i| target.at_m(0, i)).collect();
        for (is, should) in x.iter().zip([0.0, 0.05, 0.065, 0.115]) {
            assert!((is - should).abs() < 1e-12, "{x:?}");
        }
        assert_eq!(target.describe(), "aprilgrid of 2x1 tags");
        // Control: of a checkerboard they are evenly spaced.
        let even = Target::checkerboard([4, 2], 0.05);
        assert!((even.at_m(0, 3) - 0.15).abs() < 1e-12);
    }
}
