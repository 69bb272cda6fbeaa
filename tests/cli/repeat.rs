//! The same command gives the same bytes.

use crate::run::{files, lumigraph, run, with_wall};

#[test]
fn twice_and_on_one_thread_or_two() {
    let folder = with_wall();
    let all = |out: &str, threads: &str, variable: &str| {
        let words = |line: &str| {
            let line = line.replace("OUT", out) + threads;
            let words: Vec<&str> = line.split_whitespace().collect();
            let variables: &[(&str, &str)] = match variable {
                "" => &[],
                number => &[("RAYON_NUM_THREADS", number)],
            };
            run(folder.path(), &words, variables).ok();
        };
        words("import wall -o OUT/scene");
        words("proxy OUT/scene plane");
        words("proxy OUT/scene plane -o OUT/plane.glb");
        words("render OUT/scene --path orbit --frames 3 -o OUT/frames");
        words(
            "render OUT/scene --proxy points --path orbit --frames 3 --renderer exact -o OUT/exact",
        );
        words(
            "render OUT/scene --proxy points --path orbit --frames 2 --device reference -o OUT/reference",
        );
        words(
            "field OUT/scene --proxy points --view 0004.png -o OUT/f.png --weights OUT/w.npz --triangulation OUT/t.svg",
        );
        words("evaluate OUT/scene -o OUT/evaluated");
        files(&folder.path().join(out))
    };
    let first = all("a", "", "");
    assert_eq!(first.len(), 5 + 1 + 3 + 3 + 2 + 3 + 2);
    for (out, threads, variable) in [
        ("b", "", ""),
        ("c", " --threads 1", ""),
        ("d", " --threads 2", ""),
        ("e", "", "1"),
        ("f", "", "2"),
    ] {
        let again = all(out, threads, variable);
        let differ: Vec<_> = first
            .iter()
            .filter(|(name, bytes)| again.get(*name) != Some(bytes))
            .map(|(name, _)| name)
            .collect();
        assert!(
            differ.is_empty() && again.len() == first.len(),
            "{out}: {differ:?}"
        );
    }
}

#[test]
fn generating_twice() {
    let folder = tempfile::tempdir().unwrap();
    for out in ["a", "b"] {
        let line = format!("generate shelf --size 48x36 --photos 4 -o {out}");
        lumigraph(folder.path(), &line).ok();
    }
    assert!(files(&folder.path().join("a")) == files(&folder.path().join("b")));
    let error = lumigraph(folder.path(), "generate wall -o a").error(1);
    assert!(error.contains("not empty"), "{error}");
}
