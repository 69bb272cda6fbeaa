//! What one sees of a portal.

/// What is drawn of the cells beyond a portal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PortalFill {
    /// Their geometry.
    Geometry,
    /// The nearest reference image, as a picture on the portal's plane.
    Texture,
    /// The nearest reference image, warped.
    Warp1,
    /// The two nearest, warped: the second first, the nearest over it.
    Warp2,
    /// A layered depth image made of all of the semicircle's, warped in any order.
    Ldi,
}

impl PortalFill {
    /// All of them.
    pub const ALL: [Self; 5] = [
        Self::Geometry,
        Self::Texture,
        Self::Warp1,
        Self::Warp2,
        Self::Ldi,
    ];

    /// As the command line and reports spell it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Geometry => "geometry",
            Self::Texture => "texture",
            Self::Warp1 => "warp1",
            Self::Warp2 => "warp2",
            Self::Ldi => "ldi",
        }
    }

    /// The fill of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|fill| fill.name() == name)
    }

    /// How many reference images a frame takes. An LDI is made of all of them once.
    pub fn references(self) -> usize {
        match self {
            Self::Geometry | Self::Ldi => 0,
            Self::Texture | Self::Warp1 => 1,
            Self::Warp2 => 2,
        }
    }
}
