//! What too little memory for photos does to a picture.

use render::{Engine, PhotoStore, Residency};

/// What photos took of each memory so far.
#[derive(Clone, Copy)]
pub(crate) struct Memories {
    cpu: Residency,
    /// Of what draws, if it has one of its own.
    gpu: Option<Residency>,
}

impl Memories {
    /// What they took until now.
    pub(crate) fn now(photos: &PhotoStore, engine: &Engine) -> Self {
        Self {
            cpu: photos.residency(),
            gpu: engine.gpu().map(|gpu| gpu.residency()),
        }
    }

    /// What people should know of a picture that was drawn between the two; empty where photos were there in
    /// full.
    pub(crate) fn told_since(self, before: Self) -> String {
        let capped = |memories: Self| {
            let drawings = |took: Residency| took.capped_frames;
            [drawings(memories.cpu), memories.gpu.map_or(0, drawings)]
        };
        let ([cpu, gpu], [cpu_before, gpu_before]) = (capped(self), capped(before));
        let (options, are) = match (cpu > cpu_before, gpu > gpu_before) {
            (false, false) => return String::new(),
            (true, false) => ("--cpu-memory", "is"),
            (false, true) => ("--gpu-memory", "is"),
            (true, true) => ("--cpu-memory and --gpu-memory", "are"),
        };
        format!("; photos from coarser mip levels, as {options} {are} too little")
    }
}
