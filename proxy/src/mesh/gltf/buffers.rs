//! The bytes behind a glTF file: in it, in its text, or beside it.

use crate::mesh::MeshFileError;
use crate::mesh::obj::shown;
use base64::Engine;
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fs::File;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Buffer {
    uri: Option<String>,
}

/// What extensions' names have that compress numbers (`KHR_draco_mesh_compression`, `EXT_meshopt_compression`).
const COMPRESSION: &str = "_compression";

/// Buffers, each read when it is first needed.
pub(super) struct Buffers<'a> {
    path: &'a Path,
    buffers: &'a [Buffer],
    blob: Option<&'a [u8]>,
    read: Vec<Option<Cow<'a, [u8]>>>,
    external_size: usize,
    /// The extension that the file's numbers are compressed by, if it names one.
    compression: Option<&'a str>,
}

impl<'a> Buffers<'a> {
    /// The buffers of a file that uses these extensions.
    pub(super) fn new(
        path: &'a Path,
        buffers: &'a [Buffer],
        blob: Option<&'a [u8]>,
        extensions: &'a [String],
    ) -> Self {
        let mut compressions = extensions.iter().filter(|name| name.contains(COMPRESSION));
        Self {
            path,
            buffers,
            blob,
            read: vec![None; buffers.len()],
            external_size: 0,
            compression: compressions.next().map(String::as_str),
        }
    }

    /// What to do where numbers are not there, beginning with what keeps them apart from what is missing.
    pub(super) fn remedy(&self) -> String {
        match self.compression {
            Some(name) => format!(
                "; the file is compressed ({}), which is not read: export the mesh again without compression",
                shown(name)
            ),
            None => "; export the mesh again".to_owned(),
        }
    }

    /// Bytes read so far from files beside this one.
    pub(super) fn external_size(&self) -> usize {
        self.external_size
    }

    pub(super) fn bytes(&mut self, number: usize) -> Result<&[u8], MeshFileError> {
        if self.read.get(number).is_some_and(Option::is_none) {
            self.read[number] = Some(self.load(number)?);
        }
        match self.read.get(number) {
            Some(Some(bytes)) => Ok(bytes),
            _ => Err(self.failed(number, "there is no such buffer".to_owned())),
        }
    }

    fn failed(&self, number: usize, problem: String) -> MeshFileError {
        MeshFileError::Record {
            path: self.path.to_owned(),
            record: format!("buffer {number}"),
            problem,
        }
    }

    fn load(&mut self, number: usize) -> Result<Cow<'a, [u8]>, MeshFileError> {
        let uri = match (&self.buffers[number].uri, self.blob) {
            (Some(uri), _) => uri,
            (None, Some(blob)) if number == 0 => return Ok(Cow::Borrowed(blob)),
            (None, _) => {
                let problem = "it has no bytes: neither a uri nor a binary chunk";
                return Err(self.failed(number, format!("{problem}{}", self.remedy())));
            }
        };
        let (bytes, is_external) = fetch(self.path, uri, |e| self.failed(number, e))?;
        self.external_size += if is_external { bytes.len() } else { 0 };
        Ok(Cow::Owned(bytes))
    }
}

/// The bytes that a uri stands for, and whether they came from a file beside this one; what `failed`
/// makes of what is wrong with them.
pub(super) fn fetch<E>(
    path: &Path,
    uri: &str,
    failed: impl Fn(String) -> E,
) -> Result<(Vec<u8>, bool), E> {
    if let Some(data) = uri.strip_prefix("data:") {
        let text = data.split_once(";base64,").map(|(_, text)| text);
        let decode = |text: &str| base64::engine::general_purpose::STANDARD.decode(text).ok();
        return match text.and_then(decode) {
            Some(bytes) => Ok((bytes, false)),
            None => Err(failed("its data: uri is not base64".to_owned())),
        };
    }
    let Some(beside) = path_beside(uri) else {
        return Err(failed(format!(
            "its bytes are at `{}`; put them into a file beside this one, or export the model again as \
             .glb with all that it uses inside",
            shown(uri)
        )));
    };
    let path = path.parent().unwrap_or(Path::new("")).join(beside);
    // Nothing that has no end.
    let is_file = std::fs::metadata(&path).map(|m| m.is_file());
    let read = is_file.and_then(|is_file| match is_file {
        true => std::fs::read(&path),
        false => Err(std::io::Error::other("not a file")),
    });
    match read {
        Ok(bytes) => Ok((bytes, true)),
        Err(e) => Err(failed(format!(
            "its bytes cannot be read from {}: {e}; put that file there, or export the model again as .glb \
             with all that it uses inside",
            path.display()
        ))),
    }
}

/// All that may lie in files of their own.
#[derive(Deserialize)]
struct Root {
    #[serde(default)]
    buffers: Vec<Buffer>,
    /// Told by uris as buffers are.
    #[serde(default)]
    images: Vec<Buffer>,
}

/// The files beside a .glb or .gltf file that its buffers and pictures are fetched from, in the order of
/// their paths, whether or not they are there.
pub(in crate::mesh) fn files_beside(path: &Path) -> Result<Vec<PathBuf>, MeshFileError> {
    let bytes = up_to_json(path).map_err(|e| MeshFileError::Io(path.to_owned(), e))?;
    let (json, _) = super::split(path, &bytes)?;
    let failed = |e| MeshFileError::File(path.to_owned(), format!("not a glTF file: {e}"));
    let root: Root = serde_json::from_slice(json).map_err(failed)?;
    let entries = root.buffers.iter().chain(&root.images);
    let uris = entries.filter_map(|entry| entry.uri.as_deref());
    let uris = uris.filter(|uri| !uri.starts_with("data:"));
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = uris.filter_map(path_beside).map(|file| folder.join(file));
    let files: BTreeSet<PathBuf> = files.collect();
    Ok(files.into_iter().collect())
}

/// The bytes of a file; of a GLB those up to the end of its JSON.
fn up_to_json(path: &Path) -> std::io::Result<Vec<u8>> {
    let mut file = File::open(path)?;
    // The header, and the first chunk's.
    let mut bytes = Vec::new();
    file.by_ref().take(20).read_to_end(&mut bytes)?;
    let length = bytes.get(12..16).and_then(|b| b.try_into().ok());
    let length = length.map(u32::from_le_bytes).unwrap_or_default();
    let rest = match bytes.starts_with(b"glTF") {
        true => u64::from(length),
        false => u64::MAX,
    };
    file.take(rest).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// The path that a uri stands for, from the folder of the file that names it, where it may be followed.
fn path_beside(uri: &str) -> Option<PathBuf> {
    percent_decoded(uri).filter(|path| is_beside(path))
}

/// Whether a path leads to a file in the same folder or below it.
fn is_beside(path: &Path) -> bool {
    let mut parts = path.components();
    path.components().next().is_some()
        && parts.all(|part| matches!(part, Component::Normal(_) | Component::CurDir))
        && !path.to_string_lossy().contains(':')
}

fn percent_decoded(uri: &str) -> Option<PathBuf> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.bytes();
    while let Some(byte) = rest.next() {
        bytes.push(match byte {
            b'%' => {
                let digit = |b: u8| char::from(b).to_digit(16);
                (digit(rest.next()?)? * 16 + digit(rest.next()?)?) as u8
            }
            0 => return None,
            byte => byte,
        });
    }
    let text = String::from_utf8(bytes).ok()?;
    (!text.contains('\0')).then(|| PathBuf::from(text))
}
