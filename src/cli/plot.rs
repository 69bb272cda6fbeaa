//! Lines over an axis, as SVG.

use render::interior::PortalFill;
use std::fmt::Write;
use std::ops::RangeInclusive;

/// A plot over the steps that others share: what its axis measures, and its lines.
pub(super) struct Panel<'a> {
    pub(super) up: &'a str,
    pub(super) lines: Vec<Line<'a>>,
}

/// A line: its name, and the steps that it has values at, one after the other, with those.
pub(super) struct Line<'a> {
    pub(super) name: &'a str,
    pub(super) values: &'a [(usize, f64)],
}

/// Of a panel.
const SIZE: (f64, f64) = (960.0, 420.0);
/// Left, top, right and bottom of the axes.
const ROOM: (f64, f64, f64, f64) = (64.0, 24.0, 24.0, 44.0);
/// As many as walks have lines: what portals show, and everything drawn.
const COLORS: [&str; PortalFill::ALL.len() + 1] = [
    "#c0392b", "#2c6fbb", "#2e8b57", "#b8860b", "#7d3c98", "#16a0a0",
];

/// Panels below each other, whose lines share both axes: across those steps, and up from zero. A line is broken
/// where steps have no values.
pub(super) fn plot(panels: &[Panel<'_>], steps: &RangeInclusive<usize>, across: &str) -> String {
    let (width, height) = SIZE;
    let mut svg = opened((width, height * panels.len() as f64));
    for (place, panel) in panels.iter().enumerate() {
        let down = height * place as f64;
        svg += &format!("<g transform=\"translate(0 {down})\">\n");
        add(&mut svg, panel, steps, across);
        svg += "</g>\n";
    }
    svg + "</svg>\n"
}

/// Adds a panel, where its left upper corner is the origin.
fn add(svg: &mut String, panel: &Panel<'_>, steps: &RangeInclusive<usize>, across: &str) {
    let Panel { up, lines } = panel;
    let values = lines.iter().flat_map(|l| l.values);
    let greatest = values.map(|(_, value)| *value).fold(0.0, f64::max);
    let step = step(greatest);
    let top = (greatest / step).ceil().max(1.0) * step;
    let (first, last) = (*steps.start(), *steps.end());
    let (width, height) = SIZE;
    let (left, above, right, below) = ROOM;
    let length = last.saturating_sub(first).max(1) as f64;
    let x = |i: usize| left + (width - left - right) * (i as f64 - first as f64) / length;
    let y = |v: f64| height - below - (height - above - below) * v / top;
    // Writing to a string cannot fail.
    let rows = (top / step).round() as usize;
    for row in 0..=rows {
        let value = row as f64 * step;
        let at = y(value);
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {at:.1}H{:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            width - right,
            left - 6.0,
            at + 4.0,
            // No more digits than the step has.
            (value * 1e6).round() / 1e6
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{left}\" y=\"14\">{up}</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{across} ({first} to {last})</text>",
        width - right,
        height - below + 30.0,
    );
    for (k, line) in lines.iter().enumerate() {
        let color = COLORS[k % COLORS.len()];
        for stretch in line.values.chunk_by(|a, b| b.0 == a.0 + 1) {
            // One alone is a dot: a line from it to itself, with round ends.
            let alone = stretch.first().filter(|_| stretch.len() == 1);
            let points: String = stretch
                .iter()
                .chain(alone)
                .map(|(i, v)| format!("{:.1},{:.1} ", x(*i), y(*v)))
                .collect();
            let _ = writeln!(
                svg,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{color}\" \
                 stroke-width=\"1.5\" stroke-linecap=\"round\"/>",
                points.trim_end()
            );
        }
        let _ = writeln!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{color}\">{}</text>",
            left + 90.0 * k as f64,
            height - below + 30.0,
            line.name
        );
    }
}

/// The beginning of a plot of so many pixels.
pub(super) fn opened((width, height): (f64, f64)) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    )
}

/// 1, 2 or 5 times a power of ten, so that there are up to ten rows.
pub(super) fn step(greatest: f64) -> f64 {
    if !(greatest > 0.0 && greatest.is_finite()) {
        return 1.0;
    }
    let power = 10_f64.powf((greatest / 10.0).log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|m| m * power);
    steps
        .into_iter()
        .find(|s| greatest / s <= 10.0)
        .unwrap_or(10.0 * power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_have_round_steps_and_lines_stay_within() {
        assert_eq!([step(0.0), step(9.0), step(95.0)], [1.0, 1.0, 10.0]);
        assert_eq!([step(130.0), step(0.3)], [20.0, 0.05]);
        let (a, b) = (
            [(0, 1.0), (1, 4.0), (2, 2.0)],
            [(0, 0.5), (1, 0.5), (2, 3.9)],
        );
        let lines = [("one", &a[..]), ("two", &b[..])].map(|(name, values)| Line { name, values });
        let panel = |lines| Panel { up: "ms", lines };
        let svg = plot(&[panel(lines.into())], &(0..=2), "frame");
        assert_eq!(svg.matches("<polyline").count(), 2);
        assert!(svg.contains("64.0,") && svg.contains(">one<") && svg.ends_with("</svg>\n"));
        assert!(plot(&[panel(Vec::new())], &(0..=0), "frame").contains("</svg>"));
    }

    #[test]
    fn values_are_at_their_own_steps_and_nothing_is_drawn_between_those_that_are_apart() {
        let values = [(120, 1.0), (121, 1.0), (180, 1.0), (240, 1.0)];
        let line = Line {
            name: "one",
            values: &values,
        };
        let panel = Panel {
            up: "ms",
            lines: vec![line],
        };
        let svg = plot(&[panel], &(120..=240), "frame");
        assert!(svg.contains("frame (120 to 240)"), "{svg}");
        for points in [
            "64.0,24.0 71.3,24.0",
            "500.0,24.0 500.0,24.0",
            "936.0,24.0 936.0,24.0",
        ] {
            assert!(svg.contains(&format!("points=\"{points}\"")), "{svg}");
        }
    }

    #[test]
    fn panels_are_below_each_other_each_with_an_axis_of_its_own() {
        let (low, high) = ([(0, 1.0), (1, 4.0)], [(0, 1.0), (1, 4000.0)]);
        let panels = [("ms", &low), ("ms, with making", &high)].map(|(up, values)| Panel {
            up,
            lines: vec![Line {
                name: "one",
                values,
            }],
        });
        let svg = plot(&panels, &(0..=1), "frame");
        assert!(svg.contains("viewBox=\"0 0 960 840\""), "{svg}");
        let parts: Vec<&str> = svg.split("<g transform=\"translate(0 ").collect();
        assert!(parts.len() == 3 && svg.matches("</g>").count() == 2);
        for (part, [down, up, top]) in parts[1..].iter().zip([
            ["0)", ">ms<", ">4<"],
            ["420)", ">ms, with making<", ">4000<"],
        ]) {
            assert!(part.starts_with(down), "{svg}");
            assert!(part.contains(up) && part.contains(top), "{svg}");
            // Both reach the top at their greatest.
            assert!(part.contains(" 936.0,24.0\""), "{svg}");
        }
    }
}
