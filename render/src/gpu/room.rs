//! How large a texture array may be: a budget's and a device's say.

use crate::RenderError;
use crate::frame::Frame;
use crate::pyramid::MAX_LEVELS;

/// What a texture array holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Content {
    /// Premultiplied RGBA.
    Photos,
    /// The ignore masks of the views that have one.
    Masks,
    /// Distance maps, half as large as the photos.
    Distances,
}

impl Content {
    /// For people.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Photos => "photos",
            Self::Masks => "masks",
            Self::Distances => "distance maps",
        }
    }

    /// Tells what the layers were made from.
    pub(super) fn id(self, frame: &Frame<'_>) -> u64 {
        match (self, &frame.lumigraph.visibility) {
            (Self::Distances, Some(visibility)) => visibility.id(),
            _ => frame.lumigraph.photos.id(),
        }
    }

    /// Of a layer in texels.
    pub(super) fn layer_size(self, frame: &Frame<'_>) -> [u32; 2] {
        let photo_size = array_size(frame);
        match (self, &frame.lumigraph.visibility) {
            (Self::Distances, Some(visibility)) => {
                photo_size.map(|side| side / visibility.reduction())
            }
            _ => photo_size,
        }
    }

    /// The mip level from which on an array may have to make do. Shaders take masks and
    /// distances to be there in full.
    pub(super) fn coarsest(self) -> usize {
        match self {
            Self::Photos => MAX_LEVELS - 1,
            Self::Masks | Self::Distances => 0,
        }
    }

    /// Mip levels, where those finer than `finest` are left out.
    pub(super) fn levels(self, finest: usize) -> u32 {
        match self {
            Self::Photos | Self::Masks => (MAX_LEVELS - finest) as u32,
            Self::Distances => 1,
        }
    }

    /// Bytes of a layer without the levels finer than `finest`.
    pub(super) fn layer_bytes(self, layer_size: [u32; 2], finest: usize) -> u64 {
        let texel_bytes = match self {
            Self::Photos => 4,
            Self::Masks => 1,
            Self::Distances => 2,
        };
        let levels = finest..finest + self.levels(finest) as usize;
        let texels = |level| {
            layer_size
                .map(|side| u64::from(side >> level))
                .iter()
                .product::<u64>()
        };
        texel_bytes * levels.map(texels).sum::<u64>()
    }
}

/// Both sides of the array are multiples of this, the texel of the coarsest level.
const ALIGNMENT: u32 = 1 << (MAX_LEVELS - 1);

/// Texels of a layer that any photo fits in.
pub(super) fn array_size(frame: &Frame<'_>) -> [u32; 2] {
    let sources = &frame.lumigraph.sources;
    let largest = |side: fn(&calibrate::View) -> u32| {
        let longest = sources.iter().map(|s| side(&s.view)).max().unwrap_or(1);
        longest.next_multiple_of(ALIGNMENT)
    };
    [largest(|v| v.width), largest(|v| v.height)]
}

/// What an array may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Room {
    /// The photos' mip level that becomes its finest.
    pub(super) finest: usize,
    /// Layers at most.
    pub(super) most: u32,
    /// Whether they are filled several times for one frame: then the array is made as large as
    /// it may be.
    pub(super) grouped: bool,
}

impl Room {
    /// For the `count` layers of a frame, of so many texels in full: from the finest mip level on from which they fit the
    /// budget and textures of the device, else the coarsest. It depends on nothing else, so that
    /// a frame looks the same whatever was drawn before. Layers may be fewer than `count`: then
    /// the frame is drawn in groups.
    pub(super) fn of(
        content: Content,
        size: [u32; 2],
        count: u32,
        budget: Option<u64>,
        limits: &wgpu::Limits,
    ) -> Result<Self, RenderError> {
        let [side, layers] = [
            limits.max_texture_dimension_2d,
            limits.max_texture_array_layers,
        ];
        let coarsest = content.coarsest();
        let small_enough = |finest: usize| size.iter().all(|s| s >> finest <= side);
        let affordable = |finest: usize| {
            let bytes = content.layer_bytes(size, finest) * u64::from(count);
            budget.is_none_or(|budget| bytes <= budget)
        };
        let finest = (0..coarsest)
            .find(|&finest| small_enough(finest) && affordable(finest))
            .unwrap_or(coarsest);
        if !small_enough(finest) {
            return Err(RenderError::Gpu(format!(
                "{} of {} × {} are more than this device holds ({side} × {side}); use --device cpu",
                content.name(),
                size[0],
                size[1]
            )));
        }
        let affordable = budget.map_or(layers, |budget| {
            let layers = budget / content.layer_bytes(size, finest).max(1);
            u32::try_from(layers).unwrap_or(u32::MAX)
        });
        let most = affordable.max(count).clamp(1, layers);
        Ok(Self {
            finest,
            most,
            grouped: count > most,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [u32; 2] = [128, 64];

    fn of(count: u32, budget: Option<u64>, limits: &wgpu::Limits) -> Result<Room, RenderError> {
        Room::of(Content::Photos, SIZE, count, budget, limits)
    }

    #[test]
    fn a_budget_takes_levels_until_all_layers_fit() {
        let limits = wgpu::Limits::default();
        assert_eq!(limits.max_texture_array_layers, 256);
        let room = |count, budget| of(count, budget, &limits).unwrap();
        let expected = |finest, most| Room {
            finest,
            most,
            grouped: false,
        };
        assert_eq!(room(9, None), expected(0, 256));
        let layer = |finest| Content::Photos.layer_bytes(SIZE, finest);
        assert_eq!(layer(0), 4 * (8192 + 2048 + 512 + 128 + 32 + 8 + 2));
        for finest in 0..MAX_LEVELS - 1 {
            assert_eq!(room(9, Some(9 * layer(finest))), expected(finest, 9));
            let less = Some(9 * layer(finest) - 1);
            assert_eq!(room(9, less).finest, finest + 1);
        }
        assert_eq!(room(9, Some(11 * layer(0) + 5)), expected(0, 11));
        assert_eq!(room(9, Some(u64::MAX)), expected(0, 256));
        // Over the budget rather than not at all.
        assert_eq!(room(9, Some(1)), expected(MAX_LEVELS - 1, 9));
    }

    #[test]
    fn a_device_takes_levels_and_groups() {
        let limits = wgpu::Limits {
            max_texture_dimension_2d: 32,
            max_texture_array_layers: 7,
            ..wgpu::Limits::default()
        };
        let room = of(7, None, &limits).unwrap();
        assert_eq!((room.finest, room.most, room.grouped), (2, 7, false));
        // More than it has layers for: in groups.
        let grouped = Room {
            grouped: true,
            ..room
        };
        assert_eq!(of(8, None, &limits).unwrap(), grouped);
        // Masks are there in full or not at all.
        let masks = |limits| Room::of(Content::Masks, SIZE, 1, Some(1), limits);
        let error = masks(&limits).unwrap_err().to_string();
        assert!(error.contains("masks of 128 × 64 are more"), "{error}");
        assert!(error.contains("(32 × 32)"), "{error}");
        let whole = masks(&wgpu::Limits::default()).unwrap();
        assert_eq!((whole.finest, whole.most, whole.grouped), (0, 1, false));
    }
}
