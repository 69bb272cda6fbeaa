//! What a frame tells the device to do, with photos that are there.

use super::Gpu;
use super::drawing::Slot;
use super::groups::Rect;
use super::layout::{ENTRY_ROW, Entry, Special, Triangle};
use super::load::Order;
use super::pipelines::{Pass, ShadeBy};
use super::tables::Tables;
use super::timing::Stopwatch;
use crate::RenderError;
use crate::field::{FieldEntry, TriangulatedField};
use crate::frame::Frame;
use glam::Vec2;
use std::ops::Range;

/// Which of a frame's parts, and where to.
#[derive(Clone, Copy)]
pub(super) struct Turn<'a> {
    pub part_idx: usize,
    pub slot: &'a Slot,
}

impl Turn<'_> {
    /// Where the device tells the time.
    fn stopwatch(&self) -> Option<&Stopwatch> {
        self.slot.stopwatch.as_ref()
    }
}

/// Pixels of a workgroup's side, as the shaders have it.
pub(super) const GROUP: u32 = 8;

impl Gpu {
    /// Draws some of a field's triangles.
    pub(super) fn draw_triangles(
        &mut self,
        frame: &Frame<'_>,
        tables: &Tables,
        field: &TriangulatedField,
        range: Range<usize>,
        turn: Turn<'_>,
    ) -> Result<wgpu::CommandEncoder, RenderError> {
        let size = [frame.desired.width, frame.desired.height];
        let whole = Rect::whole(size[0], size[1]);
        let shared = self.shared_group(frame, tables, Order::ByLayer, whole)?;
        let photos = self.photos.as_ref().expect("brought before");
        // 1. What is drawn: first what no border crosses.
        let mut entries: Vec<Entry> = Vec::new();
        let mut triangles: Vec<Triangle> = Vec::with_capacity(range.len());
        let is_bordered = |triangle_idx: &usize| field.triangles[*triangle_idx].bordered;
        let (plain, bordered) = (
            range.clone().filter(|i| !is_bordered(i)),
            range.filter(is_bordered),
        );
        let plain_count = plain.clone().count();
        for triangle_idx in plain.chain(bordered) {
            let triangle = &field.triangles[triangle_idx];
            let corners = triangle.corners.map(|i| field.vertices[i as usize]);
            triangles.push(Triangle {
                corners: corners.map(|v| v.as_vec2().to_array()),
                first_entry: entries.len() as u32,
                count_and_bordered: 2 * triangle.entry_count + u32::from(triangle.bordered),
            });
            let entry = |e: &FieldEntry| Entry {
                source_idx: photos.layer(e.source_idx as usize).unwrap_or(0) as f32,
                values: e.values,
            };
            entries.extend(field.entries_of(triangle_idx).iter().map(entry));
        }
        let scale = Vec2::new(2.0, -2.0) / Vec2::new(size[0] as f32, size[1] as f32);
        let to_device = |at: [f32; 2]| (Vec2::from(at) * scale + Vec2::new(-1.0, 1.0)).to_array();
        let corners = triangles.iter().flat_map(|t| t.corners.map(to_device));
        let corners: Vec<[f32; 2]> = corners.collect();
        let corners = self.buffer("corners", &corners, wgpu::BufferUsages::VERTEX);
        let format = wgpu::TextureFormat::Rgba32Float;
        let entries = bytemuck::cast_slice(&entries);
        let entries = self.table("entries", format, entries, ENTRY_ROW);
        let format = wgpu::TextureFormat::Rgba32Uint;
        let listed = bytemuck::cast_slice(&triangles);
        let listed = self.table("triangles", format, listed, ENTRY_ROW);
        let own = self.pipelines.triangulated_group(
            &self.device,
            &photos.view,
            &self.sampler,
            [&entries, &listed],
        );
        let special = Special::of(frame);
        let vertices = [0, plain_count, triangles.len()].map(|count| 3 * count as u32);
        let kinds = [
            (Pass::Triangles, vertices[0]..vertices[1]),
            (Pass::BorderedTriangles, vertices[1]..vertices[2]),
        ];
        let kinds = kinds.into_iter().filter(|(_, of)| !of.is_empty());
        for (kind, _) in kinds.clone() {
            self.pipelines.ensure(&self.device, kind, special);
        }
        let (pipelines, slot) = (&self.pipelines, turn.slot);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        // 2. Its colours, and as it is drawn.
        if let ShadeBy::Fragments = pipelines.shade_by {
            let mut pass = over(
                &mut encoder,
                turn,
                turn.stopwatch().map(Stopwatch::of_drawing),
            );
            pass.set_bind_group(0, &shared, &[]);
            pass.set_bind_group(1, &own, &[]);
            pass.set_vertex_buffer(0, corners.slice(..));
            for (kind, of) in kinds {
                pass.set_pipeline(pipelines.drawing(kind, special));
                pass.draw(of, 0..1);
            }
            drop(pass);
            return self.done(encoder, turn);
        }
        // 2. Which triangle each pixel sees, and then its colour.
        if turn.part_idx == 0 {
            drop(cleared(&mut encoder, &slot.target.view, None));
        }
        {
            let times = turn.stopwatch().map(Stopwatch::beginning_of_pass);
            let mut pass = cleared(&mut encoder, &slot.seen, times);
            pass.set_pipeline(&pipelines.seen);
            pass.set_vertex_buffer(0, corners.slice(..));
            pass.draw(0..vertices[2], 0..1);
        }
        {
            let seen = pipelines.seen_group(&self.device, &slot.seen, &slot.target.view);
            let times = turn.stopwatch().map(Stopwatch::end_of_pass);
            let mut pass = computing(&mut encoder, times);
            for (at, group) in (0..).zip([&shared, &own, &seen]) {
                pass.set_bind_group(at, group, &[]);
            }
            for (kind, _) in kinds {
                pass.set_pipeline(pipelines.computing(kind, special));
                let [x, y] = size.map(|side| side.div_ceil(GROUP));
                pass.dispatch_workgroups(x, y, 1);
            }
        }
        self.done(encoder, turn)
    }

    /// Draws a part of the exact field.
    pub(super) fn draw_pixels(
        &mut self,
        frame: &Frame<'_>,
        tables: &Tables,
        rect: Rect,
        turn: Turn<'_>,
    ) -> Result<wgpu::CommandEncoder, RenderError> {
        let shared = self.shared_group(frame, tables, Order::AsGiven, rect)?;
        let photos = self.photos.as_ref().expect("brought before");
        let own = self
            .pipelines
            .exact_group(&self.device, &photos.view, &self.sampler);
        let special = Special::of(frame);
        self.pipelines.ensure(&self.device, Pass::Exact, special);
        let (pipelines, picture) = (&self.pipelines, &turn.slot.target.view);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        match pipelines.shade_by {
            ShadeBy::Fragments => {
                let times = turn.stopwatch().map(Stopwatch::of_drawing);
                let mut pass = over(&mut encoder, turn, times);
                let ([x, y], [width, height]) = (rect.origin, rect.size);
                pass.set_scissor_rect(x, y, width, height);
                pass.set_pipeline(pipelines.drawing(Pass::Exact, special));
                pass.set_bind_group(0, &shared, &[]);
                pass.set_bind_group(1, &own, &[]);
                pass.draw(0..3, 0..1);
            }
            ShadeBy::Workgroups => {
                let picture = pipelines.picture_group(&self.device, picture);
                let times = turn.stopwatch().map(Stopwatch::of_computing);
                let mut pass = computing(&mut encoder, times);
                for (at, group) in (0..).zip([&shared, &own, &picture]) {
                    pass.set_bind_group(at, group, &[]);
                }
                pass.set_pipeline(pipelines.computing(Pass::Exact, special));
                let [x, y] = rect.size.map(|side| side.div_ceil(GROUP));
                pass.dispatch_workgroups(x, y, 1);
            }
        }
        self.done(encoder, turn)
    }

    /// A part whose commands are recorded.
    fn done(
        &self,
        mut encoder: wgpu::CommandEncoder,
        turn: Turn<'_>,
    ) -> Result<wgpu::CommandEncoder, RenderError> {
        if let Some(stopwatch) = turn.stopwatch() {
            stopwatch.keep(&mut encoder, turn.part_idx);
        }
        self.trouble.take().map(|()| encoder)
    }
}

/// A pass over a frame's picture, which its first part clears.
fn over<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    turn: Turn<'_>,
    times: Option<wgpu::RenderPassTimestampWrites<'_>>,
) -> wgpu::RenderPass<'a> {
    let load = match turn.part_idx {
        0 => wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT),
        _ => wgpu::LoadOp::Load,
    };
    drawing(encoder, &turn.slot.target.view, load, times)
}

/// A pass over a picture of zeros.
fn cleared<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
    times: Option<wgpu::RenderPassTimestampWrites<'_>>,
) -> wgpu::RenderPass<'a> {
    let load = wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT);
    drawing(encoder, view, load, times)
}

fn drawing<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
    times: Option<wgpu::RenderPassTimestampWrites<'_>>,
) -> wgpu::RenderPass<'a> {
    encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
        label: Some("frame"),
        color_attachments: &[Some(wgpu::RenderPassColorAttachment {
            view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations {
                load,
                store: wgpu::StoreOp::Store,
            },
        })],
        timestamp_writes: times,
        ..Default::default()
    })
}

fn computing<'a>(
    encoder: &'a mut wgpu::CommandEncoder,
    times: Option<wgpu::ComputePassTimestampWrites<'_>>,
) -> wgpu::ComputePass<'a> {
    encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
        label: Some("frame"),
        timestamp_writes: times,
    })
}
