//! Milliseconds of a physarum step, by box, agents and age.
//!
//! The floor. A step must at least read and write each voxel once for the blur (8 bytes), and for each agent read and
//! write its pose (64 bytes), read four taps (16), read its voxel's index and read and write that voxel (12). At 128³
//! with 0.5 M agents these are 17 MB + 46 MB. At the 4.3 TB/s of a data-centre GPU that is 15 µs, at the 26 GB/s that a
//! core here copies, 1.2 ms on two.
//!
//! Software Vulkan is not bound by bytes: it runs 8 invocations abreast in vector registers, but loads and stores as a
//! loop over the lanes with a check of each, some 5 cycles a word, and misses the second-level cache with most taps
//! and deposits (a field of 128³ is 8 MB). Hence what the kernels do about it:
//! - the blur walks columns of 4×4 voxels, 2.25 words loaded a voxel in place of 9 (13.5 ms → 4.3 ms), by `vec4u`
//!   (6.3 ms by `u32`). Sums split in two halves of 16 bits, to be exact, cost 0.6 ms of these;
//! - an agent's pose is 32 bytes. At 24, with 16 bits for each part of the quaternion, sensing took 10.4 ms in place of
//!   10.7: not worth the precision;
//! - depositing is a kernel by itself (5.2 ms), which is the price of a reproducible run.

use std::time::Instant;

use tyndall::gpu::{AdapterChoice, Gpu, GpuError};
use tyndall::scene::{Physarum, Source};
use tyndall::sim::{self, Simulation};

/// Steps timed one by one.
const TIMED: usize = 31;

fn main() -> Result<(), GpuError> {
    let gpu = Gpu::open(&AdapterChoice::Auto)?;
    println!("{}", gpu.info().name);
    println!("{:>6} {:>9} {:>6} {:>9} {:>9} {:>9} {:>9}", "edge", "agents", "age", "min ms", "median", "Mvox/s", "Magents/s");
    for (edge, agents) in [(128, 0), (128, 156_000), (128, 500_000), (256, 0), (256, 2_000_000)] {
        let source = Source::Physarum(Physarum { size: [edge; 3], agents, ..Physarum::default() });
        let Some(mut sim) = sim::build(&gpu, &source)? else { continue };
        for age in [10, 200] {
            while sim.steps() < age {
                step(sim.as_mut())?;
            }
            let mut times = Vec::with_capacity(TIMED);
            for _ in 0..TIMED {
                times.push(step(sim.as_mut())?);
            }
            times.sort_unstable_by(f64::total_cmp);
            let per_second = |items: f64| items / times[TIMED / 2] / 1e3;
            println!(
                "{edge:>5}³ {agents:>9} {age:>6} {:>9.2} {:>9.2} {:>9.1} {:>9.1}",
                times[0],
                times[TIMED / 2],
                per_second(f64::from(edge).powi(3)),
                per_second(f64::from(agents)),
            );
        }
    }
    Ok(())
}

/// Milliseconds of a step, waited for.
fn step(sim: &mut dyn Simulation) -> Result<f64, GpuError> {
    let begun = Instant::now();
    sim.step()?;
    sim.saturated()?;
    Ok(begun.elapsed().as_secs_f64() * 1e3)
}
