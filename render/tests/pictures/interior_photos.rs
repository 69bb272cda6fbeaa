//! Layered depth images made of photos with depth maps.

use crate::house;

use calibrate::{Distortion, Lens, Rigid3, View};
use capture::DepthMap;
use datasets::house::House;
use glam::DVec3;
use house::{own_house, random};
use image::RgbaImage;
use proxy::interior::{Contents, SemicircleOptions, SemicircleView};
use proxy::{MeshKind, Proxy, Solid};
use render::interior::{
    Captured, CellGeometry, DepthMaps, LdiSource, Library, LibraryOptions, Painter, Pinhole,
    PortalLdi, Reference, Target, Window,
};
use render::ldi::{Clipped, Conflict, ConstructOptions, Free, FreeOptions, free as free_order};
use render::score::score;
use render::{DeviceChoice, Engine, FieldOptions, Lumigraph, Method, PhotoStore, SourceView};
use std::sync::Arc;

const VIEWS: usize = 5;

/// Photos with depth maps from the places before portals that are free.
struct Taken {
    house: House,
    contents: Contents,
    geometry: CellGeometry,
    places: Vec<SemicircleView>,
    /// The sides of portals before which all places are free.
    free: Vec<usize>,
    photos: Vec<(View, RgbaImage, DepthMap)>,
}

/// Photos through the lenses that images before portals have, bent so much. Their inverse depths have
/// so much noise.
fn taken(deviation: f64, bend: f64) -> Taken {
    let (mut house, contents) = own_house(2, 2);
    let geometry = CellGeometry::new(&house.model, &contents);
    let places = proxy::interior::semicircles(&house.interior, &contents, &semicircles());
    let sides: Vec<&[SemicircleView]> = places.chunks(VIEWS).collect();
    let free: Vec<usize> = (0..sides.len())
        .filter(|i| sides[*i].iter().all(|p| p.is_inside && p.from.is_some()))
        .collect();
    let mut random = random(7);
    let mut photos = Vec::new();
    for place in free.iter().flat_map(|i| sides[*i]) {
        let Pinhole {
            focal, principal, ..
        } = Reference::new(&house.interior, &house.model, &geometry, place, [96; 2]).camera;
        let lens = match bend == 0.0 {
            true => Lens::pinhole(focal, principal),
            false => {
                let k = [bend, 0.0, 0.0, 0.0, 0.0, 0.0];
                let p = [0.05 * bend, -0.02 * bend];
                Lens::new(focal, principal, Distortion::Rational { k, p })
            }
        };
        let view = View {
            lens,
            width: 96,
            height: 96,
            camera_from_world: place.camera_from_world,
        };
        let (pixels, depths) = datasets::house::render(&house, &view);
        let mut noisy = |z: &f64| {
            let normal = (0..12).map(|_| random()).sum::<f64>() - 6.0;
            (1.0 / (1.0 / z + deviation * normal)) as f32
        };
        let depths = DepthMap {
            width: 96,
            height: 96,
            depths: depths.iter().map(&mut noisy).collect(),
        };
        photos.push((view, pixels, depths));
    }
    house.interior.show_photos("photos");
    Taken {
        house,
        contents,
        geometry,
        places,
        free,
        photos,
    }
}

fn semicircles() -> SemicircleOptions {
    SemicircleOptions {
        views: VIEWS,
        ..SemicircleOptions::default()
    }
}

/// The LDIs of the free sides, how many images or photos they were made of, and what was said.
struct Made {
    ldis: Vec<Arc<Option<PortalLdi>>>,
    of: usize,
    notes: String,
}

impl Taken {
    fn side(&self, side: usize) -> &[SemicircleView] {
        &self.places[side * VIEWS..(side + 1) * VIEWS]
    }

    /// LDIs of images, in the model's colours.
    fn of_views(&self) -> Made {
        self.made(LdiSource::Views, None)
    }

    /// LDIs of the photos, each with the gain that `gain` says of it, and the depth map that `map`
    /// gives in place of its own.
    fn of_photos(
        &self,
        gain: impl Fn(usize) -> f64,
        map: impl Fn(usize, DepthMap) -> Result<DepthMap, String> + Send + Sync + 'static,
    ) -> Made {
        self.of_those(|_| true, gain, map)
    }

    /// The same of those photos that can be decoded.
    fn of_those(
        &self,
        is_whole: impl Fn(usize) -> bool + Send + Sync + 'static,
        gain: impl Fn(usize) -> f64,
        map: impl Fn(usize, DepthMap) -> Result<DepthMap, String> + Send + Sync + 'static,
    ) -> Made {
        let photos = self.photos.iter().enumerate();
        let sources = photos.clone().map(|(i, (view, ..))| SourceView {
            name: format!("{i}.jpg"),
            view: view.clone(),
            gain: [gain(i); 3],
            time_s: None,
            quarters: 0,
        });
        let exposed = photos.map(|(i, (_, pixels, _))| {
            let mut pixels = pixels.clone();
            for pixel in pixels.pixels_mut() {
                for value in &mut pixel.0[..3] {
                    *value = (f64::from(*value) * gain(i)).round() as u8;
                }
            }
            pixels
        });
        let model = &self.house.model;
        let solid = Solid::new(MeshKind::Depth, model.mesh.clone());
        let exposed: Vec<RgbaImage> = exposed.collect();
        let lumigraph = Lumigraph {
            visibility: None,
            photos: PhotoStore::new(exposed.len(), move |i| match is_whole(i) {
                true => Ok(exposed[i].clone()),
                false => Err(format!("{i}.jpg: not a picture")),
            }),
            sources: sources.collect(),
            proxy: Proxy::Mesh(Arc::new(solid)),
            points: Vec::new(),
        };
        let maps: Vec<DepthMap> = self.photos.iter().map(|(.., d)| d.clone()).collect();
        let maps = DepthMaps::new(vec![true; maps.len()], move |i| map(i, maps[i].clone()));
        let captured = Captured::new(
            lumigraph,
            Engine::open(DeviceChoice::Cpu).unwrap(),
            FieldOptions::default(),
            Method::Exact,
            &self.house.interior,
            &self.contents,
            model,
            0..0,
        );
        let mut captured = captured.with_depth_maps(maps);
        let mut made = self.made(LdiSource::Photos, Some(&mut captured));
        made.notes = Painter::of_photos(captured).notes().join("; ");
        made
    }

    fn made(&self, ldi_of: LdiSource, captured: Option<&mut Captured>) -> Made {
        let options = LibraryOptions {
            size: [96; 2],
            semicircles: semicircles(),
            ldi_of,
            // As LDIs of photos are.
            ldi: ConstructOptions {
                conflict: Conflict::SmallerPatch { same_color: 255 },
                fit: false,
                ..ConstructOptions::default()
            },
            ..LibraryOptions::default()
        };
        let (interior, model) = (&self.house.interior, &self.house.model);
        let mut library = Library::new(interior, &self.contents, &options);
        let middles: Vec<usize> = self
            .free
            .iter()
            .map(|side| side * VIEWS + VIEWS / 2)
            .collect();
        let made = library.ldis(&middles, interior, model, &self.geometry, captured);
        let (ldis, took) = made.unwrap();
        Made {
            ldis,
            of: took.images,
            notes: String::new(),
        }
    }

    /// What LDIs have in samples, and what they score beside the middle place.
    fn worth(&self, made: &Made) -> Vec<(f64, f64)> {
        let worth = |(side, ldi): (&usize, &Arc<Option<PortalLdi>>)| {
            let portal = Option::as_ref(ldi).expect("samples");
            (portal.ldi.len() as f64, self.psnr(*side, portal))
        };
        self.free.iter().zip(&made.ldis).map(worth).collect()
    }

    fn psnr(&self, side: usize, portal: &PortalLdi) -> f64 {
        let (interior, model) = (&self.house.interior, &self.house.model);
        let places = self.side(side);
        let eye = |i: usize| places[i].camera_from_world.center();
        let mut place = places[2].clone();
        let center = interior.portal(place.portal).polygon.center();
        place.camera_from_world = Rigid3::looking_at(eye(2).lerp(eye(3), 0.4), center, DVec3::Y);
        let truth = Reference::new(interior, model, &self.geometry, &place, [128; 2]);
        let (whole, mut target) = (Window::whole(128, 128), Target::new(128, 128));
        let (columns, options) = (Clipped::whole(&portal.ldi), FreeOptions::default());
        let scratch = &mut Free::default();
        free_order(
            &portal.ldi,
            &columns,
            &truth.camera,
            &whole,
            &options,
            scratch,
            &mut target,
        );
        // What an LDI has beside the portal's outline is not asked for.
        for (color, truth) in target.color.iter_mut().zip(&truth.seen.color) {
            if truth[3] == 0 {
                *color = *truth;
            }
        }
        let [found, truth] = [target, truth.seen].map(|seen| seen.picture());
        score(&found, &truth).unwrap().psnr
    }
}

#[test]
fn photos_taken_where_planned_make_the_ldi_that_images_make() {
    let taken = taken(0.0, 0.0);
    let of_photos = taken.of_photos(|_| 1.0, |_, map| Ok(map));
    assert!(of_photos.of >= taken.free.len() * VIEWS, "{}", of_photos.of);
    let exact = taken.worth(&of_photos);
    assert!(exact.len() > 1);
    for ((samples, psnr), (of_views, psnr_of_views)) in
        exact.iter().zip(taken.worth(&taken.of_views()))
    {
        let share = samples / of_views;
        assert!((0.85..1.05).contains(&share), "{share}");
        assert!(*psnr > psnr_of_views - 0.2, "{psnr} {psnr_of_views}");
    }
    // Noise doubles no surface, though two depths of a wall are rarely within the range.
    let noisy = self::taken(0.003, 0.0);
    let noisy = noisy.worth(&noisy.of_photos(|_| 1.0, |_, map| Ok(map)));
    for ((noisy, psnr), (exact, psnr_of_exact)) in noisy.iter().zip(&exact) {
        let share = noisy / exact;
        assert!((0.85..1.0).contains(&share), "{share}");
        // What it adds to the squared error, in shares of white's: with whatever else is wrong, decibels
        // would be fewer.
        let error = |psnr: &f64| 10.0_f64.powf(-0.1 * psnr);
        let added = error(psnr) - error(psnr_of_exact);
        assert!(added < 0.0019, "{psnr} {psnr_of_exact}");
    }
    // Lenses that bend see beyond the portal, so some have fewer pixels of it.
    let bent = self::taken(0.0, -0.05);
    let bent = bent.worth(&bent.of_photos(|_| 1.0, |_, map| Ok(map)));
    for ((bent, psnr), (exact, psnr_of_exact)) in bent.iter().zip(&exact) {
        let share = bent / exact;
        assert!((0.7..1.1).contains(&share), "{share}");
        assert!(*psnr > psnr_of_exact - 2.0, "{psnr} {psnr_of_exact}");
    }
}

/// Photos that are exposed differently make the LDI that they make when they are not, brighter or
/// darker as a whole.
#[test]
fn photos_are_brought_to_one_exposure() {
    let taken = taken(0.0, 0.0);
    let alike = taken.of_photos(|_| 1.0, |_, map| Ok(map));
    let apart = taken.of_photos(|i| [0.9, 0.6, 0.75][i % 3], |_, map| Ok(map));
    for (alike, apart) in alike.ldis.iter().zip(&apart.ldis) {
        let samples = |ldi: &Arc<Option<PortalLdi>>| {
            let portal = Option::as_ref(ldi).expect("samples");
            portal.ldi.samples()
        };
        let (alike, apart) = (samples(alike), samples(apart));
        assert_eq!(alike.len(), apart.len());
        let sum = |samples: &[render::ldi::Sample]| -> f64 {
            let all = samples.iter().flat_map(|s| &s.color[..3]);
            all.map(|value| f64::from(*value)).sum()
        };
        let gain = sum(&apart) / sum(&alike);
        assert!((0.6..0.9).contains(&gain), "{gain}");
        for (alike, apart) in alike.iter().zip(&apart) {
            for k in 0..3 {
                let off = f64::from(apart.color[k]) - gain * f64::from(alike.color[k]);
                assert!(off.abs() < 2.0, "{alike:?} {apart:?} {gain}");
            }
        }
    }
}

/// A depth map that cannot be used is left out by name, and if none can, images take the photos'
/// place.
#[test]
fn depth_maps_that_cannot_be_used_are_left_out() {
    let taken = taken(0.0, 0.0);
    let all = taken.of_photos(|_| 1.0, |_, map| Ok(map));
    let some = taken.of_photos(
        |_| 1.0,
        |i, map| match i {
            1 => Err("1.png: not a picture".to_owned()),
            2 => Ok(DepthMap {
                width: 48,
                height: 48,
                depths: map.depths[..48 * 48].to_vec(),
            }),
            _ => Ok(map),
        },
    );
    let notes = &some.notes;
    assert!(
        notes.contains("the depth map of photo 1.jpg is left out: 1.png: not a picture"),
        "{notes}"
    );
    assert!(
        notes.contains("the depth map of photo 2.jpg is left out: "),
        "{notes}"
    );
    assert!(all.notes.is_empty(), "{}", all.notes);
    for ((samples, _), (all, _)) in taken.worth(&some).iter().zip(taken.worth(&all)) {
        // Two of a side's five are gone, or none.
        assert!(samples / all > 0.5, "{samples} {all}");
    }
    let none = taken.of_photos(|_| 1.0, |i, _| Err(format!("{i}.png: not a picture")));
    assert!(
        none.notes
            .contains("LDIs are made of views: the depth maps cannot be used: 0.png"),
        "{}",
        none.notes
    );
    assert!(none.ldis.iter().all(|ldi| ldi.is_some()));
}

/// A photo that cannot be decoded is left out of all LDIs, not only of the first that asks for it.
#[test]
fn photos_that_cannot_be_decoded_are_left_out_of_all() {
    let taken = taken(0.0, 0.0);
    let mut times_said = 0;
    for lost in 0..taken.photos.len() {
        let some = taken.of_those(move |i| i != lost, |_| 1.0, |_, map| Ok(map));
        let said = format!("photo {lost}.jpg is left out: ");
        times_said += some.notes.matches(&said).count();
        assert!(some.ldis.iter().all(|ldi| ldi.is_some()), "{}", some.notes);
    }
    // Some are seen by no portal's semicircle.
    assert!(
        (1..=taken.photos.len()).contains(&times_said),
        "{times_said}"
    );
}
