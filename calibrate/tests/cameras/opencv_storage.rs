//! OpenCV's storage files: each way of writing, and what is damaged.

use calibrate::opencv::{DataType, FileStorage, Matrix, Node, OpenCvError, Value};
use std::path::{Path, PathBuf};

fn samples() -> Option<PathBuf> {
    let folder = Path::new(concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../shared/captures/opencv-calibrations"
    ));
    if !folder.is_dir() {
        eprintln!("SKIPPED: {} is not there", folder.display());
        return None;
    }
    Some(folder.to_owned())
}

fn parse(text: &str) -> FileStorage {
    parse_bytes(text.as_bytes()).unwrap()
}

fn parse_bytes(bytes: &[u8]) -> Result<FileStorage, OpenCvError> {
    FileStorage::parse(Path::new("c.yml"), bytes)
}

#[track_caller]
fn error(text: &str) -> String {
    parse_bytes(text.as_bytes()).unwrap_err().to_string()
}

/// Whether a value is what OpenCV reads, to the last bit.
fn same(node: &Node, expected: &serde_json::Value) -> bool {
    match (&node.value, expected) {
        (Value::Int(value), e) => e.as_i64() == Some(*value) && !e.is_f64(),
        (Value::Real(value), e) => e.is_f64() && e.as_f64() == Some(*value),
        (Value::Text(value), e) => e.as_str() == Some(value),
        (Value::Sequence(nodes), e) => e.as_array().is_some_and(|e| {
            e.len() == nodes.len() && nodes.iter().zip(e).all(|(node, e)| same(node, e))
        }),
        (Value::Matrix(m), e) => {
            let dtype = match m.dtype {
                DataType::F32 => "float32",
                DataType::F64 => "float64",
                DataType::I32 => "int32",
                _ => "other",
            };
            e["opencv_matrix"] == true
                && e["rows"] == m.rows
                && e["cols"] == m.cols
                && e["channels"] == m.channels
                && e["dtype"] == dtype
                && e["data"].as_array().is_some_and(|data| {
                    data.len() == m.data.len()
                        && data
                            .iter()
                            .zip(&m.data)
                            .all(|(e, x)| e.as_f64() == Some(*x))
                })
        }
        (Value::Map(entries), e) => e.as_object().is_some_and(|e| {
            e.len() == entries.len()
                && entries
                    .iter()
                    .zip(e)
                    .all(|((key, node), (name, e))| key == name && same(node, e))
        }),
        (Value::Null, _) => false,
    }
}

#[test]
fn every_file_holds_what_opencv_reads_from_it() {
    let Some(folder) = samples() else { return };
    let expected = std::fs::read(folder.join("expected.json")).unwrap();
    let expected: serde_json::Value = serde_json::from_slice(&expected).unwrap();
    let mut count = 0;
    for (name, values) in expected.as_object().unwrap() {
        let storage = FileStorage::read(&folder.join(name)).unwrap();
        let keys: Vec<&String> = storage.entries.iter().map(|(key, _)| key).collect();
        let names: Vec<&String> = values.as_object().unwrap().keys().collect();
        assert_eq!(keys, names, "{name}");
        for (key, node) in &storage.entries {
            assert!(same(node, &values[key]), "{name}: {key}: {node:?}");
        }
        count += 1;
    }
    assert!(count >= 23, "{count} files");
}

/// Cut anywhere, a file is read in part or refused, and never breaks the reader. Nor do
/// flipped bytes.
#[test]
fn damage_never_breaks_the_reader() {
    let Some(folder) = samples() else { return };
    let mut state = 1_u64;
    let mut random = move |n: usize| {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1);
        (state >> 33) as usize % n
    };
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let whole = std::fs::read(&path).unwrap();
        if whole.len() > 5000 {
            continue;
        }
        for keep in 0..whole.len() {
            let _ = parse_bytes(&whole[..keep]);
        }
        for _ in 0..2000 {
            let mut bytes = whole.clone();
            for _ in 0..=random(4) {
                let at = random(bytes.len());
                bytes[at] = random(256) as u8;
            }
            let _ = parse_bytes(&bytes);
        }
    }
}

/// A matrix that is cut short is an error in each way of writing, not a smaller one.
#[test]
fn a_matrix_cut_short_is_refused() {
    let Some(folder) = samples() else { return };
    for name in [
        "opencv5.yml",
        "opencv5.xml",
        "opencv5.json",
        "opencv5.yml.gz",
    ] {
        let whole = std::fs::read(folder.join(name)).unwrap();
        let cut = if name.ends_with("gz") {
            whole.len() * 2 / 3
        } else {
            let text = std::str::from_utf8(&whole).unwrap();
            text.find("-0.065157861580218052").unwrap()
        };
        let error = parse_bytes(&whole[..cut]).unwrap_err().to_string();
        assert!(error.starts_with("c.yml"), "{name}: {error}");
    }
}

fn numbers(storage: &FileStorage, key: &str) -> Matrix {
    storage.get(key).unwrap().matrix().unwrap()
}

#[test]
fn types_round_as_opencv_rounds() {
    let storage = parse(
        "%YAML:1.0\nf: !!opencv-matrix\n   rows: 1\n   cols: 2\n   dt: f\n   data: [ 0.1, .Nan ]\n\
         i: !!opencv-matrix\n   rows: 2\n   cols: 1\n   dt: i\n   data: [ 7, 2.5 ]\n\
         u: !!opencv-matrix\n   rows: 1\n   cols: 1\n   dt: \"2u\"\n   data: [ 300, -1 ]\n\
         n: -.Inf\nold: 1.#QNAN\n",
    );
    let f = numbers(&storage, "f");
    assert_eq!(f.data[0], f64::from(0.1_f32));
    assert!(f.data[1].is_nan());
    let i = numbers(&storage, "i");
    assert_eq!((i.dtype, i.data), (DataType::I32, vec![7.0, 2.0]));
    let u = numbers(&storage, "u");
    assert_eq!((u.channels, u.data), (2, vec![255.0, 0.0]));
    assert_eq!(storage.get("n").unwrap().number(), Some(f64::NEG_INFINITY));
    assert!(storage.get("old").unwrap().number().unwrap().is_nan());
}

/// OpenCV 5 writes an array of one dimension so, as `dist.ravel()` is in Python: in each way of writing, as text and packed.
#[test]
fn matrices_of_any_number_of_dimensions_are_read() {
    let packed =
        "MWQgICAgICAgICAgICAgICAgICAgICAgmpmZmZmZub+4HoXrUbieP/p+arx0k3g/O99PjZdugr97FK5H4XqUPw==";
    let size = "aSAgICAgICAgICAgICAgICAgICAgICAgBQAAAA==";
    let yaml = |sizes: &str, data: &str| {
        format!(
            "%YAML 1.2\n---\nd: !!opencv-nd-matrix\n   sizes: {sizes}\n   dt: d\n   data: {data}\n"
        )
    };
    let xml = |sizes: &str, data: &str| {
        format!(
            "<?xml version=\"1.0\"?>\n<opencv_storage>\n<d type_id=\"opencv-nd-matrix\">\n  {sizes}\n  \
             <dt>d</dt>\n  {data}</d>\n</opencv_storage>\n"
        )
    };
    let json = |sizes: &str, data: &str| {
        format!(
            "{{ \"d\": {{ \"type_id\": \"opencv-nd-matrix\", \"sizes\": {sizes}, \"dt\": \"d\", \
             \"data\": {data} }} }}"
        )
    };
    for text in [
        yaml("[ 5 ]", "[ -0.1, 0.03, 0.006, -0.009, 0.02 ]"),
        yaml(
            &format!("!!binary |\n      {size}"),
            &format!("!!binary |\n      {packed}"),
        ),
        xml(
            "<sizes>\n    5</sizes>",
            "<data>\n    -0.1 0.03 0.006 -0.009 0.02</data>",
        ),
        xml(
            &format!("<sizes type_id=\"binary\">\n    {size}\n    </sizes>"),
            &format!("<data type_id=\"binary\">\n    {packed}\n    </data>"),
        ),
        json("[ 5 ]", "[ -0.1, 0.03, 0.006, -0.009, 0.02 ]"),
        json(
            &format!("\"$base64${size}\""),
            &format!("\"$base64${packed}\""),
        ),
    ] {
        let d = numbers(&parse(&text), "d");
        assert_eq!((d.rows, d.cols, d.channels), (1, 5, 1), "{text}");
        assert_eq!(d.data, [-0.1, 0.03, 0.006, -0.009, 0.02], "{text}");
    }
    let d = numbers(&parse(&yaml("[ 2, 1, 3 ]", "[ 1, 2, 3, 4, 5, 6 ]")), "d");
    assert_eq!((d.rows, d.cols), (2, 3));
    assert!(
        error(&yaml("[ 2, -1 ]", "[ 1, 2 ]")).contains("of the sizes [2.0, -1.0]"),
        "sizes below zero"
    );
    assert!(
        error(&yaml("[ 5 ]", "[ 1, 2 ]")).contains("has 2 numbers, expected 5"),
        "too few numbers"
    );
}

/// ROS writes YAML without a header or a type; people write lists of lists.
#[test]
fn yaml_by_hand() {
    let storage = parse(
        "image_width: 640\ncamera_matrix:\n  rows: 3\n  cols: 3\n  data: [500, 0, 320, 0, 500, \
         240, 0, 0, 1]\nK:\n- [1, 2]\n- [3, 4]   # comment\nnested:\n  - a: 1\n    b: \"x: y\"\n  \
         - {a: 2, b: [ ]}\nempty:\nlong: one two\n  three\n'quoted key': yes # really\n",
    );
    assert_eq!(numbers(&storage, "camera_matrix").rows, 3);
    let k = numbers(&storage, "K");
    assert_eq!((k.rows, k.cols, k.data), (2, 2, vec![1.0, 2.0, 3.0, 4.0]));
    let Value::Sequence(nested) = &storage.get("nested").unwrap().value else {
        panic!("a sequence")
    };
    let Value::Map(first) = &nested[0].value else {
        panic!("a map")
    };
    assert_eq!(first[1].1.text(), Some("x: y"));
    assert_eq!(storage.get("empty").unwrap().value, Value::Null);
    assert_eq!(storage.get("long").unwrap().text(), Some("one two three"));
    assert_eq!(storage.get("quoted key").unwrap().text(), Some("yes"));
    assert_eq!(storage.get("quoted key").unwrap().line, 16);
}

#[test]
fn errors_name_the_line_and_what_is_wrong() {
    let matrix = |rows: &str, data: &str| {
        format!(
            "%YAML:1.0\n---\nsize: 3\nK: !!opencv-matrix\n   rows: {rows}\n   cols: 3\n   \
             dt: d\n   data: [ {data} ]\n"
        )
    };
    let again = "copy the file again, or write it again with OpenCV";
    for (text, said) in [
        (
            matrix("3", "1, 2"),
            "line 4: a matrix of 3 rows, 3 columns and 1 channels has 2 numbers, expected 9",
        ),
        (
            matrix("9223372036854775807", ""),
            "line 4: a matrix of 9223372036854775807 rows, 3 columns and 1 channels has 0 \
             numbers, expected fewer rows and columns",
        ),
        (
            matrix("-3", "1"),
            "line 4: a matrix with -3 rows, expected zero or more",
        ),
        (
            matrix("1", "1, 2, x"),
            "line 8: \"x\" in a matrix, expected a number",
        ),
        (
            matrix("1", "1, 2, 3").replace("dt: d", "dt: q"),
            "line 4: a matrix of type \"q\", expected u, c, w, s, i, f or d with the number of \
             channels before it",
        ),
        (
            matrix("1", "1, 2").replace(" ]", ""),
            "line 9: the file ends, expected a comma or ]",
        ),
        (
            "a: 1\n  b: 2\n".to_owned(),
            "line 2: found \"b: 2\", expected a name below the one above (check the indentation)",
        ),
        (
            "<opencv_storage><K>1</opencv_storage>".to_owned(),
            "line 1: not XML: expected 'K' tag, not 'opencv_storage' at 1:21",
        ),
        (
            "\n<html></html>".to_owned(),
            "line 2: the XML begins with <html>, expected <opencv_storage>",
        ),
        (
            "{\n\"a\": 1,\n\"b\" 2}".to_owned(),
            "line 3: found \"2}\", expected a colon after the name \"b\"",
        ),
    ] {
        assert_eq!(error(&text), format!("c.yml, {said}; {again}"));
    }
    let expected = "expected a file that OpenCV's FileStorage writes (YAML, XML or JSON, gzip or \
                    not)";
    assert_eq!(
        error(" \n"),
        format!("c.yml: the file is empty; {expected}")
    );
    assert_eq!(
        error("\0"),
        format!("c.yml: the file is binary; {expected}")
    );
}

/// Nesting exhausts no stack and a small gzip file no memory.
#[test]
fn hostile_files_are_refused() {
    let deep = 200_000;
    for text in [
        format!("a: {}", "[".repeat(deep)),
        format!("a:\n{}", "- ".repeat(deep)),
        format!("a: {}", "{a: ".repeat(deep)),
        format!("{}1", "{\"a\":".repeat(deep)),
        format!("{{\"a\":{}", "[".repeat(deep)),
        format!("<opencv_storage>{}", "<a>".repeat(2000)),
        format!(
            "<opencv_storage>{}{}</opencv_storage>",
            "<a>".repeat(1000),
            "</a>".repeat(1000)
        ),
        (0..2000).map(|i| " ".repeat(i) + "a:\n").collect(),
    ] {
        error(&text);
    }
    use std::io::Write;
    let mut zip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    zip.write_all(&vec![b' '; 50_000_000]).unwrap();
    let packed = zip.finish().unwrap();
    let error = parse_bytes(&packed).unwrap_err().to_string();
    assert!(error.contains("unpacks to more than 100 times"), "{error}");
}

/// Each name looks only as far as it goes, not to the end of its line.
#[test]
fn a_map_on_one_long_line_takes_time_by_its_length() {
    let entries: String = (0..300_000).map(|i| format!("a{i}: 1, ")).collect();
    let started = cpu_time::ThreadTime::now();
    let storage = parse(&format!("%YAML:1.0\n---\nmap: {{ {entries}b: 2 }}\n"));
    let took = started.elapsed();
    let Value::Map(map) = &storage.get("map").unwrap().value else {
        panic!("no map");
    };
    assert_eq!(map.len(), 300_001);
    assert_eq!(map[299_999].0, "a299999");
    assert!(took.as_secs_f64() < 10.0, "{took:?}");
}

#[test]
fn names_within_braces_end_where_they_should() {
    let map = |text: &str| {
        let storage = parse(&format!("%YAML:1.0\n---\nmap: {text}\nlast: 1\n"));
        assert_eq!(storage.get("last").unwrap().number(), Some(1.0));
        let Value::Map(map) = &storage.get("map").unwrap().value else {
            panic!("no map: {text}");
        };
        let entry = |(key, node): &(String, Node)| (key.clone(), node.number().unwrap());
        map.iter().map(entry).collect::<Vec<_>>()
    };
    let expected = [("a b".to_owned(), 1.0), ("c".to_owned(), 2.0)];
    for text in [
        "{a b: 1, c: 2}",
        "{ a b : 1 , c : 2 }",
        "{a b: 1, # the first: one\n  c: 2}",
        "{\r\n  \"a b\": 1,\r\n  c: 2\r\n  }",
    ] {
        assert_eq!(map(text), expected, "{text}");
    }
    let said = error("%YAML:1.0\n---\nmap: {a # b: 1\n}\n");
    assert!(
        said.contains("line 3: found \"# b: 1\", expected a colon after the name \"a\""),
        "{said}"
    );
}
