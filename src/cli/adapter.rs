//! An adapter to work on, at rest before the process ends.

use tyndall::gpu::{AdapterChoice, Gpu};

use super::failure::Failure;

/// Opens an adapter for `work` and, however that ends, waits until the adapter is at rest. The software driver compiles
/// kernels on threads of its own; a process that ends meanwhile crashes.
pub(crate) fn on_adapter(choice: &AdapterChoice, work: impl FnOnce(&Gpu) -> Result<(), Failure>) -> Result<(), Failure> {
    let gpu = Gpu::open(choice)?;
    let done = work(&gpu);
    let rest = gpu.finish(gpu.encoder("the end"));
    done.and(rest.map_err(Failure::from))
}
