//! Taking photos out of videos: with ffmpeg itself where it is installed, and with
//! scripts in its place.

use capture::video::{self, Curve, FrameCount, FrameShape, VideoError, VideoProgress};
use capture::{Tool, ToolError};
use image::{ImageBuffer, Rgb, RgbImage, imageops};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::time::Duration;

/// ffmpeg; `None`, said aloud, where it is missing, unless the environment has
/// `LUMIGRAPH_REQUIRE_TOOLS=1`.
fn ffmpeg() -> Option<Tool> {
    let ffmpeg = video::ffmpeg();
    match ffmpeg.text(&["-version"]) {
        Ok(_) => Some(ffmpeg),
        Err(error) if std::env::var("LUMIGRAPH_REQUIRE_TOOLS").as_deref() == Ok("1") => {
            panic!("LUMIGRAPH_REQUIRE_TOOLS is 1, but: {error}")
        }
        Err(error) => {
            eprintln!("SKIPPED: {error}");
            None
        }
    }
}

/// A checked pattern that moves to the right; its colours change softly, as a video keeps
/// colours at half the size, and tell the frames apart.
fn frame(i: u32) -> RgbImage {
    RgbImage::from_fn(320, 240, |x, y| {
        let is_light = ((x + 320 - i) / 10 + y / 10).is_multiple_of(2);
        let level = if is_light { 80 } else { 0 };
        Rgb([170, 20 + 2 * i, y / 3].map(|base| (base + level) as u8))
    })
}

/// A video of 24 frames at 8 a second, of which all but `sharp` are blurred.
fn write_video(ffmpeg: &Tool, folder: &Path, sharp: &[u32], extra: &[&str]) -> PathBuf {
    for i in 0..24 {
        let picture = match sharp.contains(&i) {
            true => frame(i),
            false => imageops::blur(&frame(i), 2.0),
        };
        picture.save(folder.join(format!("{i}.png"))).unwrap();
    }
    let (pictures, video) = (folder.join("%d.png"), folder.join("sweep.mp4"));
    let words = "-y -v error -framerate 8 -start_number 0 -i";
    let mut arguments: Vec<&str> = words.split(' ').collect();
    arguments.push(pictures.to_str().unwrap());
    arguments.extend(extra);
    arguments.extend(["-pix_fmt", "yuv420p", video.to_str().unwrap()]);
    ffmpeg
        .run(&arguments, &folder.join("log"), &mut |_| {})
        .unwrap();
    video
}

#[test]
fn the_sharp_frames_are_taken_with_their_times() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let sharp = [2, 7, 13, 18];
    let video = write_video(&ffmpeg, here.path(), &sharp, &[]);
    let photos = here.path().join("photos");
    let mut scored = 0;
    let mut extract = |count| {
        let mut on_progress = |progress| {
            if let VideoProgress::Scored { frames, .. } = progress {
                scored = frames;
            }
        };
        let shape = FrameShape::Square;
        let frames =
            video::extract(&ffmpeg, &video, count, shape, &photos, &mut on_progress).unwrap();
        (frames, std::mem::take(&mut scored))
    };

    let (frames, scored) = extract(FrameCount::Frames(4));
    assert_eq!(scored, 24);
    let names: Vec<&str> = frames.iter().map(|f| f.name.as_str()).collect();
    assert_eq!(
        names,
        [
            "000000.250s.jpg",
            "000000.875s.jpg",
            "000001.625s.jpg",
            "000002.250s.jpg"
        ]
    );
    for (frame_of_video, i) in frames.iter().zip(sharp) {
        assert!((frame_of_video.time_s - f64::from(i) / 8.0).abs() < 1e-6);
        let photo = photos.join(&frame_of_video.name);
        let pixels = capture::decode(&photo, Some((320, 240))).unwrap();
        let mut off = 0.0;
        for (ours, theirs) in pixels.pixels().zip(frame(i).pixels()) {
            off += (0..3)
                .map(|c| f64::from(ours[c].abs_diff(theirs[c])))
                .sum::<f64>();
        }
        // Both codecs lose a little.
        let mean = off / f64::from(3 * 320 * 240);
        assert!(mean < 4.0, "frame {i}: {mean} levels off");
    }

    // Nothing is done twice; another count is another extraction.
    let before = fs::metadata(photos.join(names[0]))
        .unwrap()
        .modified()
        .unwrap();
    assert_eq!(extract(FrameCount::Frames(4)), (frames.clone(), 0));
    let after = fs::metadata(photos.join(names[0]))
        .unwrap()
        .modified()
        .unwrap();
    assert_eq!(before, after);
    let (three, scored) = extract(FrameCount::Frames(3));
    assert_eq!((three.len(), scored), (3, 24));
    assert_eq!(fs::read_dir(&photos).unwrap().count(), 4, "and frames.txt");
    fs::remove_file(photos.join(&three[1].name)).unwrap();
    assert_eq!(
        extract(FrameCount::Frames(3)),
        (three, 24),
        "one was missing"
    );
}

/// HDV cameras and DVDs store frames that players show wider, or higher.
#[test]
fn frames_are_drawn_out_to_square_pixels_unless_they_are_calibrated_as_stored() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    for (filter, stored) in [
        ("scale=240:240,setsar=4/3", (240, 240)),
        ("scale=320:160,setsar=2/3", (320, 160)),
    ] {
        let video = write_video(&ffmpeg, here.path(), &[2, 18], &["-vf", filter]);
        let photos = here.path().join("photos");
        let extract = |shape: FrameShape| {
            let mut stretched = None;
            let mut on_progress = |progress| {
                if let VideoProgress::Stretched { from, to } = progress {
                    stretched = Some((from, to));
                }
            };
            let count = FrameCount::Frames(2);
            let frames =
                video::extract(&ffmpeg, &video, count, shape, &photos, &mut on_progress).unwrap();
            let size = capture::photo_size(&photos.join(&frames[0].name)).unwrap();
            (size, stretched)
        };
        let shown = (320, 240);
        let drawn_out = (shown, Some((stored, shown)));
        assert_eq!(extract(FrameShape::Square), drawn_out);
        let pixels = capture::decode(&photos.join("000000.250s.jpg"), Some(shown)).unwrap();
        let expected = frame(2);
        let pairs = pixels.pixels().zip(expected.pixels());
        let off: f64 = pairs.map(|(a, b)| f64::from(a[1].abs_diff(b[1]))).sum();
        let mean = off / f64::from(320 * 240);
        assert!(mean < 8.0, "{filter}: {mean} levels off");
        // The same frames, which are there.
        assert_eq!(extract(FrameShape::Calibrated(320, 240)), (shown, None));
        assert_eq!(extract(FrameShape::Stored), (stored, None));
        assert_eq!(extract(FrameShape::Square), drawn_out, "no earlier run's");
        assert_eq!(
            extract(FrameShape::Calibrated(stored.0, stored.1)),
            (stored, None)
        );
    }
}

/// As they were before colours were exact and pixels square.
#[test]
fn frames_of_an_earlier_version_are_taken_again_where_they_would_be_others() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let photos = here.path().join("photos");
    let list = photos.join("frames.txt");
    for (words, is_same) in [
        (
            "-vf scale=out_color_matrix=bt601 -colorspace smpte170m",
            true,
        ),
        ("-vf scale=out_color_matrix=bt709 -colorspace bt709", false),
        ("-vf scale=240:240,setsar=4/3", false),
    ] {
        let words: Vec<&str> = words.split(' ').collect();
        let video = write_video(&ffmpeg, here.path(), &[2, 18], &words);
        let extract = |shape: FrameShape| {
            let (mut is_done, mut is_scanned) = (false, false);
            let count = FrameCount::Frames(2);
            let mut on_progress = |progress| match progress {
                VideoProgress::Done { .. } => is_done = true,
                VideoProgress::Scored { .. } => is_scanned = true,
                _ => {}
            };
            let frames =
                video::extract(&ffmpeg, &video, count, shape, &photos, &mut on_progress).unwrap();
            (frames, is_done, is_scanned)
        };
        let (frames, is_done, _) = extract(FrameShape::Square);
        assert!(!is_done, "{words:?}");
        let text = fs::read_to_string(&list).unwrap();
        let (first, rest) = text.split_once('\n').unwrap();
        let (source, _) = first.split_once(", version 2").unwrap();
        let photo = photos.join(&frames[0].name);
        fs::write(&photo, "as it was").unwrap();
        fs::write(&list, format!("{source}\n{rest}")).unwrap();

        let again = extract(FrameShape::Square);
        assert_eq!(again, (frames.clone(), is_same, true), "{words:?}");
        let is_kept = fs::read(&photo).unwrap() == b"as it was";
        assert_eq!(is_kept, is_same, "{words:?}");
        // Then the list says so, and pixels that are square have no other shape for a calibration.
        assert_eq!(fs::read_to_string(&list).unwrap(), text);
        assert_eq!(extract(FrameShape::Square), (frames, true, false));
        let (_, is_done, _) = extract(FrameShape::Stored);
        assert_eq!(is_done, !words[1].contains("setsar"), "{words:?}");
    }
}

/// As telephones and all of HD have them; rounded down, every channel lost a level.
#[test]
fn colours_of_bt_709_are_not_darkened() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let words = "-vf scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int+full_chroma_inp \
                 -colorspace bt709 -color_primaries bt709 -color_trc bt709 -crf 12";
    let words: Vec<&str> = words.split_whitespace().collect();
    let video = write_video(&ffmpeg, here.path(), &[2, 18], &words);
    let photos = here.path().join("photos");
    let (count, shape) = (FrameCount::Frames(2), FrameShape::Square);
    let frames = video::extract(&ffmpeg, &video, count, shape, &photos, &mut |_| {}).unwrap();
    let pixels = capture::decode(&photos.join(&frames[0].name), Some((320, 240))).unwrap();
    let expected = frame(2);
    let pairs = pixels.pixels().zip(expected.pixels());
    let bias: f64 = pairs.map(|(a, b)| f64::from(a[1]) - f64::from(b[1])).sum();
    let bias = bias / f64::from(320 * 240);
    assert!(bias.abs() < 0.7, "green is off by {bias} levels");
}

/// Which matrix a film's colours are in can be said in some files only.
#[test]
fn films_show_the_colours_of_their_frames_whatever_they_are_called() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let color = [200, 90, 60];
    for name in ["film.mp4", "film.avi", "film.AVI"] {
        let film = here.path().join(name);
        let frames = [(); 3].map(|()| Ok(color.repeat(64 * 64)));
        video::encode(&film, (64, 64), 8.0, frames.into_iter()).unwrap();
        let picture = here.path().join("shown.png");
        let [from, to] = [&film, &picture].map(|path| path.to_str().unwrap());
        let arguments = ["-y", "-v", "error", "-i", from, "-frames:v", "1", to];
        ffmpeg
            .run(&arguments, &here.path().join("log"), &mut |_| {})
            .unwrap();
        let shown = image::open(&picture).unwrap().into_rgb8();
        let middle = shown.get_pixel(32, 32).0;
        let off = (0..3).map(|c| middle[c].abs_diff(color[c])).max();
        assert!(off <= Some(4), "{name}: {middle:?}");
    }
}

/// Each writes a file of its own, and what is there in the end is one of them, whole.
#[test]
fn films_of_one_name_may_be_made_at_once() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let film = here.path().join("film.mp4");
    // Both are at work when either gives its last frame: the first do not fit into a pipe.
    let make = |count: usize, (other, own): (Sender<()>, Receiver<()>)| {
        let frames = (0..count).map(move |i| -> std::io::Result<Vec<u8>> {
            if i == 0 || i == count - 1 {
                // Where the other has failed, it neither hears nor says anything more.
                let _ = other.send(());
                let met = own.recv_timeout(Duration::from_secs(120));
                met.map_err(std::io::Error::other)?;
            }
            Ok(frame(i as u32).into_raw())
        });
        video::encode(&film, (320, 240), 8.0, frames)
    };
    let ((to_long, of_long), (to_short, of_short)) = (channel(), channel());
    std::thread::scope(|scope| {
        let other = scope.spawn(|| make(4, (to_long, of_short)));
        let long = make(9, (to_short, of_long));
        let short = other.join().unwrap();
        assert!(long.is_ok() && short.is_ok(), "{long:?}, {short:?}");
    });
    let frames = video::scan(&ffmpeg, &film, &mut |_| {}).unwrap().len();
    assert!([4, 9].contains(&frames), "{frames}");
    assert_eq!(fs::read_dir(here.path()).unwrap().count(), 1);

    // Where it cannot take its place, it is no log that cannot be written.
    let taken = here.path().join("taken.mp4");
    fs::create_dir(&taken).unwrap();
    let frames = [(); 2].map(|()| Ok(vec![0; 3 * 16 * 16])).into_iter();
    let error = video::encode(&taken, (16, 16), 8.0, frames).unwrap_err();
    let said = "the film is made, but cannot be given its name: ";
    assert!(error.to_string().starts_with(said), "{error}");
    assert_eq!(fs::read_dir(here.path()).unwrap().count(), 2);
}

#[test]
fn a_variable_rate_keeps_its_times() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    // The second half is shown at half the rate.
    let slower = [
        "-vf",
        "setpts='if(lt(N,12),PTS,2*PTS-12/8/TB)'",
        "-fps_mode",
        "vfr",
    ];
    let video = write_video(&ffmpeg, here.path(), &[0], &slower);
    let scored = video::scan(&ffmpeg, &video, &mut |_| {}).unwrap();
    let times: Vec<f64> = scored.iter().map(|f| f.time_s).collect();
    let expected = (0..24).map(|i| f64::from(if i < 12 { i } else { 2 * i - 12 }) / 8.0);
    assert_eq!(times.len(), 24);
    for (time, expected) in times.iter().zip(expected) {
        assert!((time - expected).abs() < 1e-3, "{times:?}");
    }
    let sharpest = scored.iter().map(|f| f.sharpness).fold(0.0, f64::max);
    assert_eq!(scored[0].sharpness, sharpest);
}

#[cfg(unix)]
#[test]
fn hundreds_of_frames_are_taken_into_a_folder_of_any_name() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let video = here.path().join("a:b 50%.mp4");
    let words = "-y -v error -f lavfi -i testsrc=size=64x48:rate=25 -frames:v 260";
    let mut arguments: Vec<&str> = words.split(' ').collect();
    arguments.push(video.to_str().unwrap());
    ffmpeg
        .run(&arguments, &here.path().join("log"), &mut |_| {})
        .unwrap();
    // Neither a number nor a protocol.
    let photos = here.path().join("50%d: 7%").join("a:b%d");
    let count = FrameCount::Frames(130);
    let shape = FrameShape::Square;
    let frames = video::extract(&ffmpeg, &video, count, shape, &photos, &mut |_| {}).unwrap();
    assert_eq!(frames.len(), 130);
    for (i, frame) in (0..).zip(&frames) {
        let stretch_s = 2.0 / 25.0;
        let since_s = frame.time_s - f64::from(i) * stretch_s;
        assert!((-1e-6..stretch_s).contains(&since_s), "{i}: {frame:?}");
        assert!(photos.join(&frame.name).is_file(), "{frame:?}");
    }
    assert_eq!(
        fs::read_dir(&photos).unwrap().count(),
        131,
        "and frames.txt"
    );
}

/// Where the data of each frame are in an .mp4 of one H.264 stream: units with their lengths before
/// them, of which those of types 1 and 5 are slices.
fn slices(file: &[u8]) -> Vec<std::ops::Range<usize>> {
    let number = |at: usize| u32::from_be_bytes(file[at..at + 4].try_into().unwrap()) as usize;
    let name = file.windows(4).position(|four| four == b"mdat").unwrap();
    let (mut at, end) = (name + 4, name - 4 + number(name - 4));
    let mut slices = Vec::new();
    while at < end {
        let unit = at + 4..at + 4 + number(at);
        at = unit.end;
        if matches!(file[unit.start] & 31, 1 | 5) {
            slices.push(unit);
        }
    }
    slices
}

#[test]
fn damaged_frames_are_no_photos_and_what_is_wrong_is_told() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    // A key frame each second.
    let words = "-c:v libx264 -g 8 -keyint_min 8 -sc_threshold 0 -bf 0 -movflags +faststart";
    let words: Vec<&str> = words.split(' ').collect();
    let whole = write_video(&ffmpeg, here.path(), &[2, 10, 12, 18], &words);
    let bytes = fs::read(whole).unwrap();
    let slices = slices(&bytes);
    assert_eq!(slices.len(), 24);
    let with_damage = |name: &str, frames: &[usize]| {
        let mut bytes = bytes.clone();
        for slice in frames.iter().map(|i| slices[*i].clone()) {
            bytes[slice.start + slice.len() / 4..slice.end].fill(0);
        }
        let video = here.path().join(name);
        fs::write(&video, bytes).unwrap();
        video
    };
    let photos = here.path().join("photos");
    let extract = |video: &Path| {
        let mut told = Vec::new();
        let (count, shape) = (FrameCount::Frames(3), FrameShape::Square);
        let frames = video::extract(&ffmpeg, video, count, shape, &photos, &mut |at| {
            if let VideoProgress::Damaged(damage) = at {
                told.push(damage);
            }
        });
        (frames, told)
    };

    // 1. From the damaged frame to the next key frame, whichever are sharp.
    let (frames, told) = extract(&with_damage("damaged.mp4", &[10]));
    let times: Vec<f64> = frames.unwrap().iter().map(|f| f.time_s * 8.0).collect();
    assert_eq!((times[0].round(), times[2].round()), (2.0, 18.0));
    assert!(times[1] < 9.5, "{times:?}");
    assert_eq!((told.len(), told[0].frames), (1, 6), "{told:?}");
    assert!(told[0].errors > 0 && !told[0].first.is_empty(), "{told:?}");

    // 2. The end is missing.
    let cut_off = here.path().join("cut-off.mp4");
    fs::write(&cut_off, &bytes[..slices[15].start + 20]).unwrap();
    let (frames, told) = extract(&cut_off);
    assert!(frames.unwrap().iter().all(|f| f.time_s < 2.0));
    assert!(told.len() == 1 && told[0].errors > 0, "{told:?}");

    // 3. What is whole is all in the first stretch.
    let (frames, told) = extract(&with_damage("early.mp4", &[2, 8, 16]));
    let times: Vec<f64> = frames.unwrap().iter().map(|f| f.time_s * 8.0).collect();
    assert_eq!(times, [0.0, 1.0]);
    assert_eq!((told.len(), told[0].frames), (1, 22), "{told:?}");

    // 4. Nothing is left.
    let (frames, told) = extract(&with_damage("nothing.mp4", &[0, 8, 16]));
    let error = frames.unwrap_err();
    assert!(
        matches!(error, VideoError::Damaged { whole: 0, .. }),
        "{error}"
    );
    let error = error.to_string();
    assert!(
        error.contains("nothing.mp4: 0 of its 24 frames can be"),
        "{error}"
    );
    assert!(
        error.contains("copy the file again") && told.is_empty(),
        "{error}"
    );
}

/// How much rows differ from those beside them, over how much from those two away: more than one where every other row is of
/// another moment.
fn comb(picture: &RgbImage) -> f64 {
    let apart = |rows: u32| -> f64 {
        let all = (0..picture.height() - 2).flat_map(|y| (0..picture.width()).map(move |x| (x, y)));
        let difference = |(x, y)| {
            let [a, b] = [y, y + rows].map(|y| f64::from(picture.get_pixel(x, y)[0]));
            (a - b).abs()
        };
        all.map(difference).sum()
    };
    apart(1) / apart(2)
}

#[test]
fn interlaced_frames_become_whole_ones() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let at = |name: &str| here.path().join(name).display().to_string();
    for i in 0..24 {
        frame(7 * i % 40).save(at(&format!("{i}.png"))).unwrap();
    }
    let (pictures, video) = (at("%d.png"), at("torn.mpg"));
    let words = format!(
        "-y -v error -framerate 50 -start_number 0 -i {pictures} -vf tinterlace=interleave_top,setfield=tff \
         -flags +ilme+ildct -c:v mpeg2video -q:v 2 -pix_fmt yuv420p {video}"
    );
    let words: Vec<&str> = words.split(' ').collect();
    let log = here.path().join("log");
    ffmpeg.run(&words, &log, &mut |_| {}).unwrap();
    let (photos, video) = (here.path().join("photos"), PathBuf::from(video));
    let mut said = Vec::new();
    let (count, shape) = (FrameCount::Frames(4), FrameShape::Square);
    let mut on_progress = |progress| said.push(progress);
    let frames = video::extract(&ffmpeg, &video, count, shape, &photos, &mut on_progress).unwrap();
    assert!(said.contains(&VideoProgress::Deinterlaced));
    assert_eq!(frames.len(), 4);
    for taken in frames {
        let picture = image::open(photos.join(&taken.name)).unwrap().into_rgb8();
        assert!(comb(&picture) < 1.0, "{}: {}", taken.name, comb(&picture));
    }
    // They are torn as they are stored.
    let whole = at("stored.png");
    let words = format!("-y -v error -i {} -frames:v 1 {whole}", video.display());
    let words: Vec<&str> = words.split(' ').collect();
    ffmpeg.run(&words, &log, &mut |_| {}).unwrap();
    assert!(comb(&image::open(whole).unwrap().into_rgb8()) > 1.3);
}

#[test]
fn what_would_make_wrong_photos_is_refused_and_leaves_nothing() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let whole = write_video(&ffmpeg, here.path(), &[2], &[]);
    let photos = here.path().join("photos");
    let refused = |video: &Path, count| {
        let shape = FrameShape::Square;
        let error = video::extract(&ffmpeg, video, count, shape, &photos, &mut |_| {}).unwrap_err();
        assert!(!photos.exists());
        error
            .to_string()
            .replace(&video.display().to_string(), "VIDEO")
    };
    assert_eq!(
        refused(&whole, FrameCount::PerSecond(0.01)),
        "VIDEO: one frame would be taken of 2.9 s, and photos are two or more; ask for more, by --fps or --frames"
    );
    // Two recordings, one after the other.
    let log = here.path().join("log");
    let part = |name: &str, size: &str| {
        let file = here.path().join(name);
        let words = format!(
            "-y -v error -i {} -vf scale={size} {}",
            whole.display(),
            file.display()
        );
        let words: Vec<&str> = words.split(' ').collect();
        ffmpeg.run(&words, &log, &mut |_| {}).unwrap();
        fs::read(file).unwrap()
    };
    let joined = here.path().join("joined.ts");
    let both = [part("a.ts", "320:240"), part("b.ts", "160:120")].concat();
    fs::write(&joined, both).unwrap();
    let said = refused(&joined, FrameCount::Frames(7));
    assert!(
        said.starts_with("VIDEO: its pictures change in size or kind at "),
        "{said}"
    );
}

/// Colours of which each is a square of the pictures.
const COLORS: [[u8; 3]; 6] = [
    [30, 30, 30],
    [118, 118, 118],
    [200, 200, 200],
    [200, 60, 50],
    [60, 170, 80],
    [70, 90, 210],
];

/// What 16 bits of HLG or PQ store of an sRGB colour whose white is at 203 cd/m², in BT.2020's primaries: by ITU-R
/// BT.2087, BT.2100 and BT.2408.
fn stored(color: [u8; 3], curve: &str) -> [u16; 3] {
    let light = color.map(|code| match f64::from(code) / 255.0 {
        c if c <= 0.04045 => c / 12.92,
        c => ((c + 0.055) / 1.055).powf(2.4),
    });
    let rows = [
        [0.6274, 0.3293, 0.0433],
        [0.0691, 0.9195, 0.0114],
        [0.0164, 0.0880, 0.8956],
    ];
    let dot = |row: [f64; 3]| (0..3).map(|k| row[k] * light[k]).sum::<f64>() * 203.0;
    let shown = rows.map(dot);
    let luminance = 0.2627 * shown[0] + 0.6780 * shown[1] + 0.0593 * shown[2];
    let code = |shown: f64| match curve {
        "smpte2084" => {
            let power = (shown / 10_000.0).powf(2610.0 / 16384.0);
            ((0.8359375 + 18.8515625 * power) / (1.0 + 18.6875 * power)).powf(78.84375)
        }
        _ => {
            let scene = shown / 1000.0 * (luminance / 1000.0).powf(1.0 / 1.2 - 1.0);
            match scene <= 1.0 / 12.0 {
                true => (3.0 * scene).sqrt(),
                false => 0.17883277 * (12.0 * scene - 0.28466892).ln() + 0.55991073,
            }
        }
    };
    shown.map(|shown| (code(shown) * 65535.0).round() as u16)
}

#[test]
fn a_high_dynamic_range_is_brought_to_that_of_photos() {
    let Some(ffmpeg) = ffmpeg() else { return };
    for (curve, said) in [
        ("arib-std-b67", Some(Curve::Hlg)),
        ("smpte2084", Some(Curve::Pq)),
        ("bt709", None),
    ] {
        // What filters' texts are made of, in the path.
        let home = tempfile::tempdir().unwrap();
        let here = home.path().join("it's [a], b:c;d");
        fs::create_dir(&here).unwrap();
        let at = |x: u32| COLORS[(x / 64).min(5) as usize];
        for i in 0..8 {
            let picture: ImageBuffer<Rgb<u16>, _> = ImageBuffer::from_fn(384, 64, |x, y| {
                // What moves, for frames to differ.
                let is_mark = (8 * i..8 * i + 8).contains(&y) && x % 64 < 8;
                Rgb(stored(if is_mark { [90; 3] } else { at(x) }, curve))
            });
            picture.save(here.join(format!("{i}.png"))).unwrap();
        }
        let video = here.join("film.mkv");
        let tagged = format!(
            "-vf scale=out_color_matrix=bt2020:out_range=tv,format=yuv444p10le -c:v ffv1 -color_range tv -color_trc \
             {curve} -colorspace bt2020nc -color_primaries bt2020"
        );
        let pictures = here.join("%d.png");
        let mut words: Vec<&str> = "-y -v error -framerate 8 -start_number 0 -i"
            .split(' ')
            .collect();
        words.push(pictures.to_str().unwrap());
        words.extend(tagged.split(' '));
        words.push(video.to_str().unwrap());
        ffmpeg.run(&words, &here.join("log"), &mut |_| {}).unwrap();
        let mut told = None;
        let mut on_progress = |progress| match progress {
            VideoProgress::HighDynamicRange(curve) => told = Some(curve),
            VideoProgress::Deinterlaced => panic!("frames are whole"),
            _ => {}
        };
        let (count, shape) = (FrameCount::Frames(2), FrameShape::Square);
        let photos = here.join("photos");
        let frames =
            video::extract(&ffmpeg, &video, count, shape, &photos, &mut on_progress).unwrap();
        assert_eq!(told, said, "{curve}");
        let left = fs::read_dir(&photos).unwrap().count();
        assert_eq!(left, frames.len() + 1, "frames and their list");
        let picture = image::open(photos.join(&frames[0].name))
            .unwrap()
            .into_rgb8();
        for (k, color) in (0..).zip(COLORS) {
            let shown = picture.get_pixel(64 * k + 32, 32).0;
            let off = (0..3).map(|c| shown[c].abs_diff(color[c])).max().unwrap();
            if said.is_some() {
                assert!(off <= 3, "{curve}: {shown:?} for {color:?}");
            }
        }
    }
}

#[test]
fn what_is_no_video_is_refused() {
    let Some(ffmpeg) = ffmpeg() else { return };
    let here = tempfile::tempdir().unwrap();
    let photos = here.path().join("photos");
    let error = |file: &str| {
        let file = here.path().join(file);
        let count = FrameCount::Auto;
        let shape = FrameShape::Square;
        video::extract(&ffmpeg, &file, count, shape, &photos, &mut |_| {}).unwrap_err()
    };
    fs::write(here.path().join("notes.mp4"), "no video").unwrap();
    assert!(matches!(error("notes.mp4"), VideoError::Decode { .. }));
    assert!(matches!(error("gone.mp4"), VideoError::Read { .. }));
    frame(0).save(here.path().join("a.png")).unwrap();
    assert!(matches!(
        error("a.png"),
        VideoError::NoVideo { frames: 1, .. }
    ));
    // Of which ffmpeg draws the letters, frame by frame.
    let lines: Vec<String> = (0..400).map(|i| format!("photo number {i}\n")).collect();
    fs::write(here.path().join("list.txt"), lines.concat()).unwrap();
    assert!(matches!(error("list.txt"), VideoError::Text { .. }));
    assert!(!photos.exists() && !here.path().join(".photos.partial").exists());
}

#[test]
fn a_missing_program_says_how_to_install_it() {
    let here = tempfile::tempdir().unwrap();
    let gone = Tool {
        program: here.path().join("ffmpeg"),
        ..video::ffmpeg()
    };
    let file = here.path().join("a.mp4");
    fs::write(&file, "").unwrap();
    let photos = here.path().join("photos");
    let (count, shape) = (FrameCount::Auto, FrameShape::Square);
    let error = video::extract(&gone, &file, count, shape, &photos, &mut |_| {}).unwrap_err();
    assert!(matches!(error, VideoError::Tool(ToolError::Missing { .. })));
    assert!(
        error.to_string().contains("apt-get install ffmpeg"),
        "{error}"
    );
}

#[cfg(unix)]
mod scripts {
    use super::*;
    use std::io::{self, ErrorKind, Write as _};
    use std::os::unix::fs::PermissionsExt;

    fn script(folder: &Path, text: &str) -> Tool {
        let program = folder.join("program");
        fs::write(&program, format!("#!/bin/sh\n{text}\n")).unwrap();
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        Tool {
            program,
            install: "write it",
        }
    }

    #[test]
    fn a_failure_quotes_the_last_lines_and_the_log() {
        let here = tempfile::tempdir().unwrap();
        let tool = script(
            here.path(),
            "for i in 1 2 3 4 5 6 7 8 9; do echo line $i; done; echo; echo bad >&2; exit 3",
        );
        let log = here.path().join("log");
        let mut lines = 0;
        let error = tool.run(&["match"], &log, &mut |_| lines += 1).unwrap_err();
        assert_eq!(lines, 11);
        let quoted: String = (3..=9).map(|i| format!("    line {i}\n")).collect();
        assert_eq!(
            error.to_string(),
            format!(
                "`program match` failed (exit status: 3); the last lines of {}:\n{quoted}    bad",
                log.display()
            )
        );
        // A second run's lines follow the first's.
        tool.run(&["match"], &log, &mut |_| {}).unwrap_err();
        assert_eq!(fs::read_to_string(&log).unwrap().lines().count(), 22);
    }

    #[test]
    fn what_cannot_be_fed_to_a_program_is_not_its_fault() {
        let here = tempfile::tempdir().unwrap();
        let tool = script(here.path(), "cat > /dev/null");
        // By their kinds these could be taken for a program that is missing or does not start.
        for kind in [ErrorKind::NotFound, ErrorKind::Other] {
            let gone = |_| Err(io::Error::new(kind, "b.png: it is gone"));
            let error = tool.feed(&["-"], gone).unwrap_err();
            assert_eq!(
                error.to_string(),
                format!(
                    "what {} was to read is not to be had: b.png: it is gone",
                    tool.program.display()
                )
            );
        }
        tool.feed(&["-"], |mut stdin| stdin.write_all(b"all of it"))
            .unwrap();
    }

    #[test]
    fn an_interrupted_extraction_leaves_the_earlier_one() {
        let here = tempfile::tempdir().unwrap();
        // Scores two frames, then fails to write them.
        let tool = script(
            here.path(),
            "case \"$*\" in
            *long*) echo -fps_mode ;;
            *showinfo*) printf 'P5 1 1 255\\naP5 1 1 255\\nb'
                printf '[showinfo] pts_time:0\\n[showinfo] pts_time:1\\n' >&2 ;;
            *) echo disk full >&2; exit 1 ;;
            esac",
        );
        let video = here.path().join("a.mp4");
        let photos = here.path().join("photos");
        fs::write(&video, "video").unwrap();
        fs::create_dir(&photos).unwrap();
        fs::write(photos.join("earlier.jpg"), "").unwrap();
        let extract = || {
            let (count, shape) = (FrameCount::Auto, FrameShape::Square);
            let frames = video::extract(&tool, &video, count, shape, &photos, &mut |_| {});
            frames.unwrap_err().to_string()
        };
        let error = extract();
        assert!(error.contains("something other than"), "{error}");
        // Nor is a list that somebody else made, or one beside other files, a licence.
        let first = "# Frames(2) of \"b.mp4\", 5 bytes of 6 ns\n";
        for list in ["# of another video\n0 earlier.jpg\n", first] {
            fs::write(photos.join("frames.txt"), list).unwrap();
            let error = extract();
            assert!(error.contains("something other than"), "{error}");
            assert!(photos.join("earlier.jpg").is_file());
        }
        fs::write(photos.join("frames.txt"), format!("{first}0 earlier.jpg\n")).unwrap();
        let error = extract();
        assert!(error.contains("disk full"), "{error}");
        assert!(photos.join("earlier.jpg").is_file());
    }
}
