//! One page with everything: no scripts, nothing fetched from anywhere.

use super::judge::{Verdict, judge};
use super::measured::{Measured, Pictures, Subject};
use super::scaling::Scaling;
use super::scatter::{Axis, Dot, escape, round, scatter};
use anyhow::Context;
use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use image::codecs::jpeg::JpegEncoder;
use image::{Rgb, RgbImage, RgbaImage};
use render::score::on_black;
use std::fmt::Write;

/// Differences are shown so many times as large.
const FROM_TRUTH: i32 = 4;
const FROM_EXACT: i32 = 32;
/// Pixels along the longer side of the pictures in the report.
const THUMBNAIL: u32 = 360;

/// The pictures of a subject, as they stand in the page: title and data address.
pub(super) type Thumbnails = Vec<(String, String)>;

/// The truth, and what a setting drew, with its differences from that and from the exact picture.
pub(super) fn thumbnails(pictures: &Pictures) -> anyhow::Result<Thumbnails> {
    let opaque = |picture: &RgbaImage| {
        let pixels = on_black(picture).into_iter().flatten().collect();
        let (width, height) = picture.dimensions();
        RgbImage::from_raw(width, height, pixels).expect("three bytes a pixel")
    };
    let (truth, drawn) = (opaque(&pictures.truth), opaque(&pictures.drawn));
    let difference = |other: &RgbImage, times: i32| {
        RgbImage::from_fn(drawn.width(), drawn.height(), |x, y| {
            let (a, b) = (drawn.get_pixel(x, y).0, other.get_pixel(x, y).0);
            let apart = |c: usize| times * (i32::from(a[c]) - i32::from(b[c])).abs();
            Rgb([0, 1, 2].map(|c| apart(c).min(255) as u8))
        })
    };
    let setting = &pictures.setting;
    let mut shown = vec![
        ("truth".to_owned(), truth.clone()),
        (setting.clone(), drawn.clone()),
        (
            format!("{setting} − truth, × {FROM_TRUTH}"),
            difference(&truth, FROM_TRUTH),
        ),
    ];
    if let Some(exact) = &pictures.exact {
        shown.push((
            format!("{setting} − exact, × {FROM_EXACT}"),
            difference(&opaque(exact), FROM_EXACT),
        ));
    }
    let address = |(title, picture): (String, RgbImage)| Ok((title, data_address(&picture)?));
    shown.into_iter().map(address).collect()
}

fn data_address(picture: &RgbImage) -> anyhow::Result<String> {
    let (width, height) = capture::reduced_size(picture.dimensions(), THUMBNAIL);
    let small = image::imageops::thumbnail(picture, width, height);
    let mut bytes = Vec::new();
    JpegEncoder::new_with_quality(&mut bytes, 88)
        .encode_image(&small)
        .context("a picture for the report")?;
    Ok(format!(
        "data:image/jpeg;base64,{}",
        BASE64_STANDARD.encode(bytes)
    ))
}

const STYLE: &str = "body{font:15px/1.45 sans-serif;max-width:1100px;margin:2em auto;padding:0 1em;\
color:#222}h1,h2{font-weight:600}h2{margin-top:2.2em;border-top:1px solid #ccc;padding-top:.8em}\
table{border-collapse:collapse;font-size:13px}td,th{padding:2px 9px;text-align:right;white-space:nowrap;\
border-bottom:1px solid #eee}td:first-child,th:first-child{text-align:left}tr.front td{background:\
#eef6ee}tr.default td{font-weight:600}.worse{color:#a33}figure{display:inline-block;margin:4px}\
figcaption{font-size:12px;color:#555}img{max-width:360px;height:auto;display:block}\
svg{max-width:100%;height:auto}";

/// The page.
pub(super) fn page(
    machine: &str,
    subjects: &[(Subject, Thumbnails)],
    scaling: Option<&Scaling>,
) -> String {
    let mut html = format!(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <title>lumigraph: run time against error</title>\
         <link rel=\"icon\" href=\"data:,\"><style>{STYLE}</style></head><body>\n\
         <h1>Run time against error</h1><p>{}</p>\n\
         <p>Each dot is the default with one setting changed (of interiors those of LDIs and warps with these \
         in the portals). Time is the processor's over all threads, for one picture whose photos are decoded: the median of repeats in which all \
         settings took turns. The dashed line joins what nothing beats in both (the Pareto \
         front); the ring marks the default.</p>\n",
        escape(machine)
    );
    for (subject, thumbnails) in subjects {
        section(&mut html, subject, thumbnails);
    }
    if let Some(scaling) = scaling {
        html += &scaling.html();
    }
    html + "</body></html>\n"
}

// Writing to a string cannot fail: results are dropped below.
fn section(html: &mut String, subject: &Subject, thumbnails: &Thumbnails) {
    let verdict = judge(&subject.settings);
    let _ = writeln!(
        html,
        "<h2>{}</h2><p>{}</p>",
        escape(&subject.name),
        escape(&subject.about)
    );
    let _ = writeln!(html, "<p>{}</p>", escape(&verdict.text()));
    for (title, address) in thumbnails {
        let _ = writeln!(
            html,
            "<figure><img src=\"{address}\" alt=\"{0}\"><figcaption>{0}</figcaption></figure>",
            escape(title)
        );
    }
    let _ = writeln!(html, "{}", plot_of(subject, &verdict));
    // Those that no axis of this one can show, too: colours are then those of the plot before.
    let steps: Vec<Dot<'_>> = subject
        .settings
        .iter()
        .map(|m| dot(m, m.steps_from_exact))
        .collect();
    if steps.iter().any(|dot| dot.at.1 > 0.0) {
        let across = Axis {
            title: "CPU ms a picture",
            is_log: true,
        };
        let up = Axis {
            title: subject.steps_title(),
            is_log: true,
        };
        let _ = writeln!(html, "{}", scatter(&steps, &[], &across, &up));
    }
    table(html, subject, &verdict);
    for (name, reason) in &subject.failed {
        let _ = writeln!(html, "<p>{}: {}</p>", escape(name), escape(reason));
    }
    if let Some(start) = &subject.start_up {
        let _ = writeln!(
            html,
            "<p>Start-up, wall ms: reading {}, exposures {}, fitting {}, preparing {}, drawing \
             with decoding {}; decoding alone the {} photos that the picture uses takes {}.</p>",
            round(start.read_ms),
            round(start.exposure_ms),
            round(start.fit_ms),
            round(start.prepare_ms),
            round(start.draw_ms),
            start.photos_used,
            round(start.decode_ms)
        );
    }
    if !subject.skips.is_empty() {
        *html += "<table><tr><th>left out</th><th>what</th><th>CPU ms</th><th>without leaving it \
                  out</th><th>ratio</th><th>bytes</th></tr>";
        for skip in &subject.skips {
            let same = if skip.same_bytes {
                "the same"
            } else {
                "OTHERS"
            };
            // Writing to a string cannot fail.
            let _ = writeln!(
                html,
                "<tr><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{:.2}</td><td>{same}</td></tr>",
                skip.name,
                skip.fired.as_deref().unwrap_or("nothing"),
                round(skip.with.cpu_ms),
                round(skip.without.cpu_ms),
                skip.ratio(),
            );
        }
        *html += "</table>";
    }
}

fn dot(measured: &Measured, up: f64) -> Dot<'_> {
    Dot {
        name: &measured.name,
        family: &measured.knob,
        at: (measured.frame.cpu_ms, up),
        is_default: measured.is_default(),
    }
}

fn plot_of(subject: &Subject, verdict: &Verdict) -> String {
    let dots: Vec<Dot<'_>> = subject.settings.iter().map(|m| dot(m, m.psnr)).collect();
    let across = Axis {
        title: "CPU ms a picture",
        is_log: true,
    };
    let up = Axis {
        title: subject.psnr_title(),
        is_log: false,
    };
    scatter(&dots, &verdict.front, &across, &up)
}

fn table(html: &mut String, subject: &Subject, verdict: &Verdict) {
    let _ = writeln!(
        html,
        "<table><tr><th>setting</th><th>CPU ms</th><th>least to most</th><th>wall ms</th>\
         <th>first, wall ms</th><th>memory, MB</th><th>images</th><th>PSNR, dB</th><th>SSIM</th>\
         <th>coverage</th><th>holes</th><th>steps from exact</th><th>dB to exact</th></tr>"
    );
    for (i, m) in subject.settings.iter().enumerate() {
        let on_front = verdict.front.contains(&i);
        let class = match (on_front, m.is_default()) {
            (_, true) => "default",
            (true, false) => "front",
            (false, false) => "",
        };
        let _ = writeln!(
            html,
            "<tr class=\"{class}\"><td>{}</td><td>{}</td><td>{} to {}</td><td>{}</td><td>{}</td>\
             <td>{}</td><td>{}</td><td>{:.2}</td><td>{:.4}</td><td>{:.4}</td><td>{}</td>\
             <td>{}</td><td>{}</td></tr>",
            escape(&m.name),
            round(m.frame.cpu_ms),
            round(m.cpu_ms_range[0]),
            round(m.cpu_ms_range[1]),
            round(m.frame.wall_ms),
            round(m.first.wall_ms),
            round(m.image_bytes as f64 / 1e6),
            m.images_made,
            m.psnr,
            m.ssim,
            m.coverage,
            m.holes
                .map_or_else(|| "-".to_owned(), |h| format!("{:.3} %", 100.0 * h)),
            round(m.steps_from_exact),
            if m.steps_from_exact > 0.0 {
                round(m.psnr_to_exact)
            } else {
                "-".to_owned()
            },
        );
    }
    let _ = writeln!(html, "</table>");
}
