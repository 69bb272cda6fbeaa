//! What a walk says of itself: a line for people, and JSON.

use lumigraph::scene::TruthScore;
use proxy::interior::Interior;
use render::interior::{FrameCost, PortalFill};
use render::score::mean_of;
use serde::Serialize;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// A walk with one kind of portals.
pub(super) struct Walked {
    pub(super) fill: PortalFill,
    /// Those that were not there before.
    pub(super) frames: Vec<Drawn>,
    /// Of all frames.
    pub(super) files: Vec<PathBuf>,
    /// How many reference images it used.
    pub(super) references: usize,
}

/// A frame of a walk.
pub(super) struct Drawn {
    pub(super) name: String,
    pub(super) file: PathBuf,
    pub(super) cost: FrameCost,
    pub(super) scored: Option<Scored>,
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
    file: &'a Path,
    cell: Option<&'a str>,
    ms: f64,
    visibility_ms: f64,
    geometry_ms: f64,
    fill_ms: f64,
    shade_ms: f64,
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

pub(super) fn ms(time: std::time::Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

impl Walked {
    pub(super) fn times_ms(&self) -> Vec<f64> {
        self.frames.iter().map(|f| ms(f.cost.time())).collect()
    }

    /// The median, what 95 % stay below, and the worst.
    fn spread(&self) -> [f64; 3] {
        let mut times = self.times_ms();
        times.sort_by(f64::total_cmp);
        let at = |share: f64| {
            let i = (share * times.len() as f64).ceil() as usize;
            times.get(i.saturating_sub(1)).copied().unwrap_or(0.0)
        };
        [at(0.5), at(0.95), at(1.0)]
    }

    fn mean(&self, of: impl Fn(&FrameCost) -> usize) -> f64 {
        let sum: usize = self.frames.iter().map(|f| of(&f.cost)).sum();
        sum as f64 / self.frames.len().max(1) as f64
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
        let [median, most, worst] = self.spread();
        format!(
            "{:<10} {median:>9.1} {most:>9.1} {worst:>9.1} {:>9.0} {:>9.0} {:>8.1} {:>7}{scored}\n",
            self.fill.name(),
            self.mean(|c| c.triangles_tried),
            self.mean(|c| c.samples),
            self.mean(|c| c.holes),
            self.references
        )
    }

    pub(super) fn json<'a>(&'a self, interior: &'a Interior) -> Value {
        let [median, most, worst] = self.spread();
        let report = |f: &'a Drawn, c: &'a FrameCost| FrameReport {
            name: &f.name,
            file: &f.file,
            scored: f.scored.as_ref().map(|s| ScoreReport {
                score: s.score,
                cpu_ms: s.cpu_ms,
            }),
            cell: c.cell.map(|id| interior.cell(id).name.as_str()),
            ms: ms(c.time()),
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
            "median_ms": median,
            "percentile_95_ms": most,
            "worst_ms": worst,
            "references_used": self.references,
            "references_made": self.frames.iter().map(|f| f.cost.references_made).sum::<usize>(),
            "ldis_made": self.frames.iter().map(|f| f.cost.ldis_made).sum::<usize>(),
            "ldis_read": self.frames.iter().map(|f| f.cost.ldis_read).sum::<usize>(),
            "mean": self.scored(),
            "frames": frames,
        })
    }
}
