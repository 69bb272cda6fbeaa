//! What README.md and the pages in docs/ give to copy, where they lead, and whether they explain what is
//! printed.

use crate::interior::with_house;
use crate::run::{lumigraph, with_wall};
use proxy::interior::{parse_interior, parse_rooms};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Those for people who use the program.
const PAGES: [&str; 9] = [
    "README.md",
    "docs/accuracy.md",
    "docs/files.md",
    "docs/interiors.md",
    "docs/ldi.md",
    "docs/measuring.md",
    "docs/photos.md",
    "docs/rendering.md",
    "docs/window.md",
];
/// Those for people who change it.
const OTHERS: [&str; 4] = [
    "ARCHITECTURE.md",
    "benches/README.md",
    "fuzz/README.md",
    "tests/README.md",
];

fn in_tree(page: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(page)
}

fn read(page: &str) -> String {
    std::fs::read_to_string(in_tree(page)).unwrap_or_else(|e| panic!("{page}: {e}"))
}

fn all_pages() -> String {
    PAGES.map(read).concat()
}

#[test]
fn examples_of_interiors_and_rooms_have_nothing_odd() {
    let pages = all_pages();
    let blocks = pages.split("```json\n").skip(1);
    let blocks = blocks.map(|rest| rest.split("```").next().unwrap_or_default());
    let (mut interiors, mut rooms) = (0, 0);
    for block in blocks {
        let bytes = block.as_bytes();
        let read = if block.contains("\"portals\": [") {
            interiors += 1;
            parse_interior(Path::new("interior.json"), bytes)
        } else if block.contains("\"openings\": [") {
            rooms += 1;
            parse_rooms(Path::new("rooms.json"), bytes, "house.glb")
        } else {
            continue;
        };
        let (_, warnings) = read.unwrap();
        assert!(warnings.is_empty(), "{warnings:?}: {block}");
    }
    assert_eq!((interiors, rooms), (1, 1));
}

#[test]
fn reports_have_no_key_that_is_not_explained() {
    let pages = all_pages();
    let unknown = |objects: &[&Value]| {
        let keys = objects.iter().flat_map(|o| o.as_object().unwrap().keys());
        let unknown = keys.filter(|key| !pages.contains(&format!("`{key}`")));
        unknown.cloned().collect::<Vec<String>>()
    };
    let folder = with_wall();
    let line = "render wall --proxy plane --path sweep --frames 1 --size 24x18 --max-error 1 --json \
                -o out";
    let render = lumigraph(folder.path(), line).ok().json();
    let (frame, report) = (&render["frames"][0], &render["report"]);
    let all = [
        &render,
        frame,
        &frame["cost"],
        report,
        &report["stages"],
        &report["skipped"],
        &report["cpu_memory"],
        &report["max_error"],
    ];
    assert_eq!(unknown(&all), [""; 0]);
    // What is said to be there is, but for what takes a device, or times.
    let table = pages.split("`report` is of the whole run:").nth(1).unwrap();
    let rows = table.lines().skip_while(|line| !line.starts_with('|'));
    let rows = rows.take_while(|line| line.starts_with('|'));
    let keys = rows.flat_map(|row| row.split('|').nth(1).unwrap().split('`').skip(1).step_by(2));
    let absent = keys.filter(|key| report.get(key).is_none());
    assert_eq!(absent.collect::<Vec<_>>(), ["gpu_memory", "time"]);

    let line = "evaluate wall --proxy plane --size 24x18 --json -o scored";
    let scored = lumigraph(folder.path(), line).ok().json();
    let all = [
        &scored,
        &scored["photos"][0],
        &scored["mean"],
        &scored["report"],
    ];
    assert_eq!(unknown(&all), [""; 0]);

    let folder = with_house();
    let line = "walk house --frames 1 --size 16x12 --portals geometry,ldi --reference-size 8x8 \
                --json -o out";
    let walk = lumigraph(folder.path(), line).ok().json();
    let (kind, report) = (&walk["walks"][0], &walk["report"]);
    let all = [
        &walk,
        kind,
        &kind["frames"][0],
        report,
        &report["references_memory"],
    ];
    assert_eq!(unknown(&all), [""; 0]);
}

#[test]
fn links_lead_somewhere() {
    let mut count = 0;
    for page in PAGES.into_iter().chain(OTHERS) {
        let text = read(page);
        for link in links(&text) {
            if link.contains("://") {
                continue;
            }
            count += 1;
            let (file, heading) = link.split_once('#').unwrap_or((&link, ""));
            let target = match file {
                "" => in_tree(page),
                _ => in_tree(page).parent().unwrap().join(file),
            };
            assert!(target.exists(), "{page}: {link}");
            if !heading.is_empty() {
                let text = std::fs::read_to_string(&target).unwrap();
                let is_there = headings(&text).any(|h| anchor(h) == heading);
                assert!(is_there, "{page}: {link}");
            }
        }
    }
    assert!(count > 40, "{count}");
}

#[test]
fn commands_have_the_options_that_pages_give_them() {
    let mut help: BTreeMap<String, String> = BTreeMap::new();
    let mut count = 0;
    for page in PAGES {
        let text = read(page);
        for line in commands(&text) {
            let mut words = line.split_whitespace();
            let command = words.next().unwrap().to_owned();
            if !command.starts_with(|c: char| c.is_ascii_lowercase()) {
                continue;
            }
            let help = help.entry(command.clone()).or_insert_with(|| {
                let ran = lumigraph(Path::new("."), &format!("{command} --help"));
                assert_eq!(ran.code, 0, "{page}: lumigraph {line}");
                ran.stdout
            });
            for word in words.filter(|word| word.starts_with("--")) {
                let option = word.split(['=', '|', ']']).next().unwrap();
                let is_there = help.split([' ', '\n', '=', '[', ',']).any(|w| w == option);
                assert!(is_there, "{page}: {option} of lumigraph {line}");
                count += 1;
            }
        }
    }
    assert!(count > 50, "{count}");
}

/// Where a page's links lead to.
fn links(text: &str) -> impl Iterator<Item = String> {
    // A link's text may be broken into lines; code has none.
    let parts = text.split("](").skip(1);
    let ends = parts.filter_map(|rest| rest.split_once(')'));
    ends.map(|(link, _)| link.to_owned())
}

fn headings(text: &str) -> impl Iterator<Item = &str> {
    let lines = text.lines().filter(|line| line.starts_with('#'));
    lines.map(|line| line.trim_start_matches('#').trim())
}

/// What a heading is called in links.
fn anchor(heading: &str) -> String {
    let kept = heading.to_lowercase();
    let kept = kept
        .chars()
        .filter(|c| c.is_alphanumeric() || "-_ ".contains(*c));
    kept.map(|c| if c == ' ' { '-' } else { c }).collect()
}

/// What follows `lumigraph` in code: lines of blocks, and what stands within a text.
fn commands(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (i, part) in text.split("```").enumerate() {
        if i % 2 == 1 {
            let lines = part.lines().map(|line| line.split('#').next().unwrap());
            found.extend(lines.map(str::to_owned));
        } else {
            let spans = part.split('`').skip(1).step_by(2);
            found.extend(spans.map(|span| span.replace('\n', " ")));
        }
    }
    let of_program = found.iter().filter_map(|c| c.strip_prefix("lumigraph "));
    of_program.map(str::to_owned).collect()
}
