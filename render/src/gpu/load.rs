//! Which photos a frame samples, and bringing them to the device.

use super::groups::{self, Group, Most, Part, Rect};
use super::layout::{self, Corner, Special};
use super::passes::GROUP;
use super::photos::{Layers, Shortage};
use super::pipelines::Pass;
use super::room::{Content, Room, array_size};
use super::{Gpu, tables, target};
use crate::RenderError;
use crate::field::TriangulatedField;
use crate::frame::Frame;
use crate::residency::Residency;

/// How the shaders number source views.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Order {
    /// As the lumigraph does, passing over those that take no part in the frame.
    AsGiven,
    /// By their layer of the photos' array, those that have one.
    ByLayer,
}

/// A frame whose photos, or the first part's, are on the device.
#[derive(Clone, Debug)]
pub struct Loaded {
    pub(super) room: Room,
    pub(super) groups: Vec<Group>,
    photos_used: Option<usize>,
}

impl Loaded {
    /// How many photos the frame samples, as far as known: those that a triangulated field lists;
    /// those that the exact field's marking pass found, if there was need of one.
    pub fn photos_used(&self) -> Option<usize> {
        self.photos_used
    }

    /// In how many parts the frame is drawn, each with photos of its own.
    pub fn parts(&self) -> usize {
        self.groups.len()
    }
}

impl Gpu {
    /// Finds the photos that a frame samples and brings them to the device; of a frame that needs
    /// more than there is room for at once, those of its first part. Of a triangulated field
    /// these are the photos that it lists, of the exact one those that a first pass marks,
    /// unless all that take part are on the device already.
    ///
    /// # Errors
    /// As [`Self::render`].
    pub fn load(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
    ) -> Result<Loaded, RenderError> {
        self.device_time = None;
        frame.lumigraph.photos.begin_frame();
        if self.ever_loaded.0 != frame.lumigraph.photos.id() {
            self.photo_layers = self.limits.max_texture_array_layers;
        }
        let loaded = loop {
            let count = match self.try_load(frame, field) {
                Err(Shortage::Memory { count, .. }) if count > 1 => count,
                other => break other.map_err(RenderError::from),
            };
            // Memory is for fewer layers than the device has names for: in smaller groups.
            if self.trouble.lost().is_some() {
                break Err(RenderError::Gpu("memory ran out".to_owned()));
            }
            self.photo_layers = (count - count.div_ceil(4)).min(self.photo_layers);
        };
        self.told(loaded)
    }

    fn try_load(
        &mut self,
        frame: &Frame<'_>,
        field: Option<&TriangulatedField>,
    ) -> Result<Loaded, Shortage> {
        let loaded = match field {
            Some(field) => {
                let listed = field.listed().len();
                let room = self.photo_room(frame, listed)?;
                Loaded {
                    room,
                    groups: groups::of_field(field, self.most(room)),
                    photos_used: Some(listed),
                }
            }
            None => self.load_exact(frame)?,
        };
        let mut sources = loaded.groups.iter().map(|group| &group.sources);
        let first = sources.find(|sources| !sources.is_empty());
        self.bring(frame, loaded.room, first.map_or(&[], |sources| sources))?;
        if loaded.photos_used != Some(0) {
            self.residency.note_frame(loaded.room.finest);
        }
        Ok(loaded)
    }

    fn load_exact(&mut self, frame: &Frame<'_>) -> Result<Loaded, Shortage> {
        let whole = Rect::whole(frame.desired.width, frame.desired.height);
        let group = |rect, sources| Group {
            part: Part::Pixels(rect),
            sources,
        };
        let store_id = frame.lumigraph.photos.id();
        let taking_part: Vec<usize> = frame.taking_part().collect();
        let room = self.photo_room(frame, taking_part.len())?;
        let there = |photos: &Layers| photos.holds(store_id, &taking_part);
        // More of them than there is room for are never there in full.
        if room.finest == 0 && !room.grouped && self.photos.as_ref().is_some_and(there) {
            return Ok(Loaded {
                room,
                groups: vec![group(whole, taking_part)],
                photos_used: None,
            });
        }
        let tables = self.tables(frame)?;
        let used = self.mark(frame, &tables, whole)?;
        let photos_used = Some(used.len());
        let room = self.photo_room(frame, used.len())?;
        let mut groups = Vec::new();
        let mut open = vec![(whole, used)];
        while let Some((rect, used)) = open.pop() {
            match rect.halves() {
                Some([first, second]) if used.len() > room.most as usize => {
                    // The first is the next to be looked at.
                    for half in [second, first] {
                        let used = self.mark(frame, &tables, half)?;
                        open.push((half, used));
                    }
                }
                _ => groups.push(group(rect, used)),
            }
        }
        Ok(Loaded {
            room,
            groups,
            photos_used,
        })
    }

    fn photo_room(&self, frame: &Frame<'_>, count: usize) -> Result<Room, RenderError> {
        let limits = wgpu::Limits {
            max_texture_array_layers: self.photo_layers,
            ..self.limits.clone()
        };
        let (size, budget) = (array_size(frame), self.residency.budget);
        Room::of(Content::Photos, size, count as u32, budget, &limits)
    }

    /// What a group of triangles may have at most.
    fn most(&self, room: Room) -> Most {
        let corners = self.limits.max_buffer_size / size_of::<[Corner; 3]>() as u64;
        let rows = u64::from(self.limits.max_texture_dimension_2d);
        let listed = rows * u64::from(layout::ENTRY_ROW) / 2;
        Most {
            sources: room.most as usize,
            triangles: usize::try_from(corners.min(listed).min(1 << 30)).unwrap_or(1 << 30),
            entries: usize::try_from(rows * u64::from(layout::ENTRY_ROW)).unwrap_or(usize::MAX),
        }
    }

    /// The source views that the exact field samples anywhere in a part of the picture.
    fn mark(
        &mut self,
        frame: &Frame<'_>,
        tables: &tables::Tables,
        rect: Rect,
    ) -> Result<Vec<usize>, Shortage> {
        let coarse = self.photo_room(frame, 1)?;
        self.bring(frame, coarse, &[])?;
        let shared = self.shared_group(frame, tables, Order::AsGiven, rect)?;
        let zeros = vec![0_u32; frame.sources.len().max(1)];
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let used = self.buffer("used photos", &zeros, usage);
        let special = Special::of(frame);
        self.pipelines.ensure(&self.device, Pass::Mark, special);
        let own = self.pipelines.mark_group(&self.device, &used);
        let readback = target::readback_buffer(&self.device, used.size());
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(self.pipelines.computing(Pass::Mark, special));
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            let [x, y] = rect.size.map(|side| side.div_ceil(GROUP));
            pass.dispatch_workgroups(x, y, 1);
        }
        encoder.copy_buffer_to_buffer(&used, 0, &readback, 0, used.size());
        let submitted = self.queue.submit([encoder.finish()]);
        let bytes = target::read(&self.device, &readback, readback.size(), submitted);
        self.trouble.take()?;
        let flags: Vec<u32> = bytemuck::pod_collect_to_vec(&bytes?);
        let flagged = frame.taking_part().zip(flags);
        Ok(flagged
            .filter(|(_, flag)| *flag != 0)
            .map(|(source_idx, _)| source_idx)
            .collect())
    }

    /// Brings photos to the device.
    pub(super) fn bring(
        &mut self,
        frame: &Frame<'_>,
        room: Room,
        wanted: &[usize],
    ) -> Result<(), Shortage> {
        let mut photos = self.photos.take();
        let mut residency = self.residency;
        let brought = Layers::ensure(
            &mut photos,
            &mut residency,
            Content::Photos,
            self.maker(),
            frame,
            room,
            wanted,
        );
        self.photos = photos;
        self.residency = residency;
        brought?;
        let (store_id, ever) = &mut self.ever_loaded;
        if *store_id != frame.lumigraph.photos.id() {
            *store_id = frame.lumigraph.photos.id();
            *ever = vec![false; frame.lumigraph.sources.len()];
        }
        wanted.iter().for_each(|&i| ever[i] = true);
        Ok(())
    }

    /// Brings the masks and distance maps that are asked to the device: those of the photos that
    /// are there, or as the exact field weighs all views, of all.
    pub(super) fn bring_beside(
        &mut self,
        frame: &Frame<'_>,
        order: Order,
    ) -> Result<(), RenderError> {
        let store = &frame.lumigraph.photos;
        let mut weighed: Vec<usize> = match (order, &self.photos) {
            (Order::ByLayer, Some(photos)) => photos.recent(),
            _ => frame.taking_part().collect(),
        };
        weighed.sort_unstable();
        let mut masked = weighed.clone();
        masked.retain(|&i| store.is_masked(i));
        let occluded = frame.lumigraph.visibility.is_some();
        for (content, there, wanted) in [
            (Content::Distances, occluded, weighed),
            (Content::Masks, store.any_masked(), masked),
        ] {
            let slot = |gpu: &mut Self| match content {
                Content::Distances => gpu.distances.take(),
                _ => gpu.masks.take(),
            };
            let mut layers = slot(self);
            let count = wanted.len() as u32;
            let brought = if there {
                let size = content.layer_size(frame);
                let room = Room::of(content, size, count, None, &self.limits);
                room.map_err(Shortage::Render).and_then(|room| {
                    let none = &mut Residency::default();
                    let maker = self.maker();
                    Layers::ensure(&mut layers, none, content, maker, frame, room, &wanted)
                })
            } else {
                layers = None;
                Ok(())
            };
            match content {
                Content::Distances => self.distances = layers,
                _ => self.masks = layers,
            }
            brought?;
        }
        Ok(())
    }
}
