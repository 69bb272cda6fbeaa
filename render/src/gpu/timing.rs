//! How long passes took on the device, where it can tell.

use super::target;
use crate::RenderError;
use std::time::Duration;

/// Bytes of a pass' two timestamps, which are written to a multiple of
/// [`wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT`].
const PASS: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

/// Takes the time of the passes of one frame.
pub(super) struct Stopwatch {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    passes: u64,
}

impl Stopwatch {
    pub(super) fn new(device: &wgpu::Device, passes: usize) -> Self {
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("stopwatch"),
            ty: wgpu::QueryType::Timestamp,
            count: 2,
        });
        let resolved = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("timestamps"),
            size: PASS * passes.max(1) as u64,
            usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        Self {
            queries,
            resolved,
            passes: passes as u64,
        }
    }

    pub(super) fn of_pass(&self) -> wgpu::RenderPassTimestampWrites<'_> {
        wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(0),
            end_of_pass_write_index: Some(1),
        }
    }

    /// Keeps what the pass before wrote.
    pub(super) fn keep(&self, encoder: &mut wgpu::CommandEncoder, pass: usize) {
        encoder.resolve_query_set(&self.queries, 0..2, &self.resolved, PASS * pass as u64);
    }

    /// The sum over all passes; waits for the device. `None` if it is no time: some drivers
    /// begin anew, or write nothing.
    pub(super) fn read(
        &self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
    ) -> Result<Option<Duration>, RenderError> {
        let size = self.resolved.size();
        let readback = target::readback_buffer(device, size);
        let mut encoder = device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &readback, 0, size);
        queue.submit([encoder.finish()]);
        let bytes = target::read(device, &readback)?;
        let mut ticks = 0_u64;
        for pass in bytes.chunks_exact(PASS as usize).take(self.passes as usize) {
            let [begun, ended]: [u64; 2] = bytemuck::pod_read_unaligned(&pass[..16]);
            match ended.checked_sub(begun) {
                Some(more) if begun > 0 => ticks += more,
                _ => return Ok(None),
            }
        }
        let nanoseconds = ticks as f64 * f64::from(queue.get_timestamp_period());
        Ok(Duration::try_from_secs_f64(nanoseconds * 1e-9).ok())
    }
}
