//! How long frames took on the device, where it can tell.

use super::target::{self, Arrival};
use crate::RenderError;
use std::time::Duration;

/// Bytes of a part's two timestamps, which are written to a multiple of
/// [`wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT`].
const PART: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

/// Takes the time of the parts of one frame.
pub(super) struct Stopwatch {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
}

impl Stopwatch {
    pub(super) fn new(device: &wgpu::Device, parts: usize) -> Self {
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("stopwatch"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let size = PART * parts.max(1) as u64;
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Self {
            queries,
            resolved,
            readback: target::readback_buffer(device, size),
        }
    }

    /// Whether it has room for so many parts.
    pub(super) fn is_for(&self, parts: usize) -> bool {
        self.resolved.size() >= PART * parts as u64
    }

    /// For a pass that is a part's first, but not its last.
    pub(super) fn beginning_of_pass(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: None,
        }
    }

    /// For a pass that is a part's last, but not its first.
    pub(super) fn end_of_pass(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: None,
            end_of_pass_write_index: Some(1),
        }
    }

    /// For a part's only pass.
    pub(super) fn of_computing(&self) -> wgpu::ComputePassTimestampWrites<'_> {
        wgpu::ComputePassTimestampWrites {
            beginning_of_pass_write_index: Some(0),
            ..self.end_of_pass()
        }
    }

    /// For a part's only pass.
    pub(super) fn of_drawing(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            end_of_pass_write_index: Some(1),
            ..self.beginning_of_pass()
        }
    }

    /// Keeps what the passes before wrote.
    pub(super) fn keep(&self, encoder: &mut wgpu::CommandEncoder, part_idx: usize) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, PART * part_idx as u64);
    }

    /// Tells the device to copy the times to where they are read.
    pub(super) fn copy(&self, encoder: &mut wgpu::CommandEncoder) {
        let size = self.resolved.size();
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, size);
    }

    /// Asks for the times that a submission copies.
    pub(super) fn ask(&self, submitted: wgpu::SubmissionIndex) -> Arrival {
        Arrival::of(&self.readback, self.readback.size(), submitted)
    }

    /// The sum over so many parts; waits for the device. `None` if it is no time: some drivers
    /// begin anew, or write nothing.
    pub(super) fn read(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        arrival: Arrival,
        parts: usize,
    ) -> Result<Option<Duration>, RenderError> {
        let bytes = target::arrived(device, &self.readback, self.readback.size(), arrival)?;
        let mut ticks = 0_u64;
        for part in bytes.chunks_exact(PART as usize).take(parts) {
            let [begun, ended]: [u64; 2] = bytemuck::pod_read_unaligned(&part[..16]);
            match ended.checked_sub(begun) {
                Some(more) if begun > 0 => ticks += more,
                _ => return Ok(None),
            }
        }
        let nanoseconds = ticks as f64 * f64::from(queue.get_timestamp_period());
        Ok(Duration::try_from_secs_f64(nanoseconds * 1e-9).ok())
    }
}
