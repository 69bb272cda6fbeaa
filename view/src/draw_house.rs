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
