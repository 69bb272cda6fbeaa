//! One door to those that draw triangles and layered depth images: the CPU, a graphics device, and the lumigraph
//! where photos show them.

use super::{Captured, DrawOptions, Met, Pinhole, Raster, Runs, Target, Window};
use crate::RenderError;
use crate::engine::DeviceChoice;
use crate::gpu::{DeviceLimits, GpuRaster, GpuWarp};
use crate::ldi::{Clipped, Free, FreeCost, FreeOptions, Layered, free};
use calibrate::View;
use proxy::mesh::Model;

/// Draws the geometry of cells. What a graphics device cannot draw the CPU draws.
#[derive(Debug, Default)]
pub struct Painter {
    gpu: Option<Box<GpuRaster>>,
    warp: Warper,
    loose: Free,
    raster: Raster,
    /// What the device drew of this frame; none where the CPU draws it.
    drawn: Option<Target>,
    /// What photos show of it.
    captured: Option<Box<Captured>>,
    notes: Vec<String>,
}

/// What draws LDIs where a device draws triangles.
#[derive(Debug, Default)]
enum Warper {
    /// None was to be drawn yet.
    #[default]
    Untried,
    Device(Box<GpuWarp>),
    Cpu,
}

impl Painter {
    /// Draws with the CPU.
    pub fn cpu() -> Self {
        Self::default()
    }

    /// Finds surfaces with the CPU and colours them from photos, as far as those show them.
    pub fn of_photos(captured: Captured) -> Self {
        Self {
            captured: Some(Box::new(captured)),
            ..Self::default()
        }
    }

    /// The photos that colour what is drawn, if any do.
    pub fn captured(&self) -> Option<&Captured> {
        self.captured.as_deref()
    }

    /// See [`Self::captured`].
    pub(super) fn captured_mut(&mut self) -> Option<&mut Captured> {
        self.captured.as_deref_mut()
    }

    /// Whether LDIs can be made of the photos' depth maps, which is found out anyway when the first is needed; a
    /// note says why not.
    pub fn check_depth_maps(&mut self) -> bool {
        let captured = self.captured.as_mut();
        captured.is_some_and(|captured| captured.depth_noise().is_some())
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
    pub fn description(&self) -> String {
        if let Some(captured) = &self.captured {
            let photos = captured.lumigraph().sources.len();
            return format!("{}, from {photos} photos", captured.engine().description());
        }
        let gpu = self.gpu.as_ref();
        gpu.map_or("CPU", |gpu| gpu.description()).to_owned()
    }

    /// What became of the graphics device, what it could not draw, and which photos were left out, for
    /// people; each once.
    pub fn notes(&self) -> Vec<&str> {
        let of_photos = self.captured.iter().flat_map(|captured| captured.notes());
        self.notes
            .iter()
            .chain(of_photos)
            .map(String::as_str)
            .collect()
    }

    /// See [`GpuRaster::lose`].
    pub fn lose(&mut self) {
        if let Some(gpu) = &mut self.gpu {
            gpu.lose();
        }
    }

    /// Finds what each pixel sees of some triangles, in windows. With a floor, the CPU passes over
    /// those that are hidden by others, or, where there is one, by what is seen before it: of some
    /// pixels the inverse depth behind which nothing is wanted.
    pub(super) fn meet(
        &mut self,
        model: &Model,
        parts: &[(Runs<'_>, Window)],
        camera: &Pinhole,
        floor: Option<&[f32]>,
    ) -> Met {
        if let Some(gpu) = &mut self.gpu {
            let mut drawn = self.drawn.take().unwrap_or_default();
            match gpu.draw(model, parts, camera, &mut drawn) {
                Ok(()) => {
                    self.drawn = Some(drawn);
                    return Met {
                        tried: parts.iter().map(|(runs, _)| runs.count()).sum(),
                        touching: None,
                    };
                }
                Err(error) => {
                    let is_lost = gpu.is_lost();
                    let rest = if is_lost {
                        "the CPU goes on"
                    } else {
                        "the CPU draws such frames"
                    };
                    self.note(format!("{error}; {rest}"));
                    if is_lost {
                        (self.gpu, self.warp) = (None, Warper::Cpu);
                    }
                }
            }
        }
        self.drawn = None;
        self.raster.clear_to(camera, floor.unwrap_or_default());
        let options = DrawOptions {
            all: floor.is_none(),
            ..DrawOptions::default()
        };
        self.raster.draw(parts, camera, &options)
    }

    /// Draws what is left of an LDI, in a window, in any order: see [`free`].
    pub(super) fn free(
        &mut self,
        (ldi, columns): (&Layered, &Clipped),
        camera: &Pinhole,
        window: &Window,
        options: &FreeOptions,
        into: &mut Target,
    ) -> FreeCost {
        if let Some(warp) = self.warp() {
            match warp.free(ldi, columns, camera, window, options, into) {
                Ok(cost) => return cost,
                Err(error) => self.note(format!("{error}; the CPU draws such images")),
            }
        }
        let scratch = &mut self.loose;
        free(ldi, columns, camera, window, options, scratch, into)
    }

    /// What draws LDIs on the graphics device, if there is one.
    fn warp(&mut self) -> Option<&mut GpuWarp> {
        let gpu = self.gpu.as_ref()?;
        if let Warper::Untried = self.warp {
            self.warp = match gpu.warp() {
                Ok(warp) => Warper::Device(Box::new(warp)),
                Err(error) => {
                    self.note(format!("{error}; the CPU draws layered depth images"));
                    Warper::Cpu
                }
            };
        }
        match &mut self.warp {
            Warper::Device(warp) => Some(warp),
            _ => None,
        }
    }

    fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// The inverse depth of what a pixel sees, if it sees anything.
    pub(super) fn inverse_depth(&self, pixel: usize) -> Option<f32> {
        match &self.drawn {
            Some(drawn) => Some(drawn.inverse_depth[pixel]).filter(|s| *s > 0.0),
            None => self.raster.at(pixel).map(|(_, s)| s),
        }
    }

    /// Colours what was met, but for pixels that `is_wanted` declines.
    ///
    /// # Errors
    /// See [`Captured::shade`]; none without photos.
    pub(super) fn shade(
        &mut self,
        model: &Model,
        view: &View,
        camera: &Pinhole,
        target: &mut Target,
        is_wanted: impl Fn(usize, f32) -> bool + Sync,
    ) -> Result<(), RenderError> {
        if let Some(captured) = &mut self.captured {
            return captured.shade(model, &self.raster, view, camera, target, is_wanted);
        }
        let Some(drawn) = &self.drawn else {
            self.raster.shade(model, camera, target, is_wanted);
            return Ok(());
        };
        for (pixel, s) in drawn.inverse_depth.iter().enumerate() {
            if *s > 0.0 && is_wanted(pixel, *s) {
                target.color[pixel] = drawn.color[pixel];
                target.inverse_depth[pixel] = *s;
            }
        }
        Ok(())
    }
}
