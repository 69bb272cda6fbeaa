//! One figure of all captures as a table.

use crate::distances::Distances;
use crate::score::Scored;
use render::score::mean_of;

/// What a table tells.
#[derive(Clone, Copy)]
pub(super) enum Figure {
    Psnr,
    Coverage,
    CoveragePoints,
    CoverageMatte,
    CoverageBackground,
    FitSeconds,
    MeanDistance,
    Distance95,
    Complete,
}

impl Figure {
    /// Of the pictures.
    pub(super) const SCORES: [Self; 6] = [
        Self::Psnr,
        Self::Coverage,
        Self::CoveragePoints,
        Self::CoverageMatte,
        Self::CoverageBackground,
        Self::FitSeconds,
    ];
    /// Of the surfaces.
    pub(super) const DISTANCES: [Self; 3] = [Self::MeanDistance, Self::Distance95, Self::Complete];

    fn title(self) -> &'static str {
        match self {
            Self::Psnr => "PSNR of the whole picture, dB",
            Self::Coverage => "coverage, %",
            Self::CoveragePoints => "coverage of points, %",
            Self::CoverageMatte => "mattes' pixels covered by half or more, %",
            Self::CoverageBackground => "backgrounds' pixels covered by half or more, %",
            Self::FitSeconds => "fitting, CPU seconds",
            Self::MeanDistance => "distance from the truth, mean, % of the scene's size",
            Self::Distance95 => "distance from the truth, 95 % are nearer, % of the scene's size",
            Self::Complete => "truth within 1 % of the scene's size of the proxy, %",
        }
    }

    /// Its value, if there is one.
    pub(super) fn of(self, scored: Option<&Scored>, distances: Option<&Distances>) -> Option<f64> {
        let percent = |share: f64| 100.0 * share;
        match self {
            Self::Psnr => Some(scored?.mean.score.psnr),
            Self::Coverage => Some(percent(scored?.mean.score.coverage)),
            Self::CoveragePoints => scored?.mean.coverage_points.map(percent),
            Self::CoverageMatte => scored?.mean.matte?.covered_matte.map(percent),
            Self::CoverageBackground => scored?.mean.matte?.covered_background.map(percent),
            Self::FitSeconds => Some(scored?.fit_cpu_s),
            Self::MeanDistance => Some(percent(distances?.mean)),
            Self::Distance95 => Some(percent(distances?.p95)),
            Self::Complete => Some(percent(distances?.complete)),
        }
    }
}

/// A table as Markdown, the mean of each column at the bottom: over the rows that have a value,
/// whose number is told where it is not all. `None` where there is no value at all.
pub(super) fn table(
    figure: Figure,
    columns: &[String],
    rows: &[(&str, Vec<Option<f64>>)],
) -> Option<String> {
    rows.iter().flat_map(|(_, cells)| cells).flatten().next()?;
    let mut lines = vec![[&["capture".to_owned()], columns].concat()];
    let text = |value: &Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.2}"));
    for (name, cells) in rows {
        let cells = cells.iter().map(text);
        lines.push(std::iter::once((*name).to_owned()).chain(cells).collect());
    }
    let mut means = vec!["mean".to_owned()];
    for i in 0..columns.len() {
        let values: Vec<f64> = rows.iter().filter_map(|(_, cells)| cells[i]).collect();
        let mut mean = text(&mean_of(&values));
        if !values.is_empty() && values.len() < rows.len() {
            mean += &format!(" ({})", values.len());
        }
        means.push(mean);
    }
    lines.push(means);

    let width = |i: usize| lines.iter().map(|line| line[i].chars().count()).max();
    let widths: Vec<usize> = (0..=columns.len()).filter_map(width).collect();
    let mut text = format!("{}\n\n", figure.title());
    for (i, line) in lines.iter().enumerate() {
        let cells = line.iter().zip(&widths).enumerate();
        let padded = cells.map(|(column, (cell, &width))| match column {
            0 => format!("{cell:width$}"),
            _ => format!("{cell:>width$}"),
        });
        text += &format!("| {} |\n", padded.collect::<Vec<_>>().join(" | "));
        if i == 0 {
            let rules = widths
                .iter()
                .enumerate()
                .map(|(column, &width)| match column {
                    0 => "-".repeat(width),
                    _ => format!("{}:", "-".repeat(width - 1)),
                });
            text += &format!("| {} |\n", rules.collect::<Vec<_>>().join(" | "));
        }
    }
    Some(text)
}
