//! Simulations: what grows.
//!
//! A [`Simulation`] owns its state on the GPU and shows it as a [`Grid`]. [`build`] makes the one that a scene's
//! source names; [`memory`] tells what it would take before anything is allocated.

pub mod physarum;

use std::sync::atomic::{AtomicU64, Ordering};

pub use physarum::Physarum;

use crate::gpu::{Gpu, GpuError};
use crate::scene::Source;
use crate::volume::{Field, Grid};

/// A simulation on the GPU. Step count and seed are its whole state: the same source stepped as often
/// gives the same bits.
pub trait Simulation: Send {
    /// Submits one step, and does not wait for it. A frozen simulation does nothing.
    ///
    /// # Errors
    /// [`GpuError::Fault`] when the device reported an error.
    fn step(&mut self) -> Result<(), GpuError>;

    /// Steps taken since the start.
    fn steps(&self) -> u32;

    /// Whether the simulation has reached its `freeze_at`.
    fn frozen(&self) -> bool;

    /// Starts again from the seed.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    fn reset(&mut self) -> Result<(), GpuError>;

    /// Takes over the parameters that can change while it runs; `false` where it must be built anew.
    fn tune(&mut self, source: &Source) -> bool;

    /// The field that is shown, as it is now.
    fn grid(&self) -> Grid;

    /// Names of the fields that can be read; the first is the one shown.
    fn fields(&self) -> &'static [&'static str];

    /// Reads a field back; `None` where there is none of that name.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    fn read(&mut self, field: &str) -> Result<Option<Field>, GpuError>;

    /// Reads the agents back; `None` where there are none.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    fn read_agents(&mut self) -> Result<Option<Agents>, GpuError> {
        Ok(None)
    }

    /// Sums that would have passed 2³²−1 and were held there instead, since the start.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    fn saturated(&mut self) -> Result<u64, GpuError>;
}

/// The agents of a simulation, in its own order.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Agents {
    /// Where each is, in voxels from the corner of the box: voxel i covers [i, i + 1).
    pub positions: Vec<[f32; 3]>,
    /// The unit vector along which each moves.
    pub headings: Vec<[f32; 3]>,
    /// The unit quaternion (x, y, z, w) that takes each one's own axes to the box's; z becomes the heading.
    pub orientations: Vec<[f32; 4]>,
}

/// Makes the simulation that `source` names, at step 0; `None` where it names none.
///
/// # Errors
/// [`GpuError::TooLarge`] with the numbers where the adapter cannot hold it, [`GpuError::Fault`] when the device
/// reported an error.
pub fn build(gpu: &Gpu, source: &Source) -> Result<Option<Box<dyn Simulation>>, GpuError> {
    match source {
        Source::Physarum(source) => Ok(Some(Box::new(Physarum::new(gpu, source)?))),
        Source::Homogeneous(_) | Source::Cloud(_) | Source::File(_) => Ok(None),
    }
}

/// Bytes on the GPU that the simulation of `source` takes, at most `u64::MAX`; `None` where it names none.
pub fn memory(source: &Source) -> Option<u64> {
    match source {
        Source::Physarum(source) => Some(physarum::memory(source)),
        Source::Homogeneous(_) | Source::Cloud(_) | Source::File(_) => None,
    }
}

/// A number that no grid has had: a grid of a simulation built anew must not pass for that of the old one.
fn next_version() -> u64 {
    static LAST: AtomicU64 = AtomicU64::new(0);
    LAST.fetch_add(1, Ordering::Relaxed) + 1
}
