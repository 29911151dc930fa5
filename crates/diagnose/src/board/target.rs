//! What is printed on a board, and what of it was seen.

use glam::{DVec2, DVec3};

/// A kind of calibration target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pattern {
    /// Squares; points are the inner corners.
    Checkerboard,
    /// A checkerboard with ArUco markers in its white squares; points are the inner corners.
    Charuco,
    /// Tags of the family t36h11, laid out as by Kalibr; points are the corners of the tags.
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

/// Markers of a ChArUco board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Marker {
    /// Side of a marker over that of a square.
    pub share: f64,
    /// OpenCV's name of its dictionary.
    pub dictionary: &'static str,
}

/// A target: points on a plane, counted along columns (x) and rows (y) from the first inner corner, of an AprilGrid
/// from its lower left corner upwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Its kind.
    pub pattern: Pattern,
    /// Columns and rows of points: inner corners, or corners of tags.
    pub size: [usize; 2],
    /// Side of a square or tag along x and y, m.
    pub square_m: [f64; 2],
    /// Of a ChArUco board.
    pub marker: Option<Marker>,
    /// Of an AprilGrid: gap between tags over their side.
    pub tag_spacing: Option<f64>,
}

impl Target {
    /// A checkerboard of so many inner corners, with squares of these sides, m.
    pub fn checkerboard(size: [usize; 2], square_m: [f64; 2]) -> Self {
        Self { pattern: Pattern::Checkerboard, size, square_m, marker: None, tag_spacing: None }
    }

    /// How many points it has.
    pub fn count(&self) -> usize {
        self.size[0] * self.size[1]
    }

    /// Place of a column (axis 0) or row (axis 1) of points, m.
    pub fn at_m(&self, axis: usize, index: usize) -> f64 {
        let squares = match self.tag_spacing {
            Some(spacing) => (index / 2) as f64 * (1.0 + spacing) + (index % 2) as f64,
            None => index as f64,
        };
        squares * self.square_m[axis]
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
            _ => format!("{} of {columns}x{rows} inner corners", self.pattern.name()),
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
