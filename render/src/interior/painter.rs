//! One door to the two that draw triangles: the CPU's raster and a graphics device.

use super::{Pinhole, Raster, Runs, Target, Window};
use crate::engine::DeviceChoice;
use crate::gpu::{DeviceLimits, GpuRaster};
use proxy::mesh::Model;

/// Draws the geometry of cells. What a graphics device cannot draw the CPU draws.
#[derive(Debug, Default)]
pub struct Painter {
    gpu: Option<Box<GpuRaster>>,
    raster: Raster,
    /// What the device drew of this frame; none where the CPU draws it.
    drawn: Option<Target>,
    notes: Vec<String>,
}

impl Painter {
    /// Draws with the CPU.
    pub fn cpu() -> Self {
        Self::default()
    }

    /// Brings a model to a graphics device: with [`DeviceChoice::Auto`] to a real one only. Where
    /// that cannot be, the CPU draws, and a note says why; with `Auto` none does where there is
    /// no real device.
    pub fn open(choice: DeviceChoice, model: &Model) -> Self {
        Self::open_within(choice, model, &DeviceLimits::default())
    }

    /// As [`Self::open`], with tighter limits than the device's own.
    pub fn open_within(choice: DeviceChoice, model: &Model, asked: &DeviceLimits) -> Self {
        let real = match choice {
            DeviceChoice::Auto => true,
            DeviceChoice::Gpu => false,
            DeviceChoice::Cpu | DeviceChoice::Reference => return Self::cpu(),
        };
        let mut painter = Self::cpu();
        match GpuRaster::open(model, asked, real) {
            Ok(gpu) => painter.gpu = Some(Box::new(gpu)),
            Err(_) if real && !GpuRaster::is_there(asked, real) => {}
            Err(error) => painter
                .notes
                .push(format!("{error}; the CPU draws the walk")),
        }
        painter
    }

    /// What it draws with, for people.
    pub fn description(&self) -> &str {
        self.gpu.as_ref().map_or("CPU", |gpu| gpu.description())
    }

    /// What became of the graphics device and what it could not draw, for people; each once.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// See [`GpuRaster::lose`].
    pub fn lose(&mut self) {
        if let Some(gpu) = &mut self.gpu {
            gpu.lose();
        }
    }

    /// Finds what each pixel sees of some triangles, in windows. How many of them touch a pixel's
    /// centre, where the CPU drew them.
    pub(super) fn meet(
        &mut self,
        model: &Model,
        parts: &[(Runs<'_>, Window)],
        camera: &Pinhole,
    ) -> Option<usize> {
        if let Some(gpu) = &mut self.gpu {
            let mut drawn = self.drawn.take().unwrap_or_default();
            match gpu.draw(model, parts, camera, &mut drawn) {
                Ok(()) => {
                    self.drawn = Some(drawn);
                    return None;
                }
                Err(error) => {
                    let is_lost = gpu.is_lost();
                    let rest = if is_lost {
                        "the CPU goes on"
                    } else {
                        "the CPU draws such frames"
                    };
                    let note = format!("{error}; {rest}");
                    if !self.notes.contains(&note) {
                        self.notes.push(note);
                    }
                    if is_lost {
                        self.gpu = None;
                    }
                }
            }
        }
        self.drawn = None;
        self.raster.clear(camera);
        let draw = |(runs, window): &(Runs<'_>, Window)| {
            self.raster.draw(model, &runs.lists, camera, window, None)
        };
        Some(parts.iter().map(draw).sum())
    }

    /// The inverse depth of what a pixel sees, if it sees anything.
    pub(super) fn inverse_depth(&self, pixel: usize) -> Option<f32> {
        match &self.drawn {
            Some(drawn) => Some(drawn.inverse_depth[pixel]).filter(|s| *s > 0.0),
            None => self.raster.at(pixel).map(|(_, s)| s),
        }
    }

    /// Colours what was met, but for pixels that `is_wanted` declines.
    pub(super) fn shade(
        &self,
        model: &Model,
        camera: &Pinhole,
        target: &mut Target,
        is_wanted: impl Fn(usize, f32) -> bool + Sync,
    ) {
        let Some(drawn) = &self.drawn else {
            self.raster.shade(model, camera, target, is_wanted);
            return;
        };
        for (pixel, s) in drawn.inverse_depth.iter().enumerate() {
            if *s > 0.0 && is_wanted(pixel, *s) {
                target.color[pixel] = drawn.color[pixel];
                target.inverse_depth[pixel] = *s;
            }
        }
    }
}
