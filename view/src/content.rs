//! What the window shows, and what moving about in it needs to know.

use crate::walker::Obstacles;
use calibrate::{Camera, Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use proxy::Proxy;
use proxy::interior::{CellId, Contents, Interior};
use proxy::mesh::Model;
use render::interior::{Painter, Tour};
use render::trajectory::upright;
use render::{Lumigraph, Moment, SourceView};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// What the window shows.
#[derive(Clone, Debug)]
pub enum Content {
    /// Photos over a proxy.
    Scene(Arc<Lumigraph>),
    /// Cells and portals.
    Interior(Arc<House>),
}

/// An interior, its model, and what of it is in the way.
#[derive(Debug)]
pub struct House {
    /// Its cells and portals.
    pub interior: Interior,
    /// What of the model each cell has.
    pub contents: Contents,
    /// The model.
    pub model: Model,
    /// What stops who walks.
    pub obstacles: Obstacles,
    /// Where one can stand in each cell, at eye height: nearest to its middle.
    standing: Vec<Option<DVec3>>,
    /// Cameras of the photos that show it, if any do.
    cameras: Vec<Stop>,
    /// What draws it from photos, where some show it; taken by the first that draws.
    photos: Mutex<Option<Painter>>,
    /// The folder of its layered depth images, where some were made as files.
    ldis: Option<PathBuf>,
}

impl House {
    /// Finds what is in the way in an interior.
    pub fn new(interior: Interior, contents: Contents, model: Model) -> Self {
        let obstacles = Obstacles::new(&interior, &contents, &model);
        let mut house = Self {
            interior,
            contents,
            model,
            obstacles,
            standing: Vec::new(),
            cameras: Vec::new(),
            photos: Mutex::new(None),
            ldis: None,
        };
        let ids = (0..house.interior.cells.len() as u32).map(CellId);
        house.standing = ids.map(|id| house.standing_in(id)).collect();
        house
    }

    fn standing_in(&self, id: CellId) -> Option<DVec3> {
        let (interior, contents) = (&self.interior, &self.contents);
        let middle = middle_of(self, id)?;
        self.obstacles
            .standing_near(interior, contents, &self.model, id, middle)
    }

    /// The same, with layered depth images in a folder: those that a walk with the window's options would make.
    pub fn with_ldis(mut self, folder: PathBuf) -> Self {
        self.ldis = Some(folder);
        self
    }

    /// The folder of its layered depth images.
    pub(crate) fn ldis(&self) -> Option<&Path> {
        self.ldis.as_deref()
    }

    /// The same, drawn from photos. `make` gives what draws it, and may add to the model and its
    /// contents what is in nobody's way: a backdrop.
    ///
    /// # Errors
    /// What `make` says.
    pub fn with_photos<E>(
        mut self,
        make: impl FnOnce(&Interior, &mut Contents, &mut Model) -> Result<Painter, E>,
    ) -> Result<Self, E> {
        let painter = make(&self.interior, &mut self.contents, &mut self.model)?;
        if let Some(captured) = painter.captured() {
            let sources = captured.lumigraph().sources.iter();
            self.cameras = sources.map(Stop::of).collect();
        }
        self.photos = Mutex::new(Some(painter));
        Ok(self)
    }

    /// What draws it from photos, the first time.
    pub(crate) fn take_photos(&self) -> Option<Painter> {
        let mut photos = self.photos.lock().unwrap_or_else(PoisonError::into_inner);
        photos.take()
    }
}

/// A place to go to by name: a photo's camera, or where one can stand in a room, near its middle.
#[derive(Clone, Debug, PartialEq)]
pub struct Stop {
    /// For people.
    pub name: String,
    /// Where it is, and with which lens: of a photo the photo's own.
    pub view: View,
    /// The room that it shows, of an interior's.
    pub cell: Option<CellId>,
}

impl Stop {
    fn of(source: &SourceView) -> Self {
        Self {
            name: source.name.clone(),
            view: source.view.clone(),
            cell: None,
        }
    }
}

/// The times of a scene that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Times {
    /// At which it is shown first.
    pub moment: Moment,
    /// From the first photo to the last, in seconds.
    pub range_s: [f64; 2],
}

impl Times {
    /// A scene's, shown first at `moment`; `None` where no photo has a time.
    pub fn of(lumigraph: &Lumigraph, moment: Moment) -> Option<Self> {
        let times = lumigraph.sources.iter().filter_map(|s| s.time_s);
        let range = times.fold(None, |range: Option<[f64; 2]>, t| {
            let [first, last] = range.unwrap_or([t, t]);
            Some([first.min(t), last.max(t)])
        });
        range.map(|range_s| Self { moment, range_s })
    }
}

/// What moving about needs to know of a content.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    /// Which way is up, in the world; unit length.
    pub up: DVec3,
    /// World units a second for who flies.
    pub speed: f64,
    /// How far away things are where nothing else says, in world units.
    pub depth: f64,
    /// Photos' cameras, or rooms.
    pub stops: Vec<Stop>,
    /// Cameras of photos that are no stops: those that show an interior.
    pub cameras: Vec<Stop>,
    /// Whether one walks in it.
    pub is_interior: bool,
    /// Where time plays a part.
    pub times: Option<Times>,
    /// The options that stand for what is still to be chosen as loading goes on, as `--proxy points`: what is drawn is as
    /// with these until then. Empty of what stays.
    pub meanwhile: String,
}

/// The tour's own camera; see `lumigraph walk`.
const ROOM_SIZE: (u32, u32) = (640, 512);
const ROOM_FOCAL: f64 = 0.7;

impl Space {
    /// What moving about in a content needs to know.
    pub fn of(content: &Content) -> Self {
        match content {
            Content::Scene(lumigraph) => Self::of_scene(lumigraph),
            Content::Interior(house) => Self::of_house(house),
        }
    }

    /// Of a scene.
    pub fn of_scene(lumigraph: &Lumigraph) -> Self {
        let views: Vec<&View> = lumigraph.sources.iter().map(|s| &s.view).collect();
        // Photos taken with the camera turned say no less which way is up.
        let shown = lumigraph.sources.iter().map(|s| (&s.view, s.quarters));
        let up = upright(&shown.collect::<Vec<_>>()).up;
        let count = views.len().max(1) as f64;
        let middle = views.iter().map(|v| v.center()).sum::<DVec3>() / count;
        let reach = |v: &&View| v.center().distance(middle);
        let extent = views.iter().map(reach).fold(0.0, f64::max);
        let depth =
            typical_depth(lumigraph).unwrap_or(if extent > 0.0 { 2.0 * extent } else { 1.0 });
        Self {
            up: up.unwrap_or(DVec3::NEG_Y),
            // What is looked at should be reached in some five seconds, the cameras' region
            // crossed in ten.
            speed: 0.2 * depth.min((2.0 * extent).max(0.2 * depth)),
            depth,
            stops: lumigraph.sources.iter().map(Stop::of).collect(),
            cameras: Vec::new(),
            is_interior: false,
            times: None,
            meanwhile: String::new(),
        }
    }

    fn of_house(house: &House) -> Self {
        let up = house.interior.up;
        let eye_height = house.interior.eye_height.abs().max(1e-9);
        let lens = room_lens();
        let (width, height) = ROOM_SIZE;
        let view = |camera_from_world: Rigid3| View {
            lens,
            width,
            height,
            camera_from_world,
        };
        // The first room is looked at on the way that the tour takes.
        let camera = Camera::of(&lens, width, height);
        let toured = Tour::new(
            &house.interior,
            &house.contents,
            &house.model,
            &camera,
            64,
            15.0,
        );
        let toured: Vec<Rigid3> = toured.map_or_else(
            |_| Vec::new(),
            |tour| {
                let frames = tour.path.frames.iter();
                frames.map(|frame| frame.view.camera_from_world).collect()
            },
        );
        let first = toured.first();
        let first_cell = first.and_then(|pose| {
            let eye = pose.center();
            house.contents.locate(&house.interior, eye)
        });
        let mut stops = Vec::new();
        for (i, cell) in house.interior.cells.iter().enumerate() {
            let id = CellId(i as u32);
            let stands = house.standing.get(i).copied().flatten();
            let pose = match first {
                Some(pose) if first_cell == Some(id) => {
                    let eye = stands.unwrap_or(pose.center());
                    // From where one stands it goes another way than from the middle.
                    let ways = toured.iter().map(|pose| pose.center() - eye);
                    let mut ways = ways.map(|way| way - up * way.dot(up));
                    let way = ways.find(|way| way.length() > eye_height);
                    let ahead = way.unwrap_or(pose.rotation.conjugate() * DVec3::Z);
                    Some(Rigid3::looking_at(eye, eye + ahead, up))
                }
                _ => stands.or_else(|| middle_of(house, id)).map(|eye| {
                    let ahead = way_out(house, id, eye, up);
                    Rigid3::looking_at(eye, eye + ahead, up)
                }),
            };
            if let Some(pose) = pose.filter(Rigid3::is_finite) {
                stops.push(Stop {
                    name: cell.name.clone(),
                    view: view(pose),
                    cell: Some(id),
                });
            }
        }
        if let Some(index) = first_cell.map(|id| &house.interior.cell(id).name) {
            let at = stops.iter().position(|s| s.name == *index);
            stops.rotate_left(at.unwrap_or(0));
        }
        if stops.is_empty() {
            let pose = Rigid3::looking_at(
                up * eye_height,
                up * eye_height + up.any_orthonormal_vector(),
                up,
            );
            stops.push(Stop {
                name: "the origin".to_owned(),
                view: view(pose),
                cell: None,
            });
        }
        Self {
            up,
            // A brisk walk: 1.6 m/s at eyes 1.6 m high.
            speed: eye_height,
            depth: 1.5 * eye_height,
            stops,
            cameras: house.cameras.clone(),
            is_interior: true,
            times: None,
            meanwhile: String::new(),
        }
    }
}

fn room_lens() -> Lens {
    let size = DVec2::new(f64::from(ROOM_SIZE.0), f64::from(ROOM_SIZE.1));
    Lens::pinhole(DVec2::splat(ROOM_FOCAL * size.x), 0.5 * size)
}

fn middle_of(house: &House, id: CellId) -> Option<DVec3> {
    let bounds = house.contents.bounds.get(id.0 as usize).copied().flatten();
    let floor = house.interior.cell(id).floor.as_ref().map(|f| f.center());
    let middle = floor.or_else(|| bounds.map(|b| b.min.midpoint(b.max)))?;
    Some(house.obstacles.at_eye_height(Some(id), middle))
}

/// From a place in a room towards one of its openings.
fn way_out(house: &House, id: CellId, eye: DVec3, up: DVec3) -> DVec3 {
    let portals = house.interior.portals_of(Some(id));
    let ways = portals.filter_map(|(_, portal)| {
        let way = portal.polygon.center() - eye;
        (way - up * way.dot(up)).try_normalize()
    });
    ways.into_iter()
        .next()
        .unwrap_or(up.any_orthonormal_vector())
}

/// The median depth of what photos see of the sparse points, or the distance to the proxy.
fn typical_depth(lumigraph: &Lumigraph) -> Option<f64> {
    let mut depths = Vec::new();
    // A sample will do.
    let step = (lumigraph.points.len() / 2000).max(1);
    for point in lumigraph.points.iter().step_by(step) {
        for i in &point.seen_by {
            if let Some(source) = lumigraph.sources.get(*i as usize) {
                depths.push(source.view.center().distance(point.position));
            }
        }
    }
    if depths.is_empty() {
        let ahead = |view: &View| -> Option<f64> {
            let (center, forward) = (view.center(), view.forward());
            match &lumigraph.proxy {
                Proxy::Plane(plane) => Some(plane.intersect(center, forward)?.distance(center)),
                Proxy::Mesh(solid) => Some(solid.first_hit(center, forward)?.along),
                _ => None,
            }
        };
        depths.extend(lumigraph.sources.iter().filter_map(|s| ahead(&s.view)));
    }
    depths.retain(|d| d.is_finite() && *d > 0.0);
    depths.sort_by(f64::total_cmp);
    depths.get(depths.len() / 2).copied()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use datasets::house::{HouseOptions, house};
    use image::RgbaImage;
    use proxy::{MeshKind, Plane, Solid};
    use render::PhotoStore;
    use std::f64::consts::TAU;

    /// A small house.
    pub(crate) fn two_rooms() -> Content {
        let options = HouseOptions {
            rooms: 2,
            triangles: Some(1),
            ..HouseOptions::default()
        };
        let made = house(&options).unwrap();
        let contents = Contents::new(&made.interior, &made.model).unwrap().0;
        Content::Interior(Arc::new(House::new(made.interior, contents, made.model)))
    }

    #[test]
    fn where_a_room_is_shown_from_one_stands_on_its_floor_and_walks() {
        let options = HouseOptions {
            rooms: 3,
            triangles: Some(1),
            ..HouseOptions::default()
        };
        let made = house(&options).unwrap();
        let solid = Solid::new(MeshKind::Mesh, made.model.mesh.clone());
        let contents = Contents::new(&made.interior, &made.model).unwrap().0;
        let house = House::new(made.interior, contents, made.model);
        let space = Space::of_house(&house);
        assert_eq!(space.stops.len(), 3);
        for stop in &space.stops {
            let (name, eye) = (&stop.name, stop.view.center());
            // Not over a table, as there is one in the middle of the first room.
            let asides = [DVec3::ZERO, DVec3::X, DVec3::Z, DVec3::NEG_X, DVec3::NEG_Z];
            for aside in asides {
                let below = solid.first_hit(eye + 0.15 * aside, DVec3::NEG_Y);
                let below = below.unwrap().along;
                assert!((1.5..1.61).contains(&below), "{name}: {below}");
            }
            let cell = house.contents.locate(&house.interior, eye);
            let walked = (0..8).map(|way| {
                let (sin, cos) = (0.05 + TAU * f64::from(way) / 8.0).sin_cos();
                let motion = 0.5 * DVec3::new(cos, 0.0, sin);
                house.obstacles.walk(cell, eye, motion).distance(eye)
            });
            let farthest = walked.fold(0.0, f64::max);
            assert!(farthest > 0.3, "{name}: {farthest}");
        }
    }

    #[test]
    fn up_is_where_most_photos_have_it() {
        let source = |i: i32| {
            let center = DVec3::X * f64::from(i);
            // The third was taken with the camera turned.
            let up = if i == 2 { DVec3::X } else { DVec3::NEG_Y };
            SourceView {
                name: i.to_string(),
                view: View {
                    lens: room_lens(),
                    width: ROOM_SIZE.0,
                    height: ROOM_SIZE.1,
                    camera_from_world: Rigid3::looking_at(center, center + DVec3::Z, up),
                },
                gain: [1.0; 3],
                time_s: None,
                quarters: 0,
            }
        };
        let lumigraph = Lumigraph {
            points: Vec::new(),
            sources: (0..5).map(source).collect(),
            photos: PhotoStore::from_images(vec![RgbaImage::new(8, 8); 5]),
            proxy: Proxy::Plane(Plane::new(4.0 * DVec3::Z, DVec3::Z).unwrap()),
            visibility: None,
        };
        let up = Space::of_scene(&lumigraph).up;
        assert!(up.distance(DVec3::NEG_Y) < 1e-12, "{up}");
    }
}
