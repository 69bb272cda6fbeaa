/// A position in an image, in pixels: (0, 0) is the top-left corner, (0.5, 0.5) the first
/// pixel's centre. Not to be mixed up with normalised coordinates on the plane z = 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pixel {
    /// To the right.
    pub x: f64,
    /// Downwards.
    pub y: f64,
}

impl Pixel {
    /// The pixel at (x, y).
    pub fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// The centre of the pixel in a column and a row.
    pub fn center_of(column: u32, row: u32) -> Self {
        Self {
            x: f64::from(column) + 0.5,
            y: f64::from(row) + 0.5,
        }
    }

    /// Euclidean distance in pixels.
    pub fn distance(self, other: Self) -> f64 {
        (self.x - other.x).hypot(self.y - other.y)
    }
}
