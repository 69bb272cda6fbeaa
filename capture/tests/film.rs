//! A film with a relative path: a test alone in its process, whose working folder it changes.

#![cfg(unix)]

use capture::video;

#[test]
fn a_film_may_have_a_colon_in_its_name() {
    if let Err(error) = video::ffmpeg().text(&["-version"]) {
        let required = std::env::var("LUMIGRAPH_REQUIRE_TOOLS").as_deref() == Ok("1");
        assert!(!required, "LUMIGRAPH_REQUIRE_TOOLS is 1, but: {error}");
        eprintln!("SKIPPED: {error}");
        return;
    }
    let here = tempfile::tempdir().unwrap();
    let before = std::env::current_dir().unwrap();
    std::env::set_current_dir(here.path()).unwrap();
    let frames = [0, 80, 160].map(|level| Ok(vec![level; 3 * 16 * 16]));
    // Nothing before the name: ffmpeg takes what stands before the colon for a protocol.
    let made = video::encode("a:b 50%d.mp4".as_ref(), (16, 16), 8.0, frames.into_iter());
    // Or the folder could not be removed everywhere.
    std::env::set_current_dir(before).unwrap();
    made.unwrap();
    let left = std::fs::read_dir(here.path()).unwrap();
    let names: Vec<_> = left.map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["a:b 50%d.mp4"]);
}
