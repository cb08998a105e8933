//! Bringing a buffer's bytes back from the GPU.

use super::{Gpu, GpuError};

/// A staging buffer, kept from one read-back to the next.
#[derive(Default)]
pub struct Readback {
    staging: Option<wgpu::Buffer>,
}

impl Readback {
    /// Submits `encoder` followed by a copy of `bytes` bytes of `source`, waits, and gives them to `take`.
    ///
    /// # Errors
    /// [`GpuError::Fault`] when the device reported an error or did not finish in time.
    pub fn read<R>(
        &mut self,
        gpu: &Gpu,
        mut encoder: wgpu::CommandEncoder,
        source: &wgpu::Buffer,
        bytes: u64,
        take: impl FnOnce(&[u8]) -> R,
    ) -> Result<R, GpuError> {
        let staging = match self.staging.take() {
            Some(staging) if staging.size() >= bytes => staging,
            _ => gpu.device().create_buffer(&wgpu::BufferDescriptor {
                label: Some("readback"),
                size: bytes.next_multiple_of(256),
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
        };
        encoder.copy_buffer_to_buffer(source, 0, &staging, 0, bytes);
        let submission = gpu.queue().submit([encoder.finish()]);
        let slice = staging.slice(0..bytes);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        gpu.wait(submission)?;
        let taken = {
            let mapped = slice.get_mapped_range().map_err(|error| GpuError::Fault(error.to_string()))?;
            take(&mapped)
        };
        staging.unmap();
        self.staging = Some(staging);
        Ok(taken)
    }

    /// The first `count` values of a buffer.
    ///
    /// # Errors
    /// As [`Readback::read`].
    pub fn values<T: bytemuck::Pod>(&mut self, gpu: &Gpu, source: &wgpu::Buffer, count: usize) -> Result<Vec<T>, GpuError> {
        let bytes = (count * size_of::<T>()) as u64;
        // A mapped range need not be aligned for T: collect copies value by value.
        self.read(gpu, gpu.encoder("readback"), source, bytes, bytemuck::pod_collect_to_vec)
    }
}
