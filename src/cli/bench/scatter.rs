//! Points over two logarithmic or even axes, as SVG.

use super::super::plot;
use std::fmt::Write;

/// A point: what it is, which family its colour tells, and where it lies.
pub(super) struct Dot<'a> {
    pub(super) name: &'a str,
    pub(super) family: &'a str,
    pub(super) at: (f64, f64),
    /// Marked with a ring and its name.
    pub(super) is_default: bool,
}

/// What an axis shows.
pub(super) struct Axis<'a> {
    pub(super) title: &'a str,
    pub(super) is_log: bool,
}

const SIZE: (f64, f64) = (760.0, 420.0);
/// Left, top, right and bottom of the axes.
const ROOM: (f64, f64, f64, f64) = (64.0, 26.0, 24.0, 64.0);
/// One for each kind of setting at least.
pub(super) const COLORS: [&str; 12] = [
    "#2c6fbb", "#c0392b", "#2e8b57", "#b8860b", "#7d3c98", "#16a085", "#d35400", "#7f8c8d",
    "#d81b60", "#455a64", "#8d6e63", "#9e9d24",
];

/// Values to places along an axis.
struct Scale {
    low: f64,
    high: f64,
    is_log: bool,
    from: f64,
    to: f64,
}

impl Scale {
    fn new(values: impl Iterator<Item = f64> + Clone, is_log: bool, from: f64, to: f64) -> Self {
        let low = values.clone().fold(f64::INFINITY, f64::min);
        let high = values.fold(f64::NEG_INFINITY, f64::max);
        let (low, high) = if low <= high { (low, high) } else { (1.0, 2.0) };
        let (low, high) = match is_log {
            true => (low / 1.15, (high * 1.15).max(low * 1.3)),
            false => {
                let margin = (0.06 * (high - low)).max(1e-3 * high.abs()).max(1e-6);
                (low - margin, high + margin)
            }
        };
        Self {
            low,
            high,
            is_log,
            from,
            to,
        }
    }

    fn place(&self, value: f64) -> f64 {
        let share = match self.is_log {
            true => (value / self.low).ln() / (self.high / self.low).ln(),
            false => (value - self.low) / (self.high - self.low),
        };
        self.from + share * (self.to - self.from)
    }

    /// Round values along it.
    fn ticks(&self) -> Vec<f64> {
        // On a logarithmic axis one number gives no scale: the coarsest steps that give three, if there are any.
        const STEPS: [&[f64]; 3] = [
            &[1.0],
            &[1.0, 2.0, 5.0],
            &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0],
        ];
        let decades = self.low.log10().floor() as i32..=self.high.log10().ceil() as i32;
        for steps in STEPS.into_iter().filter(|_| self.is_log) {
            let all = decades.clone();
            let all = all.flat_map(|d| steps.iter().map(move |s| s * 10.0_f64.powi(d)));
            let within: Vec<f64> = all.filter(|v| (self.low..=self.high).contains(v)).collect();
            if within.len() >= 3 {
                return within;
            }
        }
        let step = plot::step(self.high - self.low);
        let first = (self.low / step).ceil() as i64;
        let last = (self.high / step).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// A plot; `line` joins the named dots in that order. Dots that an axis cannot show (zero on a
/// logarithmic one) are left out, but have a share in which family has which colour.
pub(super) fn scatter(
    dots: &[Dot<'_>],
    line: &[usize],
    across: &Axis<'_>,
    up: &Axis<'_>,
) -> String {
    let fits = |v: f64, axis: &Axis<'_>| v.is_finite() && (!axis.is_log || v > 0.0);
    let shown = |dot: &&Dot<'_>| fits(dot.at.0, across) && fits(dot.at.1, up);
    let (left, above, right, below) = ROOM;
    let (width, height) = SIZE;
    let of = |i: usize| {
        let values = dots.iter().filter(shown);
        values.map(move |d| if i == 0 { d.at.0 } else { d.at.1 })
    };
    let x = Scale::new(of(0), across.is_log, left, width - right);
    let y = Scale::new(of(1), up.is_log, height - below, above);
    let mut svg = plot::opened(SIZE);
    // Writing to a string cannot fail.
    for value in x.ticks() {
        let at = x.place(value);
        let _ = writeln!(
            svg,
            "<path d=\"M{at:.1} {above}V{:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
            height - below,
            height - below + 16.0,
            round(value)
        );
    }
    for value in y.ticks() {
        let at = y.place(value);
        let _ = writeln!(
            svg,
            "<path d=\"M{left} {at:.1}H{:.1}\" stroke=\"#ddd\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
            width - right,
            left - 6.0,
            at + 4.0,
            round(value)
        );
    }
    let _ = writeln!(
        svg,
        "<text x=\"{left}\" y=\"16\">{}</text>\
         <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
        escape(up.title),
        width - right,
        height - below + 34.0,
        escape(across.title)
    );
    let joined: String = line
        .iter()
        .map(|&i| &dots[i])
        .filter(shown)
        .map(|d| format!("{:.1},{:.1} ", x.place(d.at.0), y.place(d.at.1)))
        .collect();
    let _ = writeln!(
        svg,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"#999\" stroke-dasharray=\"4 3\"/>",
        joined.trim_end()
    );
    let mut families: Vec<&str> = Vec::new();
    for dot in dots {
        if !families.contains(&dot.family) {
            families.push(dot.family);
        }
    }
    for dot in dots.iter().filter(shown) {
        let (cx, cy) = (x.place(dot.at.0), y.place(dot.at.1));
        let family = families.iter().position(|f| *f == dot.family).unwrap_or(0);
        let color = COLORS[family % COLORS.len()];
        let name = escape(dot.name);
        let _ = writeln!(
            svg,
            "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"4\" fill=\"{color}\"><title>{name}: {}, \
             {}</title></circle>",
            round(dot.at.0),
            round(dot.at.1)
        );
        if dot.is_default {
            let _ = writeln!(
                svg,
                "<circle cx=\"{cx:.1}\" cy=\"{cy:.1}\" r=\"8\" fill=\"none\" stroke=\"black\"/>"
            );
        }
    }
    // Names, those of the default and of the line first, where they cover no other.
    let is_first = |i: &usize| dots[*i].is_default || line.contains(i);
    let order = (0..dots.len()).filter(is_first);
    let order = order.chain((0..dots.len()).filter(|i| !is_first(i)));
    let mut taken: Vec<[f64; 4]> = Vec::new();
    for dot in order.map(|i| &dots[i]).filter(shown) {
        let (at_x, at_y) = (x.place(dot.at.0) + 7.0, y.place(dot.at.1) - 5.0);
        let long = 6.0 * dot.name.chars().count() as f64;
        let at_x = at_x.min(width - long);
        let area = [at_x, at_y - 10.0, at_x + long, at_y];
        let covers =
            |o: &[f64; 4]| area[0] < o[2] && o[0] < area[2] && area[1] < o[3] && o[1] < area[3];
        if taken.iter().any(covers) {
            continue;
        }
        taken.push(area);
        let weight = if dot.is_default {
            " font-weight=\"bold\""
        } else {
            ""
        };
        let _ = writeln!(
            svg,
            "<text x=\"{at_x:.1}\" y=\"{at_y:.1}\" font-size=\"11\"{weight}>{}</text>",
            escape(dot.name)
        );
    }
    let mut at = left;
    for (k, family) in families.iter().enumerate() {
        if !dots.iter().filter(shown).any(|dot| dot.family == *family) {
            continue;
        }
        let _ = writeln!(
            svg,
            "<text x=\"{at:.1}\" y=\"{:.1}\" fill=\"{}\">{}</text>",
            height - 8.0,
            COLORS[k % COLORS.len()],
            escape(family)
        );
        at += 7.0 * family.len() as f64 + 16.0;
    }
    svg + "</svg>\n"
}

/// Four digits.
pub(super) fn round(value: f64) -> String {
    proxy::shown_number(value)
}

/// Text that is safe between tags and in attributes.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        match c {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&#39;",
            c => escaped.push(c),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn dot(name: &str, at: (f64, f64)) -> Dot<'_> {
        Dot {
            name,
            family: "k",
            at,
            is_default: name == "default",
        }
    }

    #[test]
    fn dots_lie_within_the_axes_and_names_are_escaped() {
        let log = Axis {
            title: "ms",
            is_log: true,
        };
        let even = Axis {
            title: "dB",
            is_log: false,
        };
        let dots = [
            dot("default", (10.0, 30.0)),
            dot("<b>", (200.0, 25.0)),
            dot("zero", (0.0, 25.0)),
            dot("nothing", (5.0, f64::NAN)),
        ];
        let svg = scatter(&dots, &[0, 1], &log, &even);
        assert_eq!(svg.matches("<title>").count(), 2);
        assert!(svg.contains("&lt;b&gt;") && !svg.contains("<b>"));
        for circle in svg.split("<circle cx=\"").skip(1) {
            let x: f64 = circle.split('"').next().unwrap().parse().unwrap();
            assert!((64.0..=736.0).contains(&x), "{x}");
        }
        assert!(scatter(&[], &[], &log, &even).ends_with("</svg>\n"));
        let one = [dot("default", (10.0, 30.0))];
        assert!(!scatter(&one, &[0], &log, &even).contains("NaN"));
    }

    #[test]
    fn a_family_has_one_colour_in_all_plots_of_the_same_dots() {
        let even = Axis {
            title: "dB",
            is_log: false,
        };
        let log = Axis {
            title: "steps",
            is_log: true,
        };
        let of = |family: &'static str, up: f64| Dot {
            name: family,
            family,
            at: (1.0, up),
            is_default: false,
        };
        let grid = |dots: &[Dot<'_>], up: &Axis<'_>| {
            let svg = scatter(dots, &[], &even, up);
            let circles = svg.lines().filter(|line| line.contains("<title>grid"));
            let colors = circles.map(|line| line.split('"').nth(7).unwrap().to_owned());
            (
                colors.collect::<Vec<String>>(),
                svg.contains(">renderer</text>"),
            )
        };
        let dots = [of("renderer", 0.0), of("grid", 2.0)];
        let expected = vec![COLORS[1].to_owned()];
        assert_eq!(grid(&dots, &even), (expected.clone(), true));
        // What is not shown is not named either.
        assert_eq!(grid(&dots, &log), (expected, false));
    }

    #[test]
    fn axes_have_two_numbers_at_least() {
        for low in [0.013, 0.24, 1.0, 2.4, 17.0, 24.0, 55.0, 99.0, 1234.5] {
            for ratio in [1.0, 1.1, 1.8, 2.5, 7.0, 60.0, 900.0, 1e5] {
                for is_log in [false, true] {
                    let scale = Scale::new([low, ratio * low].into_iter(), is_log, 0.0, 100.0);
                    let ticks = scale.ticks();
                    let count = ticks.len();
                    assert!(
                        (2..=12).contains(&count),
                        "{low} {ratio} {is_log}: {ticks:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn numbers_have_four_digits() {
        let all = [0.012_346, 1.0, 12.344, 99.99, 1234.6, 0.5].map(round);
        assert_eq!(all, ["0.01235", "1", "12.34", "99.99", "1235", "0.5"]);
    }
}
