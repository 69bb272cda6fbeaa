//! Drawing an interior for the window, as `walk` would.

use crate::compose::{depth_picture, over_background};
use crate::content::House;
use crate::draw_scene::{Drawn, timed};
use crate::picture::{DepthGrid, Layer, Lines, Request, Shown};
use calibrate::Pixel;
use image::RgbaImage;
use render::interior::{Walk, WalkError};
use std::sync::Arc;

/// Draws what is asked for, `reduction` times smaller.
///
/// # Errors
/// As [`Walk::draw`].
pub(crate) fn draw_house(
    house: &House,
    walk: &mut Walk<'_>,
    request: &Request,
    reduction: u32,
) -> Result<Drawn, WalkError> {
    let (asked, look) = (&request.view, &request.look);
    let view = match reduction {
        1 => asked.clone(),
        _ => asked.resized(
            asked.width.div_ceil(reduction),
            asked.height.div_ceil(reduction),
        ),
    };
    let cost = walk.draw(&view, look.portals)?;
    let ms = |time: std::time::Duration| 1e3 * time.as_secs_f64();
    let mut stages = vec![
        ("visibility", ms(cost.visibility)),
        ("geometry", ms(cost.geometry)),
        ("portals", ms(cost.fill)),
        ("shade", ms(cost.shade)),
        ("images made", ms(cost.references)),
    ];
    let target = walk.picture();
    let picture: RgbaImage = match look.layer {
        Layer::Depth => {
            let depths: Vec<f64> = target.inverse_depth.iter().map(|s| f64::from(*s)).collect();
            depth_picture(view.width, view.height, &depths)
        }
        _ => target.picture(),
    };
    let width = target.width as usize;
    let depths = DepthGrid::new(view.width, view.height, |p: Pixel| {
        let (x, y) = (p.x as usize, p.y as usize);
        target
            .inverse_depth
            .get(y * width + x.min(width - 1))
            .map(|s| f64::from(*s))
    });
    let image = timed(&mut stages, "compose", || over_background(&picture, look));
    let skipped = format!(
        "{} of {} cells visible, {} of their {} triangles tried, {} samples clipped",
        cost.visible_cells,
        house.interior.cells.len(),
        cost.triangles_tried,
        cost.triangles_in_cells,
        cost.samples_clipped
    );
    let shown = Shown {
        id: request.id,
        view: asked.clone(),
        reduction,
        image: Arc::new(image),
        photo: None,
        lines: Lines::default(),
        mesh: Arc::default(),
        depths,
        support: None,
        hover: None,
        cell: cost.cell.map(|id| id.0 as usize),
        stages,
        skipped,
        device: walk.painter().description().to_owned(),
        revision: 0,
    };
    Ok((picture, shown))
}

#[cfg(test)]
mod tests {
    use crate::content::{Content, House, Space};
    use crate::picture::{Look, Request};
    use crate::worker::{News, Worker, WorkerOptions};
    use calibrate::{Lens, View};
    use datasets::house::{HouseOptions, house};
    use glam::DVec2;
    use proxy::interior::{Contents, semicircles};
    use render::DeviceChoice;
    use render::interior::{Library, PortalFill, WalkOptions};
    use std::sync::Arc;
    use std::sync::mpsc::channel;
    use std::time::Duration;

    #[test]
    fn layered_images_come_from_the_houses_folder() {
        let made = house(&HouseOptions {
            rooms: 2,
            triangles: Some(1),
            ..HouseOptions::default()
        });
        let made = made.unwrap();
        let contents = Contents::new(&made.interior, &made.model).unwrap().0;
        let folder = tempfile::tempdir().unwrap();
        let mut walk = WalkOptions::default();
        walk.library.size = [16; 2];
        // Files that are none, so that one sees whether they are read.
        let library = Library::new(&made.interior, &contents, &walk.library);
        for place in library.ldi_places() {
            let name = library.file_name(place, &made.interior);
            std::fs::write(folder.path().join(name), "nothing").unwrap();
        }
        let mut places =
            semicircles(&made.interior, &contents, &walk.library.semicircles).into_iter();
        let place = places.find(|p| p.is_inside && p.from.is_some()).unwrap();
        let view = View {
            lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(20.0, 15.0)),
            width: 40,
            height: 30,
            camera_from_world: place.camera_from_world,
        };
        for has_files in [false, true] {
            let (send, news) = channel();
            let options = WorkerOptions {
                device: DeviceChoice::Cpu,
                gpu_memory: None,
                skips: render::Skips::ALL,
                walk,
                output: folder.path().join("shots"),
            };
            let mut worker = Worker::start(options, move |news| send.send(news).unwrap());
            let (interior, model) = (made.interior.clone(), made.model.clone());
            let mut house = House::new(interior, contents.clone(), model);
            if has_files {
                house = house.with_ldis(folder.path().to_owned());
            }
            let content = Content::Interior(Arc::new(house));
            let space = Arc::new(Space::of(&content));
            worker.show(content, space, 1);
            worker.ask(Request {
                id: 1,
                view: view.clone(),
                look: Look {
                    portals: PortalFill::Ldi,
                    ..Look::default()
                },
                is_moving: false,
                hover: None,
            });
            match news.recv_timeout(Duration::from_secs(60)).unwrap() {
                News::Shown(shown) => assert!(!has_files && shown.cell.is_some()),
                News::Trouble(said) => assert!(
                    has_files && said.contains(".ldi: no LDI: it does not begin"),
                    "{said}"
                ),
                News::Shot(_) => panic!("nobody asked for a shot"),
            }
            worker.end(Duration::from_secs(10));
        }
    }
}
