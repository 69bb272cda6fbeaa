//! Running COLMAP, a script in its place: what it is told, and what is made of it.

use crate::synthetic::small;
use calibrate::ModelKind;
use calibrate::colmap::run::{self, Event, Matching, Options, RunError, Step, Why};
use calibrate::colmap::write_binary;
use calibrate::{ImageId, Reconstruction};
use capture::{PhotoSet, Tool, ToolError};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// Writes down each call; says what lies in `help-COMMAND` and `say-COMMAND`, fails where
/// there is `fail-COMMAND` (unless told an angle), and makes of the mapper's output a copy of `models`.
/// Told an angle it takes `say-close-COMMAND`, `fail-close-COMMAND` and `close-models` where they are.
const SCRIPT: &str = r#"#!/bin/sh
here=$(dirname "$0")
if [ "$1" = help ]; then echo 'COLMAP 3.8 -- a script'; exit; fi
if [ "$2" = -h ]; then cat "$here/help-$1" 2>/dev/null; exit; fi
echo "$*" >>"$here/calls"
close=
case "$*" in *tri_angle*) close=close- ;; esac
cat "$here/say-$close$1" 2>/dev/null
if [ -e "$here/fail-$close$1" ]; then echo 'no luck' >&2; exit 1; fi
if [ "$1" = feature_extractor ]; then echo features >"$3"; fi
if [ "$1" = mapper ]; then
    while [ "$1" != --output_path ]; do shift; done
    models=$here/${close}models
    if [ ! -e "$models" ]; then models=$here/models; fi
    cp -r "$models/." "$2"
fi
"#;

const FEATURES_LOG: &str = "\
Processed file [1/8]
  Name:            f3.jpg
  Features:        5605
Processed file [2/8]
  Name:            f1.jpg
  Features:        801
Processed file [3/8]
  Name:            f2.jpg
  Features:        802
Processed file [4/8]
  Name:            f4.jpg
  ERROR: Failed to read image file format.
Processed file [5/8]
  Name:            f5.jpg
  Features:        3
Processed file [6/8]
  Name:            f6.jpg
  Features:        900
Processed file [7/8]
  Name:            f7.jpg
  Features:        900
Processed file [8/8]
  Name:            f8.jpg
  Features:        900
";

/// Ids by the order above, but for f4: f3 is 1, f1 2, f2 3, f5 4, f6 5, f7 6, f8 7.
const MAPPING_LOG: &str = "\
Initializing with image pair #1 and #2
Registering image #3 (3)
Registering image #6 (4)
  => Could not register, trying another image.
";

struct Bench {
    folder: TempDir,
    options: Options,
    events: Vec<Event>,
}

impl Bench {
    /// Eight photos, and a COLMAP that places three of them in one model and another in a
    /// second.
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let bench = Self {
            folder,
            options: Options {
                matching: Matching::Exhaustive,
                shared_camera: true,
                lens: ModelKind::SimpleRadial,
            },
            events: Vec::new(),
        };
        fs::create_dir(bench.at("photos")).unwrap();
        for i in 1..=8 {
            bench.write(&format!("photos/f{i}.jpg"), &format!("photo {i}"));
        }
        bench.write("colmap", SCRIPT);
        fs::set_permissions(bench.at("colmap"), fs::Permissions::from_mode(0o755)).unwrap();
        bench.write("say-feature_extractor", FEATURES_LOG);
        bench.write(
            "say-exhaustive_matcher",
            "Matching block [1/1, 1/1] in 2s\n",
        );
        bench.write("say-mapper", MAPPING_LOG);
        let option = "  --SiftExtraction.use_gpu arg (=1)\n";
        bench.write("help-feature_extractor", option);
        bench.write(
            "help-exhaustive_matcher",
            "  --SiftMatching.use_gpu arg (=1)\n",
        );
        bench.model("0", &[(5, "f6.jpg"), (9, "f9.jpg")]);
        bench.model("1", &[(1, "f3.jpg"), (2, "f1.jpg"), (3, "f2.jpg")]);
        bench
    }

    fn at(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    fn write(&self, path: &str, text: &str) {
        fs::write(self.at(path), text).unwrap();
    }

    fn model(&self, folder: &str, images: &[(u32, &str)]) {
        let mut model = Reconstruction {
            points: [].into(),
            ..small()
        };
        let mut pattern = model.images.pop_first().unwrap().1;
        pattern.keypoints.clear();
        model.images.clear();
        for &(id, name) in images {
            pattern.name = name.to_owned();
            model.images.insert(ImageId(id), pattern.clone());
        }
        write_binary(&model, &self.at("models").join(folder)).unwrap();
    }

    fn run(&mut self) -> Result<run::Outcome, RunError> {
        let colmap = Tool {
            program: self.at("colmap"),
            ..run::colmap()
        };
        let photos = PhotoSet::open(&self.at("photos")).unwrap();
        self.events.clear();
        let events = &mut self.events;
        run::run(
            &colmap,
            &photos,
            &self.folder.path().join("work"),
            &self.options,
            &mut |event| events.push(event),
        )
    }

    /// The commands since the last time, options included.
    fn calls(&self) -> Vec<String> {
        let calls = fs::read_to_string(self.at("calls")).unwrap_or_default();
        let _ = fs::remove_file(self.at("calls"));
        let here = format!("{}/", self.folder.path().display());
        calls.lines().map(|l| l.replace(&here, "")).collect()
    }

    /// The commands alone.
    fn commands(&self) -> Vec<String> {
        let first = |call: &String| call.split(' ').next().unwrap_or_default().to_owned();
        self.calls().iter().map(first).collect()
    }
}

#[test]
fn the_steps_and_their_options() {
    let mut bench = Bench::new();
    bench.run().unwrap();
    assert_eq!(
        bench.calls(),
        [
            "feature_extractor --database_path work/database.db --image_path photos \
             --image_list_path work/photos.txt --ImageReader.camera_model SIMPLE_RADIAL \
             --ImageReader.single_camera 1 --SiftExtraction.use_gpu 0",
            "exhaustive_matcher --database_path work/database.db --SiftMatching.use_gpu 0",
            "mapper --database_path work/database.db --image_path photos \
             --output_path work/sparse.partial",
        ]
    );
    let list = fs::read_to_string(bench.at("work/photos.txt")).unwrap();
    assert!(list.starts_with("f1.jpg\nf2.jpg\n"), "{list}");
    let progress = |step, done, total| Event::Progress { step, done, total };
    let mut expected = vec![progress(Step::Features, 0, 8)];
    expected.extend((1..=8).map(|i| progress(Step::Features, i, 8)));
    expected.extend([
        progress(Step::Matching, 0, 8),
        progress(Step::Matching, 1, 1),
        progress(Step::Mapping, 0, 8),
        progress(Step::Mapping, 3, 8),
        progress(Step::Mapping, 4, 8),
    ]);
    assert_eq!(bench.events, expected);

    let mut bench = Bench::new();
    bench.options.matching = Matching::Sequential;
    bench.options.shared_camera = false;
    bench.write(
        "help-feature_extractor",
        "--FeatureExtraction.use_gpu arg (=1)",
    );
    bench.write("help-mapper", "--Mapper.min_model_size arg (=10)");
    bench.run().unwrap();
    let calls = bench.calls();
    assert!(
        calls[0].ends_with("SIMPLE_RADIAL --FeatureExtraction.use_gpu 0"),
        "{calls:?}"
    );
    assert!(calls[1].starts_with("sequential_matcher "), "{calls:?}");
    assert!(calls[2].ends_with("--Mapper.min_model_size 3"), "{calls:?}");
}

#[test]
fn the_largest_model_counts_and_the_other_photos_have_reasons() {
    let mut bench = Bench::new();
    let made = bench.run().unwrap();
    assert_eq!(made.model, bench.at("work/sparse/1"));
    assert_eq!(made.reconstruction.images.len(), 3);
    let unplaced: Vec<(&str, Why)> = made
        .unplaced
        .iter()
        .map(|photo| (photo.name.as_str(), photo.why.clone()))
        .collect();
    let unreadable = Why::Unreadable("Failed to read image file format.".to_owned());
    let expected = [
        ("f4.jpg", unreadable),
        ("f5.jpg", Why::FewFeatures(3)),
        ("f6.jpg", Why::OtherModel(2)),
        ("f7.jpg", Why::NoPlace),
        ("f8.jpg", Why::FewMatches),
    ];
    assert_eq!(unplaced, expected);

    // Where COLMAP counts otherwise than its log says, nothing is made up.
    bench.model("1", &[(2, "f3.jpg"), (1, "f1.jpg"), (3, "f2.jpg")]);
    fs::remove_dir_all(bench.at("work")).unwrap();
    let made = bench.run().unwrap();
    assert_eq!(made.unplaced[3].why, Why::Unknown);
    assert_eq!(made.unplaced[4].why, Why::Unknown);
}

#[test]
fn finished_steps_are_not_repeated() {
    let mut bench = Bench::new();
    bench.write("fail-exhaustive_matcher", "");
    let error = bench.run().unwrap_err().to_string();
    assert!(error.contains("start again to go on"), "{error}");
    assert_eq!(
        bench.commands(),
        ["feature_extractor", "exhaustive_matcher"]
    );
    fs::remove_file(bench.at("fail-exhaustive_matcher")).unwrap();
    bench.run().unwrap();
    assert_eq!(bench.commands(), ["exhaustive_matcher", "mapper"]);
    assert_eq!(bench.events[0], Event::Finished(Step::Features));
    bench.run().unwrap();
    assert_eq!(bench.commands(), [""; 0]);
    assert_eq!(bench.events, Step::ALL.map(Event::Finished));
}

#[test]
fn a_damaged_model_is_made_anew() {
    let mut bench = Bench::new();
    bench.write("models/1/images.bin", "");
    for _ in 0..2 {
        let error = bench.run().unwrap_err().to_string();
        assert!(
            error.ends_with("; started again, it places photos anew"),
            "{error}"
        );
        assert!(bench.commands().contains(&"mapper".to_owned()));
    }
    bench.model("1", &[(1, "f3.jpg"), (2, "f1.jpg"), (3, "f2.jpg")]);
    assert_eq!(bench.run().unwrap().reconstruction.images.len(), 3);
    assert_eq!(bench.commands(), ["mapper"]);
    // So is one that was damaged later.
    bench.write("work/sparse/1/images.bin", "");
    bench.run().unwrap_err();
    assert_eq!(bench.commands(), [""; 0]);
    bench.run().unwrap();
    assert_eq!(bench.commands(), ["mapper"]);
}

#[test]
fn a_locked_database_is_told_from_other_failures() {
    let mut bench = Bench::new();
    // As of an import that was killed, whose COLMAP is still at work; some COLMAPs tell where they were.
    let said =
        "Matching block [1/2, 1/1]\nSQLite error: database is locked\n*** Aborted at 17 ***\n";
    let stack: String = (0..12).map(|i| format!("    @     0x{i} main\n")).collect();
    bench.write("say-exhaustive_matcher", &format!("{said}{stack}"));
    bench.write("fail-exhaustive_matcher", "");
    let error = bench.run().unwrap_err().to_string();
    assert!(
        error.contains("another COLMAP is at work on this database"),
        "{error}"
    );
    assert!(
        error.ends_with("or end it, then start again to go on"),
        "{error}"
    );
    // What the log has of an earlier time is over.
    bench.write("say-exhaustive_matcher", "Matching block [1/2, 1/1]\n");
    let error = bench.run().unwrap_err().to_string();
    assert!(
        error.contains("check that memory and disk suffice"),
        "{error}"
    );
    assert!(!error.contains("another COLMAP"), "{error}");
}

#[test]
fn an_interrupted_step_leaves_nothing_that_counts() {
    let mut bench = Bench::new();
    // The first step: of its database nothing is kept, or the camera would be made twice.
    bench.write("fail-feature_extractor", "");
    bench.run().unwrap_err();
    bench.write("work/database.db", "half");
    bench.write("work/database.db-wal", "more");
    fs::remove_file(bench.at("fail-feature_extractor")).unwrap();
    // The last: models in the folder of partial ones are of no use.
    bench.write("fail-mapper", "");
    bench.run().unwrap_err();
    let database = fs::read_to_string(bench.at("work/database.db")).unwrap();
    assert_eq!(database, "features\n");
    assert!(!bench.at("work/database.db-wal").exists());
    fs::create_dir_all(bench.at("work/sparse.partial/7")).unwrap();
    fs::remove_file(bench.at("fail-mapper")).unwrap();
    bench.calls();
    bench.run().unwrap();
    assert_eq!(bench.commands(), ["mapper"]);
    assert!(!bench.at("work/sparse/7").exists() && !bench.at("work/sparse.partial").exists());
}

#[test]
fn other_photos_or_options_start_over() {
    let mut bench = Bench::new();
    bench.run().unwrap();
    let all = bench.commands();
    let again = |bench: &mut Bench| {
        bench.run().unwrap();
        assert_eq!(bench.events[0], Event::StartingOver);
        assert_eq!(bench.commands().len(), all.len());
    };
    bench.write("photos/f2.jpg", "another photo 2");
    again(&mut bench);
    bench.write("photos/g.jpg", "one more");
    again(&mut bench);
    bench.options.lens = ModelKind::OpenCv;
    again(&mut bench);

    fs::remove_dir_all(bench.at("work")).unwrap();
    fs::create_dir(bench.at("work")).unwrap();
    bench.write("work/thesis.txt", "years of work");
    let error = bench.run().unwrap_err().to_string();
    assert!(error.contains("something other than"), "{error}");
    assert!(bench.at("work/thesis.txt").is_file());
}

#[test]
fn a_folder_that_holds_anything_of_others_is_not_emptied() {
    // A record of somebody else's.
    for record in ["", "{}", "{\"inputs\": 3, \"finished\": []}"] {
        let mut bench = Bench::new();
        fs::create_dir(bench.at("work")).unwrap();
        bench.write("work/run.json", record);
        let error = bench.run().unwrap_err().to_string();
        assert!(error.contains("something other than"), "{error}");
        let left = fs::read_to_string(bench.at("work/run.json")).unwrap();
        assert_eq!(left, record);
    }

    // Something beside an earlier run's work.
    let mut bench = Bench::new();
    bench.run().unwrap();
    bench.write("work/precious.png", "a picture");
    bench.write("photos/g.jpg", "one more");
    let error = bench.run().unwrap_err().to_string();
    assert!(error.contains("something other than"), "{error}");
    assert!(bench.at("work/precious.png").is_file() && bench.at("work/sparse/1").is_dir());
    // All that runs leave, interrupted ones too, goes.
    fs::remove_file(bench.at("work/precious.png")).unwrap();
    bench.write("work/database.db-wal", "more");
    bench.write("work/run.tmp", "half");
    fs::create_dir(bench.at("work/sparse.partial")).unwrap();
    bench.run().unwrap();
    assert_eq!(bench.events[0], Event::StartingOver);
    assert!(!bench.at("work/run.tmp").exists());
}

#[test]
fn photos_that_lie_close_are_placed_at_the_second_try() {
    let none = "  => No good initial image pair found.\n".to_owned();
    // Where it began with a pair that led nowhere, too.
    for said in [none.clone(), MAPPING_LOG.to_owned() + &none] {
        let mut bench = Bench::new();
        bench.write("say-mapper", &said);
        bench.write("help-mapper", "--Mapper.init_min_tri_angle arg (=16)");
        bench.write("fail-mapper", "");
        bench.run().unwrap();
        let calls = bench.calls();
        assert_eq!(calls.len(), 4, "{calls:?}");
        assert_eq!(
            calls[3],
            calls[2].clone() + " --Mapper.init_min_tri_angle 4"
        );
        assert!(bench.events.contains(&Event::PhotosAreClose));
    }

    // Not where COLMAP failed for another reason, or cannot be told.
    for (said, help) in [
        (MAPPING_LOG, "--Mapper.init_min_tri_angle"),
        (none.as_str(), "--Mapper.num_threads"),
    ] {
        let mut bench = Bench::new();
        bench.write("say-mapper", said);
        bench.write("help-mapper", help);
        bench.write("fail-mapper", "");
        bench.run().unwrap_err();
        assert_eq!(bench.calls().len(), 3);
    }
}

#[test]
fn of_two_models_of_few_photos_the_larger_is_kept() {
    let four = [(1, "f3.jpg"), (2, "f1.jpg"), (3, "f2.jpg"), (5, "f6.jpg")];
    // The second try places four photos, then none, where the first placed three of eight.
    for placed in [&four[..], &[]] {
        let mut bench = Bench::new();
        bench.write("help-mapper", "--Mapper.init_min_tri_angle arg (=16)");
        if placed.is_empty() {
            bench.write("fail-close-mapper", "");
        } else {
            fs::create_dir(bench.at("close-models")).unwrap();
            bench.model("../close-models/0", placed);
        }
        bench.write(
            "say-close-mapper",
            "Initializing with image pair #1 and #5\n",
        );
        let made = bench.run().unwrap();
        let calls = bench.calls();
        assert_eq!(calls.len(), 4, "{calls:?}");
        assert!(calls[3].ends_with("--Mapper.init_min_tri_angle 4"));
        assert!(bench.events.contains(&Event::PhotosAreClose));

        // What the kept try said is why photos have no place.
        let kept = made.reconstruction.images.len();
        assert_eq!(kept, placed.len().max(3));
        let why = |name: &str| made.unplaced.iter().find(|p| p.name == name).unwrap();
        let is_second = !placed.is_empty();
        let expected = if is_second {
            Why::FewMatches
        } else {
            Why::NoPlace
        };
        assert_eq!(why("f7.jpg").why, expected);
        let left = ["sparse.second", "sparse.partial", "mapping.second.log"];
        assert!(
            left.iter()
                .all(|name| !bench.at("work").join(name).exists())
        );
        bench.run().unwrap();
        assert_eq!(bench.commands(), [""; 0]);
    }

    // More than half are not few.
    let mut bench = Bench::new();
    bench.write("help-mapper", "--Mapper.init_min_tri_angle arg (=16)");
    bench.model("1", &four);
    bench.run().unwrap();
    assert_eq!(bench.calls().len(), 3);
}

#[test]
fn failures_say_what_may_help() {
    let mut bench = Bench::new();
    bench.write("fail-mapper", "");
    let error = bench.run().unwrap_err().to_string();
    let log = bench.at("work/mapping.log").display().to_string();
    for part in [
        "`colmap mapper` failed",
        log.as_str(),
        "    no luck",
        "need overlap",
    ] {
        assert!(error.contains(part), "{error}");
    }
    fs::remove_file(bench.at("fail-mapper")).unwrap();
    fs::remove_dir_all(bench.at("models/0")).unwrap();
    fs::remove_dir_all(bench.at("models/1")).unwrap();
    assert!(matches!(bench.run(), Err(RunError::NoModel { .. })));

    fs::remove_file(bench.at("colmap")).unwrap();
    let error = bench.run().unwrap_err();
    assert!(matches!(error, RunError::Tool(ToolError::Missing { .. })));
    assert!(
        error.to_string().contains("apt-get install colmap"),
        "{error}"
    );
    for i in 2..=8 {
        fs::remove_file(bench.at(&format!("photos/f{i}.jpg"))).unwrap();
    }
    let error = bench.run().unwrap_err().to_string();
    assert!(error.contains("one photo only"), "{error}");
}

#[test]
fn options_follow_from_the_photos() {
    let folder = tempfile::tempdir().unwrap();
    let options = |is_video| {
        let photos = PhotoSet::open(folder.path()).unwrap();
        Options::for_photos(&photos, is_video).unwrap()
    };
    let add = |name: &str, width: u32| {
        let path: &Path = &folder.path().join(name);
        image::GrayImage::new(width, 6).save(path).unwrap();
    };
    for i in 10..29 {
        add(&format!("f{i}.png"), 8);
    }
    let few = Options {
        matching: Matching::Exhaustive,
        shared_camera: true,
        lens: ModelKind::SimpleRadial,
    };
    assert_eq!(options(true), few);
    for i in 29..60 {
        add(&format!("f{i}.png"), 8);
    }
    let many = Options {
        matching: Matching::Sequential,
        lens: ModelKind::OpenCv,
        ..few
    };
    assert_eq!((options(true), options(false)), (many, many));
    add("other.png", 8);
    let matching = Matching::Exhaustive;
    assert_eq!(options(false), Options { matching, ..many });
    assert_eq!(options(true), many);
    add("other.png", 6);
    assert_eq!(
        options(false),
        Options {
            shared_camera: false,
            ..few
        }
    );
}
