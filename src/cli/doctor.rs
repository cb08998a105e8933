//! What this machine can do, and what it lacks.

use std::fmt::Write;

use tyndall::gpu::{AdapterChoice, Gpu, survey};

use super::failure::Failure;
use super::print;

/// Prints every adapter with its limits and the largest volume that fits, then tries the one that would be used.
pub(crate) fn run() -> Result<(), Failure> {
    let mut text = format!("tyndall {}\n", env!("CARGO_PKG_VERSION"));
    for (info, limits) in survey() {
        let binding = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
        let _ = write!(
            text,
            "\n{}\n  kind              {:?}, {}\n  driver            {} {}\n  largest buffer    {} MiB, {} MiB in one binding\n  \
             largest volume    {}\n",
            info.name,
            info.device_type,
            info.backend,
            info.driver,
            info.driver_info,
            limits.max_buffer_size >> 20,
            binding >> 20,
            largest_cube(binding),
        );
    }
    let opened = Gpu::open(&AdapterChoice::Auto);
    match &opened {
        Ok(gpu) if gpu.is_software() => {
            let _ =
                write!(text, "\n{} is used: no GPU was found. Pictures are right, and slow.\n{GPU_ADVICE}\n", gpu.info().name);
        }
        Ok(gpu) => {
            let _ = writeln!(text, "\n{} is used.", gpu.info().name);
        }
        Err(_) => {
            let _ = write!(text, "\nNo adapter can be used.\n{SOFTWARE_ADVICE}\n{GPU_ADVICE}\n");
        }
    }
    print::out(&text)?;
    opened.map(|_| ()).map_err(Failure::from)
}

/// The largest cube of 32-bit words in a binding.
fn largest_cube(bytes: u64) -> String {
    let edge = (1..=4096_u64).take_while(|edge| edge * edge * edge * 4 <= bytes).last().unwrap_or(0);
    format!("{edge}×{edge}×{edge} voxels")
}

const SOFTWARE_ADVICE: &str = "\
  Debian, Ubuntu    apt install libvulkan1 mesa-vulkan-drivers
  Fedora            dnf install vulkan-loader mesa-vulkan-drivers
  Arch              pacman -S vulkan-icd-loader vulkan-swrast
These bring Vulkan and a driver that computes on the CPU.";

const GPU_ADVICE: &str = "\
For a GPU: NVIDIA's own driver, or mesa-vulkan-drivers for AMD and Intel (and access to /dev/dri).
In a container: docker run --gpus all (NVIDIA) or --device /dev/dri (AMD, Intel).";
