//! Procedural scenes ray-traced with exact colour, depth and pose.
//!
//! A dataset is a scene, the posed cameras that photograph it and what structure from
//! motion would have left: a COLMAP model, here without error. [`write()`] puts it on disk
//! as the folder a user would have, with the truth beside it.
//!
//! | name | scene | cameras | good for |
//! |---|---|---|---|
//! | `shelf` | a still life on a sideboard: glazed vase, globe, books, toys, pictures on the wall; soft shadows, highlights and mirror images that move with the viewer | 20 hand-held views in a 5 × 4 grid, neighbours 5 % of the distance apart, 480 × 360, SIMPLE_RADIAL with k = −0.05 | demonstrations: depth within 15 % of its mean, so a plane is a fair proxy |
//! | `helicopter` | a toy helicopter on a paved yard, its rotor and the rotor's shadow turning once in 1.37 s | 96 hand-held views, five a second, to and fro along an arc of 27°, 480 × 360, SIMPLE_PINHOLE | motion that repeats: photos have times, and few show any one moment |
//! | `car` | a toy car and nothing else, on no ground | 36 views on a perfect circle that look inwards, 10° apart and 17° above, 640 × 480, SIMPLE_PINHOLE; alpha is the part of a pixel that the car covers | visual hulls: exact silhouettes, exact geometry ([`Scene::distance_to`]), wheel arches that no silhouette shows |
//! | `wall` | one brick plane in a general position, no highlights | 9 views from general positions, the last one much closer, 480 × 360, PINHOLE | tests: a plane proxy is the exact truth, every difference is the renderer's |
//! | `knick-knacks` | small things in rows on a table, close by: chess pieces, a bird cage, pencils, an arch of blocks, books | 25 hand-held views in a 5 × 5 grid, neighbours 7 % of the distance apart, 480 × 360, SIMPLE_RADIAL with k = −0.05 | depths from one to three with gaps in front of things behind: no plane is fair (Buehler et al. 2001, Knick-knacks) |
//! | `hallway` | a hallway 14 m long: doors, pictures, cabinets, lamps | 28 views walking down it, looking ahead, 480 × 360, SIMPLE_PINHOLE | epipoles in the image, near and far views of the same wall: resolution counts (Figure 10); a tunnel is a fair proxy, and [`HALLWAY`] the true one |
//!
//! [`house`] is another kind of dataset: no photos but an interior of many rooms, its model and
//! its portals, and the truth for any camera in it. [`survey()`] photographs it, or the model of
//! any other interior, as a capture with depth.
//!
//! ```
//! use datasets::{Options, by_name, render_view};
//!
//! let options = Options { size: Some((80, 60)), views: Some(4), ..Options::default() };
//! let dataset = by_name("wall", &options).unwrap();
//! let photo = render_view(&dataset.scene, &dataset.photos[0].view, 1);
//! assert_eq!(photo.dimensions(), (80, 60));
//! assert!(datasets::names().contains(&"shelf"));
//! ```

mod car;
mod dataset;
mod hallway;
mod hand_held;
mod helicopter;
pub mod house;
mod knick_knacks;
mod model_picture;
mod motion;
mod noise;
mod picture;
mod points;
mod print;
mod props;
mod scene;
mod shading;
mod shape;
mod shelf;
mod survey;
mod texture;
mod wall;
mod write;

pub use car::car;
pub use dataset::{Dataset, DatasetError, Options, Photo, by_name, names};
pub use hallway::{HALLWAY, Room, hallway};
pub use helicopter::helicopter;
pub use knick_knacks::knick_knacks;
pub use motion::Motion;
pub use picture::{render_depth, render_view, srgb_from_linear};
pub use scene::{Finish, Hit, Lighting, Material, Object, Scene};
pub use shape::{Shape, Surface};
pub use shelf::shelf;
pub use survey::{Survey, survey, write_survey};
pub use texture::{Motif, Texture};
pub use wall::wall;
pub use write::{DEPTH_STEPS_PER_UNIT, Written, check_free, files, in_new_folder, write};
