//! Simulations: what grows.

use crate::gpu::GpuError;
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

    /// Sums that would have passed 2³²−1 and were held there instead, since the start.
    ///
    /// # Errors
    /// As [`Simulation::step`].
    fn saturated(&mut self) -> Result<u64, GpuError>;
}
