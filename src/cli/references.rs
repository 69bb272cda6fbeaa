//! How images and LDIs before an interior's portals are made, for all that make them.

use super::Usage;
use super::exposure::ExposureArgs;
use super::options::{bytes, size};
use super::output::say;
use super::took::megabytes;
use super::unused::note_of_ldi_views;
use clap::ValueEnum;
use render::DeviceChoice;
use render::interior::{CAPTURED_REFERENCE_SIZE, LdiSource, LibraryOptions, Painter};

/// What decides what images and LDIs before portals show.
#[derive(clap::Args)]
pub(super) struct ReferenceArgs {
    /// Size of the reference images before portals [default: 256x256; of a capture's rooms 512x512]
    #[arg(long, value_name = "WxH", value_parser = size)]
    reference_size: Option<(u32, u32)>,
    /// Reference images before each side of a portal: an odd number
    #[arg(long, value_name = "N", default_value_t = 13)]
    reference_views: usize,
    /// What LDIs of a capture's rooms are made of: its photos with depth maps themselves, wherever they
    /// were taken (views where none sees the portal), or views that photos are blended into
    /// [default: photos]
    #[arg(long, value_enum, value_name = "WHAT")]
    ldi_from: Option<LdiFrom>,
    /// Make LDIs of views of the N views nearest to the viewer, and the middle one; a walk makes what has no file
    /// ahead of need, by a thread of low priority; frames go from one to the next by where they are drawn from, so
    /// they are the same in whatever order [default: all views make one]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=999))]
    ldi_views: Option<u16>,
    /// Draw the model's own colours, not the photos of a capture's rooms
    #[arg(long)]
    pub(super) no_photos: bool,
    #[command(flatten)]
    pub(super) exposure: ExposureArgs,
    /// What draws geometry, and a capture's photos; auto is the graphics processor if there is one, else the
    /// CPU
    #[arg(long, value_enum, default_value = "auto")]
    device: Device,
    /// Keep reference images within so many bytes (512MiB, 1.5GB) between frames, and decoded photos,
    /// too; those not used for longest are made again when they are needed [default: no limit for images,
    /// half of the machine's memory for photos]
    #[arg(long, value_name = "SIZE", value_parser = bytes, allow_hyphen_values = true)]
    pub(super) cpu_memory: Option<u64>,
}

#[derive(Clone, Copy, ValueEnum)]
enum LdiFrom {
    Views,
    Photos,
}

#[derive(Clone, Copy, ValueEnum)]
enum Device {
    Auto,
    Gpu,
    Cpu,
}

impl ReferenceArgs {
    /// Refuses what makes no sense whatever the interior.
    pub(super) fn check(&self) -> Result<(), Usage> {
        let views = self.reference_views;
        if views.is_multiple_of(2) || views > 999 {
            return Err(Usage(format!(
                "--reference-views is {views}; expected an odd number up to 999"
            )));
        }
        if self.reference_size.is_some_and(|(w, h)| w.max(h) > 4096) {
            let text = "--reference-size: expected sides of up to 4096";
            return Err(Usage(text.to_owned()));
        }
        if self.no_photos && matches!(self.ldi_from, Some(LdiFrom::Photos)) {
            let text = "--ldi-from photos: with --no-photos there are none; leave out one of them";
            return Err(Usage(text.to_owned()));
        }
        Ok(())
    }

    pub(super) fn device(&self) -> DeviceChoice {
        match self.device {
            Device::Auto => DeviceChoice::Auto,
            Device::Gpu => DeviceChoice::Gpu,
            Device::Cpu => DeviceChoice::Cpu,
        }
    }

    /// Says so where `--ldi-views` was given for nothing, as LDIs are made of the photos of a painter.
    pub(super) fn say_unused_views(&self, options: &LibraryOptions, painter: &Painter) {
        if let Some(note) = note_of_ldi_views(options, painter) {
            say!("note: {note} (--ldi-from views)");
        }
    }

    /// As a library of images takes them, of rooms that photos show or of others.
    pub(super) fn options(&self, has_photos: bool) -> LibraryOptions {
        let mut options = LibraryOptions {
            ldi_views: self.ldi_views.map(usize::from),
            budget: self.cpu_memory,
            ldi_of: match self.ldi_from.unwrap_or(LdiFrom::Photos) {
                LdiFrom::Views => LdiSource::Views,
                LdiFrom::Photos => LdiSource::Photos,
            },
            ..LibraryOptions::default()
        };
        options.semicircles.views = self.reference_views;
        options.size = match self.reference_size {
            Some(size) => size.into(),
            None if has_photos && !self.no_photos => CAPTURED_REFERENCE_SIZE,
            None => options.size,
        };
        options
    }
}

/// To be asked before LDIs are made: whether they can be of photos, which a note of the painter's says where
/// they were to be, and what is to be said of the memory that it takes if they are of views.
pub(super) fn before_ldis(options: &LibraryOptions, painter: &mut Painter) -> Option<String> {
    let options = options.with_photos(painter.captured());
    let of_photos = options.ldi_of == LdiSource::Photos && painter.check_depth_maps();
    let (needed, budget) = (options.making_bytes(), options.budget?);
    let [width, height] = options.size;
    (!of_photos && needed > budget).then(|| {
        format!(
            "making a layered depth image of {} views of {width} × {height} pixels may take {}, more than \
             --cpu-memory {}; a smaller --reference-size takes less, and so do fewer --reference-views",
            options.views_of_ldi(),
            megabytes(needed),
            megabytes(budget)
        )
    })
}
