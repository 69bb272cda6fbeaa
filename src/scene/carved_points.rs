//! Points as far as they lie on the surface that is carved out of them: the others are contradicted
//! by lines of sight.

use super::SceneError;
use super::fit::{FEWEST_POINTS, Fitted, unfit};
use calibrate::View;
use proxy::carve::{self, CarveError};
use proxy::dense::DensePoints;
use proxy::{Mesh, MeshKind, Proxy, Solid, SparsePoint};
use std::sync::Arc;

/// Points, and the surface carved out of them.
pub(super) struct CarvedPoints {
    /// Those that lie on the surface; all where there is none.
    pub(super) points: Vec<SparsePoint>,
    /// How many of them are sparse ones; they come first.
    sparse: usize,
    mesh: Result<Mesh, CarveError>,
    /// What people should know of where they come from, if anything.
    note: Option<String>,
}

/// Carving more points than this takes longer than a first picture may.
const MOST_CARVED: usize = 50_000;

/// Those of sparse points, as these views see them, that lie on the surface carved out of them. Of
/// very many, all.
pub(super) fn on_surface(views: &[View], points: Vec<SparsePoint>) -> Vec<SparsePoint> {
    if points.len() > MOST_CARVED {
        return points;
    }
    let count = points.len();
    CarvedPoints::new(views, points, count).points
}

impl CarvedPoints {
    /// Of points as these views see them, so many of which, the first, are the sparse ones.
    pub(super) fn new(views: &[View], mut points: Vec<SparsePoint>, mut sparse: usize) -> Self {
        let options = carve::Options {
            // Of too few, those that were found have to say.
            shell_points: if sparse >= FEWEST_POINTS {
                sparse
            } else {
                usize::MAX
            },
            ..carve::Options::default()
        };
        let surface = carve::surface(views, &points, &options);
        let mesh = surface.map(|surface| {
            let is_on = surface.on_surface;
            sparse = is_on[..sparse].iter().filter(|on| **on).count();
            let mut is_on = is_on.iter();
            points.retain(|_| is_on.next() == Some(&true));
            surface.mesh
        });
        Self {
            points,
            sparse,
            mesh,
            note: None,
        }
    }

    /// The same of all photos of a scene.
    ///
    /// # Errors
    /// There are too few for any surface.
    pub(super) fn of_all(
        views: &[View],
        points: Vec<SparsePoint>,
        sparse: usize,
    ) -> Result<Self, SceneError> {
        let count = points.len();
        if count < FEWEST_POINTS {
            return Err(unfit(format!(
                "sparse points and what photos agree on are {count} points, too few for a surface; \
                 try plane"
            )));
        }
        Ok(Self::new(views, points, sparse))
    }

    /// The same, with something to say of where they come from.
    pub(super) fn with_note(self, note: Option<String>) -> Self {
        Self { note, ..self }
    }

    /// The points, of named views.
    pub(super) fn dense(self, names: Vec<String>, within: Option<Arc<Solid>>) -> Fitted {
        let (how, note) = (self.count(), self.note);
        let dense = DensePoints {
            names,
            points: self.points,
            within,
        };
        let fitted = Fitted::new(Proxy::Dense(Arc::new(dense)), how);
        Fitted { note, ..fitted }
    }

    /// The surface, within a hull if there is one.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn surface(self, within: Option<Arc<Solid>>) -> Result<Fitted, SceneError> {
        let how = format!("carved through {}", self.count());
        let mesh = self.mesh.map_err(unfit)?;
        let fitted = Fitted::mesh_within(MeshKind::CarvedDense, mesh, within, how);
        let note = self.note;
        Ok(Fitted { note, ..fitted })
    }

    /// The same, to be drawn once.
    ///
    /// # Errors
    /// There is none.
    pub(super) fn solid(&self) -> Result<Solid, SceneError> {
        let mesh = self.mesh.clone().map_err(unfit)?;
        Ok(Solid::new(MeshKind::CarvedDense, mesh))
    }

    fn count(&self) -> String {
        let count = self.points.len();
        let found = count - self.sparse;
        if self.sparse == 0 {
            return format!("{count} points that photos agree on");
        }
        format!("{count} points, {found} of them found between the sparse ones")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use calibrate::{Lens, Rigid3};
    use glam::{DVec2, DVec3};

    #[test]
    fn points_before_the_wall_that_views_see_behind_them_go() {
        // 1. A wall, seen by a row of cameras, and two points that float before it: one photo has
        // mistaken something for them.
        let view = |x: f64| View {
            lens: Lens::pinhole(DVec2::splat(100.0), DVec2::new(80.0, 60.0)),
            width: 160,
            height: 120,
            camera_from_world: Rigid3::looking_at(DVec3::X * x, DVec3::new(x, 0.0, 10.0), DVec3::Y),
        };
        let views: Vec<View> = (0..5).map(|i| view(f64::from(i) - 2.0)).collect();
        let all: Vec<u32> = (0..5).collect();
        let on_wall = |i: i32| SparsePoint {
            position: DVec3::new(
                0.4 * f64::from(i % 15 - 7),
                0.4 * f64::from(i / 15 - 7),
                10.0,
            ),
            seen_by: all.clone(),
        };
        let mut points: Vec<SparsePoint> = (0..225).map(on_wall).collect();
        let floating = [DVec3::new(0.3, 0.1, 5.0), DVec3::new(-0.5, 0.2, 4.0)];
        points.extend(floating.map(|position| SparsePoint {
            position,
            seen_by: vec![2],
        }));
        // 2. The wall stays, in order.
        let kept = on_surface(&views, points.clone());
        assert_eq!(kept, points[..225]);
        // 3. Where nothing can be carved all stay.
        assert_eq!(on_surface(&[], points.clone()), points);
    }
}
