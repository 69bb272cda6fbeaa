//! Whether what the engines compute in f32 stays within the bounds that follow from its rounding.

use super::Case;
use super::scene::Placement;
use crate::bench::made_up::{Surroundings, desired, lumigraph};
use crate::bench::{Random, median};
use image::RgbaImage;
use render::gpu::Gpu;
use render::rounding::{Bounds, Fragment, fragments};
use render::{FieldOptions, Frame, Method, RenderError, cpu};

/// Pixels that are looked at, of bounds on them and of how far off engines are: in steps of 255, of
/// colours on black.
#[derive(Clone, Debug, Default)]
pub struct Rounding {
    /// How many pixels at which there is something to see.
    pub fragments: usize,
    /// Of how many scenes.
    pub scenes: usize,
    /// What was not within its bound, with figures.
    pub beyond: Vec<String>,
    /// How far from the reference the CPU's f32 may be.
    pub bounds: Vec<f64>,
    /// How far it is.
    pub observed: Vec<f64>,
    /// How far a graphics device's may be.
    pub gpu_bounds: Vec<f64>,
    /// Pixels that one drew, and which were looked at.
    pub gpu_fragments: usize,
}

/// Pixels of a scene that are looked at.
const OF_A_SCENE: usize = 80;
/// A pixel's byte is the nearest to a colour, or either beside one in the middle.
const TO_BYTES: f64 = 0.501;

impl Rounding {
    /// Looks at pixels of the scene of a number: of every four in a row, three are made to break things
    /// and one is as photos are.
    ///
    /// # Errors
    /// It cannot be drawn.
    pub fn look_at(&mut self, seed: u64, gpu: Option<&mut Gpu>) -> Result<(), RenderError> {
        let (name, lumigraph, view) = match seed % 4 {
            3 => usual(seed),
            _ => {
                let case = Case::new(seed, &Placement::OWN);
                (case.name, case.lumigraph, case.desired)
            }
        };
        let frame = Frame::new(&lumigraph, view, FieldOptions::default());
        let mut random = Random(seed ^ 0xf32);
        let (width, height) = (frame.desired.width, frame.desired.height);
        let mut below = |side: u32| random.below(side as usize) as u32;
        let pixels: Vec<(u32, u32)> = (0..OF_A_SCENE)
            .map(|_| (below(width), below(height)))
            .collect();
        let found = fragments(&frame, &pixels)?;
        let by_cpu = cpu::render(&frame, Method::Exact)?;
        let by_gpu = gpu
            .map(|gpu| gpu.render(&frame, Method::Exact))
            .transpose()?;
        let name = format!("{seed}: {name}");
        for fragment in &found {
            self.note(&name, fragment, &by_cpu, by_gpu.as_ref());
        }
        self.scenes += 1;
        Ok(())
    }

    fn note(
        &mut self,
        name: &str,
        fragment: &Fragment,
        by_cpu: &RgbaImage,
        by_gpu: Option<&RgbaImage>,
    ) {
        let bounds = &fragment.cpu_bounds;
        let (x, y) = fragment.pixel;
        let mut expect = |what: &str, color: [f64; 4], bounds: &Bounds, room: f64| {
            let is_within = |(v, [lo, hi]): (&f64, &[f64; 2])| *v >= lo - room && *v <= hi + room;
            if !color.iter().zip(bounds).all(is_within) {
                let text = format!("{name}, pixel {x}, {y}: {what} {color:?} not in {bounds:?}");
                self.beyond.push(text);
            }
        };
        expect("the reference's", fragment.exact, bounds, 0.0);
        expect("the CPU's", fragment.cpu, bounds, 0.0);
        // Colours on black are rounded twice.
        let in_bytes = |picture: &RgbaImage| {
            let [r, g, b, alpha] = picture.get_pixel(x, y).0.map(f64::from);
            [r, g, b, 255.0].map(|v| v * alpha / 255.0)
        };
        expect("the CPU's byte", in_bytes(by_cpu), bounds, 2.0 * TO_BYTES);
        if let Some(picture) = by_gpu {
            let bounds = &fragment.gpu_bounds;
            expect(
                "the device's byte",
                in_bytes(picture),
                bounds,
                2.0 * TO_BYTES,
            );
            self.gpu_fragments += usize::from(fragment.gpu_bounds.iter().any(|[_, hi]| *hi > 0.0));
        }
        let apart = |bounds: &Bounds| {
            let each = bounds.iter().zip(fragment.exact);
            each.map(|([lo, hi], v)| (hi - v).max(v - lo))
                .fold(0.0, f64::max)
        };
        let observed = fragment.cpu.iter().zip(fragment.exact);
        let observed = observed.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        if apart(&fragment.gpu_bounds) == 0.0 {
            // Nothing is there, whoever draws.
            return;
        }
        self.fragments += 1;
        self.bounds.push(apart(bounds));
        self.observed.push(observed);
        self.gpu_bounds.push(apart(&fragment.gpu_bounds));
    }

    /// What was observed over its bound, where there is something to see.
    pub fn shares(&self) -> Vec<f64> {
        let both = self.observed.iter().zip(&self.bounds);
        let seen = both.filter(|(_, bound)| **bound > 0.0);
        seen.map(|(observed, bound)| observed / bound).collect()
    }

    /// For people.
    pub fn text(&self) -> String {
        let spread = |values: &[f64]| {
            let middle = median(values).unwrap_or(0.0);
            format!(
                "{middle:.1e} (median), {:.1e} (95 %)",
                quantile(values, 0.95)
            )
        };
        let tight = self.bounds.iter().filter(|bound| **bound <= 0.5).count();
        format!(
            "f32 against its bound, {} pixels of {} scenes, in steps of 255: bound {}, at most half \
             a step for {:.1} % of them; CPU {}; of the bound {}; device {}, {} pixels drawn\n",
            self.fragments,
            self.scenes,
            spread(&self.bounds),
            100.0 * tight as f64 / self.fragments.max(1) as f64,
            spread(&self.observed),
            spread(&self.shares()),
            spread(&self.gpu_bounds),
            self.gpu_fragments,
        )
    }
}

/// The value that so large a share is below; zero of nothing.
pub fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let at = (share * values.len() as f64) as usize;
    sorted
        .get(at.min(values.len().saturating_sub(1)))
        .copied()
        .unwrap_or(0.0)
}

/// Photos as people take them.
fn usual(seed: u64) -> (String, render::Lumigraph, calibrate::View) {
    let all = [
        Surroundings::Plane,
        Surroundings::Tunnel,
        Surroundings::BALL,
    ];
    let kind = all[seed as usize / 4 % all.len()];
    let count = 5 + seed as usize % 37;
    let name = format!("{count} photos of a {}", kind.name());
    let view = desired(kind, (48, 36));
    (name, lumigraph(kind, count, (64, 48)), view)
}
