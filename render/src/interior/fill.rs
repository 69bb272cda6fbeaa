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
    /// The whole model as if there were no cells: what culling and images are compared with.
    Whole,
}

impl PortalFill {
    /// All that use portals.
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
            Self::Whole => "whole",
        }
    }

    /// This where it is not the default, as the command line spells it: `--portals ldi`; else empty. With how many
    /// of their views LDIs are made of, if not of all: `--portals ldi --ldi-views 3`.
    pub fn spelled(self, ldi_views: Option<usize>) -> String {
        match (self, ldi_views) {
            (Self::Geometry, _) => String::new(),
            (Self::Ldi, Some(views)) => format!("--portals ldi --ldi-views {views}"),
            (other, _) => format!("--portals {}", other.name()),
        }
    }

    /// The fill of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        let mut all = Self::ALL.into_iter().chain([Self::Whole]);
        all.find(|fill| fill.name() == name)
    }

    /// Whether one sees images of any kind, and not geometry alone.
    pub fn shows_images(self) -> bool {
        !matches!(self, Self::Geometry | Self::Whole)
    }

    /// How many reference images a frame takes. An LDI is made of all of them once.
    pub fn references(self) -> usize {
        match self {
            Self::Geometry | Self::Ldi | Self::Whole => 0,
            Self::Texture | Self::Warp1 => 1,
            Self::Warp2 => 2,
        }
    }
}
