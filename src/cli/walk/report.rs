//! What a walk says of itself: lines for people, and JSON.

use super::super::plot::{Line, Panel, plot};
use super::super::stamp::in_unicode;
use super::super::took::{Memory, Start, Took};
use lumigraph::bench::median;
use lumigraph::scene::TruthScore;
use proxy::interior::Interior;
use render::interior::{FrameCost, PortalFill, Walk};
use render::score::mean_of;
use serde::Serialize;
use serde_json::{Value, json};
use std::ops::RangeInclusive;
use std::path::PathBuf;
use std::time::Duration;

/// A walk with one kind of portals.
pub(super) struct Walked {
    pub(super) fill: PortalFill,
    /// Those that were not there before.
    pub(super) frames: Vec<Drawn>,
    /// Of all frames.
    pub(super) files: Vec<PathBuf>,
    /// How many reference images portals showed.
    pub(super) references_used: usize,
    /// How many LDIs they showed.
    pub(super) ldis_used: usize,
    /// How many reference images were made meanwhile, for a frame or ahead of need.
    pub(super) references_made: usize,
}

/// A frame of a walk.
pub(super) struct Drawn {
    /// In the path, counted from 0.
    pub(super) index: usize,
    pub(super) name: String,
    pub(super) file: PathBuf,
    pub(super) cost: FrameCost,
    pub(super) scored: Option<Scored>,
    /// No pixel is covered, not even in part.
    pub(super) is_empty: bool,
    /// The share of its pixels that are covered.
    pub(super) shown: f64,
}

/// What a held-out photo's picture scores.
pub(super) struct Scored {
    pub(super) score: TruthScore,
    /// Processor time for the picture, with all photos and images in memory.
    pub(super) cpu_ms: f64,
}

#[derive(Serialize)]
struct FrameReport<'a> {
    name: &'a str,
    file: PathBuf,
    cell: Option<&'a str>,
    /// Drawing it: the sum of visibility, geometry, fill and shade.
    ms: f64,
    /// That and `references_ms`: how long one stands still for it.
    with_making_ms: f64,
    visibility_ms: f64,
    geometry_ms: f64,
    fill_ms: f64,
    shade_ms: f64,
    /// Making images and LDIs, reading LDIs, and waiting for one.
    references_ms: f64,
    references_made: usize,
    /// By this frame itself.
    ldis_made: usize,
    /// From files, for this frame.
    ldis_read: usize,
    /// Ahead of need, come in with this frame.
    ldis_ahead: usize,
    /// Of `references_ms`, for an LDI that was being made ahead of need.
    waited_ms: f64,
    visible_cells: usize,
    portals: usize,
    filled: usize,
    /// Of the cells drawn as geometry.
    triangles_in_cells: usize,
    /// Passed over in whole runs.
    triangles_skipped: usize,
    /// That touch a pixel's centre; none where a graphics device drew them.
    triangles_met: Option<usize>,
    samples: usize,
    /// Of LDIs, in columns out of sight.
    samples_clipped: usize,
    holes: usize,
    #[serde(flatten)]
    scored: Option<ScoreReport>,
}

/// Of a held-out photo.
#[derive(Serialize)]
struct ScoreReport {
    #[serde(flatten)]
    score: TruthScore,
    cpu_ms: f64,
}

/// What the whole run took, under the names that other commands' reports have for it.
#[derive(Serialize)]
pub(super) struct Report {
    device: String,
    /// Where photos colour what is drawn.
    #[serde(flatten)]
    photos: Option<PhotosReport>,
    /// Of images that were made to fill portals.
    references_memory: Memory,
    notes: Vec<String>,
    /// Those that show nothing at all, whatever portals show.
    frames_empty: usize,
    #[serde(flatten)]
    took: Took,
}

#[derive(Serialize)]
struct PhotosReport {
    photos_decoded: usize,
    photos_total: usize,
    cpu_memory: Memory,
}

impl Report {
    /// Of a walk that is over; `notes` is all that was said of it.
    pub(super) fn new(
        walk: &Walk<'_>,
        notes: Vec<String>,
        frames_empty: usize,
        start: &Start,
    ) -> Self {
        let captured = walk.painter().captured();
        let photos = captured.map(|captured| &captured.lumigraph().photos);
        Self {
            device: walk.painter().description(),
            photos: photos.map(|photos| PhotosReport {
                photos_decoded: photos.decoded(),
                photos_total: photos.len(),
                cpu_memory: Memory(photos.residency()),
            }),
            references_memory: Memory(walk.library().residency()),
            notes,
            frames_empty,
            took: start.took(),
        }
    }

    /// A line for people.
    pub(super) fn text(&self) -> String {
        let photos = self.photos.as_ref().map_or_else(String::new, |photos| {
            let (decoded, total) = (photos.photos_decoded, photos.photos_total);
            let memory = photos.cpu_memory.text();
            format!("{decoded} of {total} photos decoded ({memory}), ")
        });
        let (images, took) = (self.references_memory.text(), self.took.text(&self.device));
        format!("{photos}images in portals {images}, {took}")
    }
}

pub(super) fn ms(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

/// What frames took, those from a first to a last: a plot of drawing them, and where portals show images below it
/// one of all that they took. Making images may take many times as long. Nothing where no frame was drawn.
pub(super) fn times_svg(walks: &[Walked], frames: &RangeInclusive<usize>) -> Option<String> {
    let drawn = walks.iter().filter(|walk| !walk.frames.is_empty());
    let drawn: Vec<&Walked> = drawn.collect();
    if drawn.is_empty() {
        return None;
    }
    let alone: Vec<Times> = drawn.iter().map(|walk| walk.times_ms()).collect();
    let all: Vec<Times> = drawn.iter().map(|walk| walk.with_making_ms()).collect();
    let mut panels = vec![Panel {
        up: "ms a frame",
        lines: lines(&drawn, &alone),
    }];
    if drawn.iter().any(|walk| walk.shows_images()) {
        panels.push(Panel {
            up: "ms a frame, with making what portals show",
            lines: lines(&drawn, &all),
        });
    }
    Some(plot(&panels, frames, "frame"))
}

/// A walk's line for each.
fn lines<'a>(walks: &[&'a Walked], times: &'a [Times]) -> Vec<Line<'a>> {
    let line = |(walk, values): (&&'a Walked, &'a Times)| Line {
        name: walk.fill.name(),
        values,
    };
    walks.iter().zip(times).map(line).collect()
}

/// Of frames, their places in the path and their times in milliseconds.
type Times = Vec<(usize, f64)>;

impl Walked {
    /// How long each frame that was drawn took to draw.
    fn times_ms(&self) -> Times {
        let times = self.frames.iter().map(|f| (f.index, ms(f.cost.time())));
        times.collect()
    }

    /// The same with making what it needed.
    fn with_making_ms(&self) -> Times {
        let frames = self.frames.iter();
        frames
            .map(|f| (f.index, ms(f.cost.with_making())))
            .collect()
    }

    /// For how long one stands still at most; nothing where no frame was drawn.
    fn worst_with_making_ms(&self) -> Option<f64> {
        let times = self.with_making_ms().into_iter().map(|(_, time)| time);
        times.max_by(f64::total_cmp)
    }

    /// Whether its portals do.
    fn shows_images(&self) -> bool {
        self.fill.shows_images()
    }

    /// How many frames were there before.
    pub(super) fn before(&self) -> usize {
        self.files.len() - self.frames.len()
    }

    /// Of drawing alone, the median, what 95 % stay below, and the worst; nothing where no frame was drawn.
    fn spread(&self) -> Option<[f64; 3]> {
        let mut times: Vec<f64> = self.times_ms().into_iter().map(|(_, time)| time).collect();
        times.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let i = (share * times.len() as f64).ceil() as usize;
            times.get(i.saturating_sub(1)).copied()
        };
        Some([median(&times)?, at(0.95)?, at(1.0)?])
    }

    fn sum(&self, of: impl Fn(&FrameCost) -> usize) -> usize {
        self.frames.iter().map(|f| of(&f.cost)).sum()
    }

    fn mean(&self, of: impl Fn(&FrameCost) -> usize) -> f64 {
        self.sum(of) as f64 / self.frames.len().max(1) as f64
    }

    /// The means over the photos that were held out: their scores, and the processor's time.
    fn scored(&self) -> Option<ScoreReport> {
        let scored: Vec<&Scored> = self
            .frames
            .iter()
            .filter_map(|f| f.scored.as_ref())
            .collect();
        let scores: Vec<TruthScore> = scored.iter().map(|s| s.score).collect();
        let times: Vec<f64> = scored.iter().map(|s| s.cpu_ms).collect();
        Some(ScoreReport {
            score: TruthScore::mean(&scores)?,
            cpu_ms: mean_of(&times)?,
        })
    }

    pub(super) fn line(&self) -> String {
        let scored = self.scored().map_or_else(String::new, |s| {
            let ScoreReport { score, cpu_ms } = s;
            let score = score.score;
            let (psnr, ssim, coverage) = (score.psnr, score.ssim, score.coverage);
            format!(" {psnr:>8.2} {ssim:>8.4} {coverage:>8.4} {cpu_ms:>8.1}")
        });
        let name = self.fill.name();
        let (Some([median, most, worst]), Some(still)) =
            (self.spread(), self.worst_with_making_ms())
        else {
            let none = "-";
            return format!(
                "{name:<10} {none:>9} {none:>9} {none:>9} {none:>11} {none:>9} {none:>9} {none:>8} \
                 {none:>7} {none:>5}\n"
            );
        };
        format!(
            "{name:<10} {median:>9.1} {most:>9.1} {worst:>9.1} {still:>11.1} {:>9.0} {:>9.0} {:>8.1} \
             {:>7} {:>5}{scored}\n",
            self.mean(|c| c.triangles_tried),
            self.mean(|c| c.samples),
            self.mean(|c| c.holes),
            self.references_used,
            self.ldis_used
        )
    }

    pub(super) fn json<'a>(&'a self, interior: &'a Interior) -> Value {
        let spread = self.spread();
        let report = |f: &'a Drawn, c: &'a FrameCost| FrameReport {
            name: &f.name,
            file: in_unicode(&f.file),
            scored: f.scored.as_ref().map(|s| ScoreReport {
                score: s.score,
                cpu_ms: s.cpu_ms,
            }),
            cell: c.cell.map(|id| interior.cell(id).name.as_str()),
            ms: ms(c.time()),
            with_making_ms: ms(c.with_making()),
            visibility_ms: ms(c.visibility),
            geometry_ms: ms(c.geometry),
            fill_ms: ms(c.fill),
            shade_ms: ms(c.shade),
            references_ms: ms(c.references),
            references_made: c.references_made,
            ldis_made: c.ldis_made,
            ldis_read: c.ldis_read,
            ldis_ahead: c.ldis_ahead,
            waited_ms: ms(c.waited),
            visible_cells: c.visible_cells,
            portals: c.portals,
            filled: c.filled,
            triangles_in_cells: c.triangles_in_cells,
            triangles_skipped: c.triangles_in_cells - c.triangles_tried,
            triangles_met: c.triangles_met,
            samples: c.samples,
            samples_clipped: c.samples_clipped,
            holes: c.holes,
        };
        let frames = self.frames.iter().map(|f| report(f, &f.cost));
        let frames: Vec<FrameReport<'_>> = frames.collect();
        json!({
            "portals": self.fill.name(),
            "median_ms": spread.map(|s| s[0]),
            "percentile_95_ms": spread.map(|s| s[1]),
            "worst_ms": spread.map(|s| s[2]),
            "worst_with_making_ms": self.worst_with_making_ms(),
            "references_used": self.references_used,
            "references_made": self.references_made,
            "references_made_ahead": self.references_made - self.sum(|c| c.references_made),
            "ldis_used": self.ldis_used,
            "ldis_made": self.sum(|c| c.ldis_made),
            "ldis_read": self.sum(|c| c.ldis_read),
            "ldis_ahead": self.sum(|c| c.ldis_ahead),
            "mean": self.scored(),
            "frames": frames,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames that take so many milliseconds to draw, and so many more for what they show.
    fn walked(fill: PortalFill, frames: &[(u64, u64)]) -> Walked {
        let drawn = |(index, &(drawing, making)): (usize, &(u64, u64))| Drawn {
            index,
            name: index.to_string(),
            file: PathBuf::from(format!("{index}.png")),
            cost: FrameCost {
                fill: Duration::from_millis(drawing),
                references: Duration::from_millis(making),
                ..FrameCost::default()
            },
            scored: None,
            is_empty: false,
            shown: 1.0,
        };
        let frames: Vec<Drawn> = frames.iter().enumerate().map(drawn).collect();
        Walked {
            fill,
            files: frames.iter().map(|f| f.file.clone()).collect(),
            frames,
            references_used: 0,
            ldis_used: 0,
            references_made: 0,
        }
    }

    #[test]
    fn how_long_a_frame_stands_still_is_said_beside_what_drawing_takes() {
        let walk = walked(PortalFill::Ldi, &[(5, 0), (6, 2000), (7, 0)]);
        let cells = walk.line();
        let cells: Vec<&str> = cells.split_whitespace().take(5).collect();
        assert_eq!(cells, ["ldi", "6.0", "7.0", "7.0", "2006.0"]);
        let interior = Interior {
            model: None,
            up: glam::DVec3::Y,
            eye_height: 1.6,
            cells: Vec::new(),
            portals: Vec::new(),
            held_out: Vec::new(),
            other: Default::default(),
        };
        let report = walk.json(&interior);
        let is = |value: &Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-6;
        assert!(is(&report["worst_ms"], 7.0), "{report}");
        assert!(is(&report["worst_with_making_ms"], 2006.0), "{report}");
        for (i, [ms, making]) in [[5.0, 0.0], [6.0, 2000.0], [7.0, 0.0]].iter().enumerate() {
            let frame = &report["frames"][i];
            assert!(is(&frame["ms"], *ms), "{report}");
            assert!(is(&frame["references_ms"], *making), "{report}");
            assert!(is(&frame["with_making_ms"], ms + making), "{report}");
        }
    }

    #[test]
    fn the_median_of_an_even_number_of_frames_is_between_the_two_in_the_middle() {
        let spread = |times: &[(u64, u64)]| walked(PortalFill::Geometry, times).spread();
        let is = |found: Option<[f64; 3]>, expected: [f64; 3]| {
            let found = found.unwrap();
            (0..3).all(|i| (found[i] - expected[i]).abs() < 1e-9)
        };
        assert!(is(spread(&[(3, 0), (1, 0)]), [2.0, 3.0, 3.0]));
        assert!(is(spread(&[(9, 0), (1, 0), (2, 0)]), [2.0, 9.0, 9.0]));
        assert!(is(
            spread(&[(4, 0), (1, 0), (9, 0), (2, 0)]),
            [3.0, 9.0, 9.0]
        ));
        assert_eq!(spread(&[]), None);
    }

    #[test]
    fn what_making_takes_is_plotted_where_portals_show_images() {
        let frames = [(5, 0), (6, 2000)];
        let walks = [PortalFill::Geometry, PortalFill::Ldi].map(|fill| walked(fill, &frames));
        let panels = |walks: &[Walked]| {
            let svg = times_svg(walks, &(0..=1)).unwrap();
            let with_making = svg.contains(">ms a frame, with making what portals show<");
            assert_eq!(svg.contains(">2000<"), with_making, "{svg}");
            (svg.matches("<polyline").count(), with_making)
        };
        assert_eq!(panels(&walks[..1]), (1, false));
        assert_eq!(panels(&walks[1..]), (2, true));
        assert_eq!(panels(&walks), (4, true));
        assert!(times_svg(&[walked(PortalFill::Ldi, &[])], &(0..=1)).is_none());
        assert!(times_svg(&[], &(0..=1)).is_none());
    }
}
