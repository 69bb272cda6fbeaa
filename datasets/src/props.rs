//! What the indoor scenes are built of.

use crate::shape::smooth_profile;
use crate::texture::rgb;
use crate::{Finish, Material, Object, Shape, Texture};
use calibrate::Rigid3;
use glam::{DQuat, DVec2, DVec3};

/// The same from everywhere.
pub(crate) const MATTE: Finish = Finish::Matte;
/// A soft highlight.
pub(crate) const SATIN: Finish = Finish::Glossy {
    highlight: 0.22,
    exponent: 40.0,
    mirror: 0.0,
};
/// A sharp highlight and a faint mirror image.
pub(crate) const GLAZED: Finish = Finish::Glossy {
    highlight: 0.9,
    exponent: 350.0,
    mirror: 0.09,
};

/// A shape somewhere; what is large casts no shadow.
pub(crate) fn object(
    shape: Shape,
    at: DVec3,
    rotation: DQuat,
    texture: Texture,
    finish: Finish,
) -> Object {
    Object {
        // Walls, tables and rooms shade nothing else.
        casts_shadow: shape.ball().1 < 1.0,
        shape,
        world_from_shape: Rigid3::new(rotation, at),
        material: Material { texture, finish },
    }
}

/// A box by half its sides.
pub(crate) fn cuboid(half: DVec3) -> Shape {
    Shape::Cuboid { half }
}

/// One sRGB colour, mottled.
pub(crate) fn mottled(color: u32, contrast: f64, wavelength: f64, seed: u32) -> Texture {
    Texture::Mottled {
        color: rgb(color),
        contrast,
        wavelength,
        seed,
    }
}

/// A smooth solid of revolution: (radius, y) from the foot upwards.
pub(crate) fn turned(through: &[(f64, f64)]) -> Shape {
    let through: Vec<DVec2> = through.iter().map(|&(r, y)| DVec2::new(r, y)).collect();
    Shape::Lathe {
        profile: smooth_profile(&through, 3),
    }
}

/// A cylinder between two places.
pub(crate) fn rod(from: DVec3, to: DVec3, radius: f64, texture: Texture, finish: Finish) -> Object {
    let along = to - from;
    let shape = Shape::Cylinder {
        radius,
        half_height: 0.5 * along.length(),
    };
    let turn = DQuat::from_rotation_arc(DVec3::Y, along.normalize());
    object(shape, 0.5 * (from + to), turn, texture, finish)
}
