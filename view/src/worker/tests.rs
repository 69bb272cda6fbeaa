use super::*;
use crate::picture::{Layer, Look};
use calibrate::{Lens, Rigid3, View};
use glam::{DVec2, DVec3};
use image::Rgba;
use proxy::{Plane, Proxy};
use render::{Frame, PhotoStore, SourceView};
use std::sync::mpsc::channel;

fn view(x: f64) -> View {
    let pose = Rigid3::looking_at(DVec3::X * x, DVec3::new(x, 0.0, 4.0), DVec3::NEG_Y);
    View {
        lens: Lens::pinhole(DVec2::splat(40.0), DVec2::new(20.0, 15.0)),
        width: 40,
        height: 30,
        camera_from_world: pose,
    }
}

fn wall(red: u8) -> Arc<Lumigraph> {
    let source = |x: f64| SourceView {
        name: format!("{x}"),
        view: view(x),
        gain: [1.0; 3],
        time_s: None,
        quarters: 0,
    };
    let photo = |red: u8| RgbaImage::from_fn(40, 30, |x, y| Rgba([red, x as u8, y as u8, 255]));
    Arc::new(Lumigraph {
        points: Vec::new(),
        sources: vec![source(-1.0), source(1.0)],
        photos: PhotoStore::from_images(vec![photo(red), photo(red + 50)]),
        proxy: Proxy::Plane(Plane::new(DVec3::new(0.0, 0.0, 4.0), DVec3::Z).unwrap()),
        visibility: None,
    })
}

fn request(id: u64, x: f64) -> Request {
    Request {
        id,
        view: view(x),
        look: Look::default(),
        is_moving: false,
        hover: Some(calibrate::Pixel::new(20.0, 15.0)),
    }
}

fn show(worker: &Worker, red: u8, revision: u64) {
    let content = Content::Scene(wall(red));
    let space = Arc::new(Space::of(&content));
    worker.show(content, space, revision);
}

fn by_cpu(output: PathBuf) -> WorkerOptions {
    WorkerOptions {
        device: DeviceChoice::Cpu,
        gpu_memory: None,
        skips: render::Skips::ALL,
        walk: WalkOptions::default(),
        output,
    }
}

#[test]
fn pictures_are_those_that_render_makes_and_shots_give_them_back() {
    let folder = tempfile::tempdir().unwrap();
    let (send, news) = channel();
    let options = by_cpu(folder.path().join("shots"));
    let mut worker = Worker::start(options, move |news| send.send(news).unwrap());
    // Asked before there is anything: drawn as soon as there is.
    worker.ask(request(1, 0.25));
    show(&worker, 0, 1);
    let wait = || news.recv_timeout(Duration::from_secs(60)).unwrap();
    let News::Shown(shown) = wait() else {
        panic!("a picture");
    };
    // From elsewhere than the first photo there is no preview.
    assert_eq!((shown.id, shown.revision, shown.reduction), (1, 1, 1));
    let support = shown.support.unwrap();
    assert!(support.share() > 0.9, "{support:?}");
    let hover = shown.hover.unwrap();
    assert_eq!(hover.weights[0].0, 1, "the nearer photo first");
    assert!((hover.weights.iter().map(|w| w.1).sum::<f64>() - 1.0).abs() < 1e-9);
    // A new content is drawn without being asked for.
    show(&worker, 100, 2);
    let News::Shown(shown) = wait() else {
        panic!("a picture");
    };
    assert_eq!((shown.id, shown.revision), (1, 2));
    worker.shoot();
    let News::Shot(Ok(Shot { file, note })) = wait() else {
        panic!("a shot");
    };
    assert_eq!(note, "");
    let again = render::path::read(&file).unwrap();
    let lumigraph = wall(100);
    let frame = Frame::new(&lumigraph, again.frames[0].view.clone(), Default::default());
    let mut engine = Engine::open(DeviceChoice::Cpu).unwrap();
    let expected = engine.render(&frame, render::Method::TRIANGULATED).unwrap();
    assert_eq!(image::open(&file).unwrap().into_rgba8(), expected);
    worker.end(Duration::from_secs(10));
}

#[test]
fn a_shot_of_what_is_shown_until_all_is_chosen_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let (send, news) = channel();
    let options = by_cpu(folder.path().to_owned());
    let mut worker = Worker::start(options, move |news| send.send(news).unwrap());
    let meanwhile = "--proxy points --no-exposure";
    let content = Content::Scene(wall(0));
    let mut space = Space::of(&content);
    meanwhile.clone_into(&mut space.meanwhile);
    worker.show(content, Arc::new(space), 1);
    worker.ask(request(1, 0.25));
    let shot = || {
        worker.shoot();
        let mut all = std::iter::from_fn(|| news.recv_timeout(Duration::from_secs(60)).ok());
        let shot = all.find_map(|news| match news {
            News::Shot(shot) => shot.ok(),
            _ => None,
        });
        let shot = shot.unwrap();
        let look = render::path::read_shot_look(&shot.file).unwrap();
        (look.meanwhile, shot.note)
    };
    let (kept, note) = shot();
    assert_eq!(kept, meanwhile);
    assert!(note.ends_with(meanwhile), "{note}");
    // What comes in its place stays.
    show(&worker, 100, 2);
    assert_eq!(shot(), (String::new(), String::new()));
    worker.end(Duration::from_secs(10));
}

#[test]
fn a_shot_that_was_asked_for_is_made_before_the_end() {
    let folder = tempfile::tempdir().unwrap();
    let options = by_cpu(folder.path().join("shots"));
    let mut worker = Worker::start(options.clone(), |_| {});
    show(&worker, 0, 1);
    worker.ask(request(1, 0.25));
    worker.shoot();
    worker.shoot();
    worker.end(Duration::ZERO);
    for name in ["shot_0001.png", "shot_0002.png"] {
        let file = options.output.join(name);
        assert!(render::path::read(&file).is_ok(), "{name}");
    }
    // With nothing to show there is nothing to wait for.
    let mut worker = Worker::start(options, |_| {});
    worker.shoot();
    let start = Instant::now();
    worker.end(Duration::ZERO);
    assert!(start.elapsed() < SHOT_PATIENCE / 2);
}

#[test]
fn a_shot_knows_the_moment_that_it_shows() {
    let folder = tempfile::tempdir().unwrap();
    let options = by_cpu(folder.path().join("shots"));
    let mut timed = wall(0);
    let sources = &mut Arc::get_mut(&mut timed).unwrap().sources;
    sources.iter_mut().for_each(|s| s.time_s = Some(0.25));
    let content = Content::Scene(timed);
    let space = Arc::new(Space::of(&content));
    let mut worker = Worker::start(options.clone(), |_| {});
    worker.show(content, space, 1);
    let mut asked = request(1, 0.25);
    asked.look.moment = Some(render::Moment {
        time_s: 0.5,
        period_s: Some(2.0),
        window_s: None,
    });
    worker.ask(asked);
    worker.shoot();
    worker.end(Duration::ZERO);
    let shot = render::path::read(&options.output.join("shot_0001.png")).unwrap();
    assert_eq!(shot.frames[0].time_s, Some(0.5));
}

#[test]
fn each_note_is_said_once_wherever_it_stands() {
    let (send, news) = channel();
    let tell = move |news| send.send(news).unwrap();
    let mut said = BTreeSet::new();
    let mut heard = |notes: &[&str]| -> Vec<String> {
        say_new(notes, &mut said, &tell);
        let text = |news| match news {
            News::Trouble(text) => text,
            other => panic!("{other:?}"),
        };
        news.try_iter().map(text).collect()
    };
    assert_eq!(heard(&["the device is lost"]), ["the device is lost"]);
    let notes = ["photo a is left out", "the device is lost"];
    assert_eq!(heard(&notes), ["photo a is left out"]);
    assert!(heard(&notes).is_empty());
    let notes = [
        "photo a is left out",
        "photo b is left out",
        "the device is lost",
    ];
    assert_eq!(heard(&notes), ["photo b is left out"]);
}

#[test]
fn the_first_photo_is_there_before_any_other() {
    let lumigraph = wall(0);
    let space = Space::of_scene(&lumigraph);
    let drawer = SceneDrawer::new(&lumigraph, &space, render::Skips::ALL);
    assert!(drawer.preview(&request(1, 0.5)).is_none());
    let shown = drawer.preview(&request(1, 1.0)).unwrap();
    assert_eq!((shown.image.size, shown.reduction), ([20, 15], 2));
    assert_eq!(shown.image.pixels[0].r(), 50);
    assert_eq!(lumigraph.photos.decoded(), 1);
}

#[test]
fn of_photos_that_are_coarse_for_want_of_memory_it_is_said_why() {
    let said = |budget| {
        let mut lumigraph = wall(0);
        let photos = &mut Arc::get_mut(&mut lumigraph).unwrap().photos;
        photos.set_budget(budget);
        let space = Space::of_scene(&lumigraph);
        let mut engine = Engine::open(DeviceChoice::Cpu).unwrap();
        let mut drawer = SceneDrawer::new(&lumigraph, &space, render::Skips::ALL);
        // The second time nothing is prepared.
        let drawn = [1, 2].map(|id| drawer.draw(&mut engine, &request(id, 0.25), 1).unwrap());
        drawn.map(|(_, shown)| shown.skipped)
    };
    for said in said(None) {
        assert!(!said.contains("memory"), "{said}");
    }
    let coarse = "; photos from coarser mip levels, as --cpu-memory is too little";
    for said in said(Some(4000)) {
        assert!(said.ends_with(coarse), "{said}");
    }
}

#[test]
fn photos_cover_as_much_of_a_view_whatever_is_shown_of_it() {
    let lumigraph = wall(0);
    let space = Space::of_scene(&lumigraph);
    let covered = |layer: Layer| {
        let mut engine = Engine::open(DeviceChoice::Cpu).unwrap();
        let mut drawer = SceneDrawer::new(&lumigraph, &space, render::Skips::ALL);
        // The wall goes on where the photos end.
        let mut request = request(1, 3.0);
        request.look.layer = layer;
        let (_, shown) = drawer.draw(&mut engine, &request, 1).unwrap();
        shown.support.unwrap().covered
    };
    let expected = covered(Layer::Picture);
    assert!((0.3..0.7).contains(&expected), "{expected}");
    for layer in Layer::ALL {
        assert_eq!(covered(layer), expected, "{layer:?}");
    }
}

#[test]
fn every_layer_and_size_is_drawn() {
    let lumigraph = wall(0);
    let space = Space::of_scene(&lumigraph);
    let mut engine = Engine::open(DeviceChoice::Cpu).unwrap();
    let mut drawer = SceneDrawer::new(&lumigraph, &space, render::Skips::NONE);
    for layer in Layer::ALL {
        for (reduction, method) in [
            (1, render::Method::Exact),
            (3, render::Method::TRIANGULATED),
        ] {
            let mut request = request(1, 0.5);
            request.look = Look {
                layer,
                method,
                triangulation: true,
                wireframe: true,
                photo: true,
                ..Look::default()
            };
            let (picture, shown) = drawer.draw(&mut engine, &request, reduction).unwrap();
            let size = [
                40_usize.div_ceil(reduction as usize),
                30_usize.div_ceil(reduction as usize),
            ];
            assert_eq!(shown.image.size, size);
            assert_eq!(picture.width() as usize, size[0]);
            let photo = shown.photo.unwrap();
            assert_eq!((photo.0, photo.1.size), (1, size));
            assert!(!shown.lines.wireframe.is_empty());
            assert_eq!(shown.lines.triangulation.is_empty(), reduction == 1);
            let depth = shown
                .depths
                .at(&shown.view, calibrate::Pixel::new(20.0, 15.0));
            assert!((depth.unwrap() - 0.25).abs() < 1e-9);
        }
    }
}
