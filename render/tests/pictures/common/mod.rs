//! What the integration tests share. Each of them uses a part.
#![allow(dead_code)]

use crate::once::Once;
use calibrate::{Lens, Rigid3, View};
use datasets::{Dataset, Options};
use glam::{DQuat, DVec2, DVec3};
use image::RgbaImage;
use proxy::{Plane, Proxy};
use render::gpu::Gpu;
use render::{
    Frame, Lumigraph, Method, PhotoStore, RenderError, SourceView, TriangulatedField, cpu, field,
    reference,
};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// The graphics device, one for all tests of a program. `None`, said aloud, where no
/// driver answers, unless the environment has `LUMIGRAPH_REQUIRE_GPU=1`.
pub(crate) fn gpu() -> Option<MutexGuard<'static, Gpu>> {
    static DEVICE: OnceLock<Option<Mutex<Gpu>>> = OnceLock::new();
    let open = || match Gpu::open() {
        Ok(gpu) => Some(Mutex::new(gpu)),
        Err(error) if std::env::var("LUMIGRAPH_REQUIRE_GPU").as_deref() == Ok("1") => {
            panic!("LUMIGRAPH_REQUIRE_GPU is 1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIPPED: tests on the graphics device: {error}");
            None
        }
    };
    let device = DEVICE.get_or_init(open).as_ref()?;
    // A failed test elsewhere is no reason to fail this one.
    Some(device.lock().unwrap_or_else(PoisonError::into_inner))
}

/// Pseudo-random numbers, the same everywhere: SplitMix64 (Steele et al. 2014).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Evenly in low…high.
    pub(crate) fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Below `count`.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// Evenly in the cube of half side `reach`.
    pub(crate) fn vector(&mut self, reach: f64) -> DVec3 {
        let mut coordinate = || self.within(-reach, reach);
        DVec3::new(coordinate(), coordinate(), coordinate())
    }

    pub(crate) fn direction(&mut self) -> DVec3 {
        loop {
            let v = self.vector(1.0);
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }

    pub(crate) fn rotation(&mut self) -> DQuat {
        DQuat::from_axis_angle(self.direction(), self.within(0.0, 6.0))
    }

    pub(crate) fn shuffle<T>(&mut self, items: &mut [T]) {
        for i in (1..items.len()).rev() {
            items.swap(i, self.below(i + 1));
        }
    }
}

/// A pinhole view from `center` towards `target`, y of the world upwards.
pub(crate) fn pinhole(center: DVec3, target: DVec3, focal: f64, size: (u32, u32)) -> View {
    let half = DVec2::new(f64::from(size.0), f64::from(size.1)) / 2.0;
    View {
        lens: Lens::pinhole(DVec2::splat(focal), half),
        width: size.0,
        height: size.1,
        camera_from_world: Rigid3::looking_at(center, target, DVec3::Y),
    }
}

/// A dataset's scene, its views and the photos taken there.
#[derive(Clone)]
pub(crate) struct Shot {
    pub(crate) dataset: Dataset,
    pub(crate) views: Vec<View>,
    pub(crate) photos: Vec<RgbaImage>,
    /// Fitted to the sparse points; for the wall, the true one.
    pub(crate) plane: Plane,
}

impl Shot {
    /// A dataset at 160 × 120, seen through another lens where one is given.
    pub(crate) fn of(name: &str, views: usize, lens: Option<Lens>) -> Self {
        static MADE: Once<(String, usize), Shot> = Once::new();
        if lens.is_some() {
            return Self::made(name, views, lens);
        }
        let known = MADE.get((name.to_owned(), views), || Self::made(name, views, None));
        known.clone()
    }

    fn made(name: &str, views: usize, lens: Option<Lens>) -> Self {
        let options = Options {
            size: Some((160, 120)),
            views: Some(views),
            samples_per_side: Some(2),
        };
        let dataset = datasets::by_name(name, &options).unwrap();
        let views: Vec<View> = dataset
            .photos
            .iter()
            .map(|photo| View {
                lens: lens.unwrap_or(photo.view.lens),
                ..photo.view.clone()
            })
            .collect();
        let photos = views
            .iter()
            .zip(&dataset.photos)
            .map(|(view, photo)| {
                let scene = dataset.scene_of(photo);
                datasets::render_view(&scene, view, dataset.samples_per_side)
            })
            .collect();
        let plane = match name {
            "wall" => {
                let wall = dataset.scene.objects()[0].world_from_shape;
                Plane::new(wall.translation, wall.rotation * DVec3::Z).unwrap()
            }
            _ => proxy::fit_plane(&dataset.reconstruction).unwrap().plane,
        };
        Self {
            dataset,
            views,
            photos,
            plane,
        }
    }

    pub(crate) fn sources(&self) -> Vec<SourceView> {
        let source = |(i, view): (usize, &View)| SourceView {
            name: self.dataset.photos[i].name.clone(),
            view: view.clone(),
            gain: [1.0; 3],
            time_s: self.dataset.photos[i].time_s,
            quarters: 0,
        };
        self.views.iter().enumerate().map(source).collect()
    }

    pub(crate) fn lumigraph(&self) -> Lumigraph {
        Lumigraph {
            points: Vec::new(),
            sources: self.sources(),
            photos: PhotoStore::from_images(self.photos.clone()),
            proxy: Proxy::Plane(self.plane),
            visibility: None,
        }
    }
}

pub(crate) const METHODS: [Method; 2] = [Method::Exact, Method::TRIANGULATED];

/// The picture by the plain engine.
pub(crate) fn by_reference(frame: &Frame<'_>, method: Method) -> Result<RgbaImage, RenderError> {
    Ok(match method {
        Method::Exact => reference::render_exact(frame)?,
        Method::Triangulated { cells_across } => {
            field::render_reference(frame, &TriangulatedField::new(frame, cells_across)?)?
        }
    })
}

/// The picture by every engine there is, each with its name.
pub(crate) fn by_all(
    frame: &Frame<'_>,
    method: Method,
) -> Vec<(&'static str, Result<RgbaImage, RenderError>)> {
    let mut pictures = vec![
        ("reference", by_reference(frame, method)),
        ("cpu", cpu::render(frame, method)),
    ];
    if let Some(mut gpu) = gpu() {
        pictures.push(("gpu", gpu.render(frame, method)));
    }
    pictures
}

/// PSNR in dB over the pixels that both cover at all, colour as seen on black; infinite
/// where they are the same.
pub(crate) fn psnr_covered(a: &RgbaImage, b: &RgbaImage) -> f64 {
    psnr_where(a, b, |p, q| p[3] > 0 && q[3] > 0)
}

/// PSNR in dB over all pixels, colour as seen on black, and coverage as a fourth channel.
pub(crate) fn psnr(a: &RgbaImage, b: &RgbaImage) -> f64 {
    psnr_where(a, b, |_, _| true)
}

/// Colour on black, and coverage.
fn as_seen([r, g, b, alpha]: [u8; 4]) -> [f64; 4] {
    let share = f64::from(alpha) / 255.0;
    let on_black = |v: u8| f64::from(v) * share;
    [on_black(r), on_black(g), on_black(b), f64::from(alpha)]
}

fn psnr_where(a: &RgbaImage, b: &RgbaImage, counts: impl Fn([u8; 4], [u8; 4]) -> bool) -> f64 {
    assert_eq!(a.dimensions(), b.dimensions());
    let (mut sum, mut count) = (0.0, 0);
    for (p, q) in a.pixels().zip(b.pixels()).filter(|(p, q)| counts(p.0, q.0)) {
        let (p, q) = (as_seen(p.0), as_seen(q.0));
        sum += (0..4).map(|c| (p[c] - q[c]).powi(2)).sum::<f64>();
        count += 4;
    }
    assert!(count > 0, "nothing to compare");
    10.0 * (255.0_f64.powi(2) * f64::from(count) / sum).log10()
}

/// The pixels that differ by more than 2/255 in coverage or in a colour as it is seen:
/// where coverage is small, so is the matter of its colour, and texture units filter
/// premultiplied bytes.
pub(crate) fn differing(a: &RgbaImage, b: &RgbaImage) -> Vec<(u32, u32)> {
    assert_eq!(a.dimensions(), b.dimensions());
    a.enumerate_pixels()
        .filter(|(x, y, p)| {
            let (p, q) = (as_seen(p.0), as_seen(b.get_pixel(*x, *y).0));
            (0..4).any(|c| (p[c] - q[c]).abs() > 2.0)
        })
        .map(|(x, y, _)| (x, y))
        .collect()
}

/// That at least 99.9 % of pixels are within 2/255.
pub(crate) fn assert_close(a: &RgbaImage, b: &RgbaImage, what: &str) {
    let differing = differing(a, b);
    let allowed = a.pixels().len() / 1000;
    assert!(
        differing.len() <= allowed,
        "{what}: {} pixels differ by more than 2/255, {allowed} may; the first is {:?}: {:?}, {:?}",
        differing.len(),
        differing[0],
        a.get_pixel(differing[0].0, differing[0].1),
        b.get_pixel(differing[0].0, differing[0].1),
    );
}

/// A picture without what lies within a few pixels of anything that was moved to where a photo
/// has it: there the surface jumps, and the triangulated field follows no jumps.
pub(crate) fn unmoved(frame: &Frame<'_>, picture: &RgbaImage) -> RgbaImage {
    const AROUND: u32 = 8;
    let mut picture = picture.clone();
    let (width, height) = picture.dimensions();
    if let render::Surface::Facets(map) = &frame.surface {
        for (i, _) in map.moved().enumerate().filter(|(_, moved)| *moved) {
            let (x, y) = (i as u32 % width, i as u32 / width);
            for y in y.saturating_sub(AROUND)..(y + AROUND).min(height) {
                for x in x.saturating_sub(AROUND)..(x + AROUND).min(width) {
                    picture.put_pixel(x, y, image::Rgba([0; 4]));
                }
            }
        }
    }
    picture
}
