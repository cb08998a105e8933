//! What a run of the physarum promises: the same bits again, nothing lost, nothing hoarded, the structures of its sets.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![expect(clippy::cast_precision_loss, reason = "counts are far below 2^52")]

use std::sync::LazyLock;

use statrs::distribution::{ChiSquared, ContinuousCDF};
use tyndall::gpu::{AdapterChoice, Gpu, GpuError};
use tyndall::scene::{Cloud, Edge, Homogeneous, Physarum, Source};
use tyndall::sim::{self, Simulation};
use tyndall::volume::{AutoWindow, Format, Samples};

static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&AdapterChoice::Auto).unwrap());

const WALLS: [Edge; 3] = [Edge::Periodic, Edge::Reflect, Edge::Absorb];

fn build(source: &Physarum) -> Box<dyn Simulation> {
    sim::build(&GPU, &Source::Physarum(source.clone())).unwrap().unwrap()
}

fn grow(source: &Physarum, steps: u32) -> Box<dyn Simulation> {
    let mut sim = build(source);
    advance(sim.as_mut(), steps);
    sim
}

fn advance(sim: &mut dyn Simulation, steps: u32) {
    for _ in 0..steps {
        sim.step().unwrap();
    }
}

fn counts(sim: &mut dyn Simulation) -> Vec<u32> {
    let Samples::U32(counts) = sim.read("trail").unwrap().unwrap().samples else { panic!("counts are u32") };
    counts
}

fn total(counts: &[u32]) -> u64 {
    counts.iter().copied().map(u64::from).sum()
}

fn small() -> Physarum {
    Physarum { size: [32, 28, 36], agents: 6000, ..Physarum::default() }
}

#[test]
fn the_same_seed_grows_the_same_bits() {
    for boundary in WALLS {
        let source = Physarum { boundary, ..small() };
        let mut first = grow(&source, 25);
        let mut second = grow(&source, 25);
        assert_eq!(counts(first.as_mut()), counts(second.as_mut()));
        assert_eq!(first.read_agents().unwrap(), second.read_agents().unwrap());
        let mut other = grow(&Physarum { seed: 2, ..source }, 25);
        assert_ne!(counts(first.as_mut()), counts(other.as_mut()));
    }
}

#[test]
fn threads_do_not_change_a_bit() {
    const CHILD: &str = "TYNDALL_TEST_CHILD";
    let digest = || {
        let mut sim = grow(&Physarum { agents: 40_000, ..small() }, 25);
        counts(sim.as_mut()).into_iter().fold(0u64, |sum, count| (sum ^ u64::from(count)).wrapping_mul(0x0100_0000_01b3))
    };
    if std::env::var_os(CHILD).is_some() {
        println!("digest {:016x}", digest());
        return;
    }
    let here = format!("digest {:016x}", digest());
    // The software driver reads the number of its threads once in a process.
    for threads in ["1", "3"] {
        let child = std::process::Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "threads_do_not_change_a_bit", "--nocapture"])
            .env(CHILD, "1")
            .env("LP_NUM_THREADS", threads)
            .output()
            .unwrap();
        let said = String::from_utf8_lossy(&child.stdout);
        assert!(said.contains(&here), "{threads} threads: {said}, not {here}");
    }
}

#[test]
fn every_agent_deposits_once_a_step() {
    for boundary in WALLS {
        // Without a trail left from before, the field is what was just deposited.
        let source = Physarum { decay: 0.0, step: 5.0, boundary, ..small() };
        let mut sim = build(&source);
        for _ in 0..10 {
            sim.step().unwrap();
            assert_eq!(total(&counts(sim.as_mut())), 6000 * 4096, "{boundary:?}");
        }
    }
}

#[test]
fn more_agents_than_a_dispatch_has_in_one_dimension_all_deposit() {
    let agents = 65_535 * 64 + 1000;
    let mut sim = grow(&Physarum { size: [20, 20, 20], agents, deposit: 3, ..Physarum::default() }, 1);
    assert_eq!(total(&counts(sim.as_mut())), u64::from(agents) * 3);
}

#[test]
fn the_mean_is_what_flows_in_over_what_decays() {
    for (decay, steps) in [(0.33, 40), (0.88, 120), (0.95, 300)] {
        let source = Physarum { decay, agents: 4000, ..small() };
        let voxels = f64::from(source.size.iter().product::<u32>());
        let mut sim = grow(&source, steps);
        let mean = total(&counts(sim.as_mut())) as f64 / voxels;
        let expected = f64::from(source.agents) / voxels * 4096.0 / (1.0 - f64::from(decay));
        assert!((mean / expected - 1.0).abs() < 0.01, "decay {decay}: {mean}, not {expected}");
    }
}

#[test]
fn a_field_without_deposits_fades_to_nothing() {
    let source = small();
    let mut sim = grow(&source, 20);
    assert!(sim.tune(&Source::Physarum(Physarum { deposit: 0, ..source })));
    advance(sim.as_mut(), 80);
    assert_eq!(total(&counts(sim.as_mut())), 0);
}

#[test]
fn a_periodic_box_hoards_nothing_at_its_walls() {
    let size = 32;
    let ratios: Vec<f64> = (1..=12)
        .map(|seed| {
            let mut sim = grow(&Physarum { size: [size; 3], agents: 8000, seed, ..Physarum::default() }, 60);
            let counts = counts(sim.as_mut());
            let n = size as usize;
            let at_wall = |i: usize| [i % n, i / n % n, i / n / n].into_iter().any(|c| c == 0 || c == n - 1);
            let mean_where = |wanted: bool| {
                let (sum, voxels) = (0..counts.len())
                    .filter(|&i| at_wall(i) == wanted)
                    .fold((0u64, 0u32), |(sum, voxels), i| (sum + u64::from(counts[i]), voxels + 1));
                sum as f64 / f64::from(voxels)
            };
            mean_where(true) / mean_where(false)
        })
        .collect();
    let count = ratios.len() as f64;
    let mean = ratios.iter().sum::<f64>() / count;
    let variance = ratios.iter().map(|ratio| (ratio - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let z = (mean - 1.0) / (variance / count).sqrt();
    assert!(z.abs() < 4.0 && (mean - 1.0).abs() < 0.2, "walls hold {mean} of the inside, z = {z}: {ratios:?}");
}

#[test]
fn axes_stay_orthonormal() {
    for boundary in WALLS {
        let mut sim = grow(&Physarum { boundary, step: 2.0, ..small() }, 400);
        let agents = sim.read_agents().unwrap().unwrap();
        for (orientation, heading) in agents.orientations.iter().zip(&agents.headings) {
            let length = |values: &[f32]| values.iter().map(|v| v * v).sum::<f32>().sqrt();
            assert!((length(orientation) - 1.0).abs() < 1e-5 && (length(heading) - 1.0).abs() < 1e-5, "{orientation:?}");
        }
    }
}

#[test]
fn a_simulation_stands_still_from_freeze_at_on() {
    let mut sim = build(&Physarum { freeze_at: Some(7), ..small() });
    advance(sim.as_mut(), 6);
    assert!(!sim.frozen());
    sim.step().unwrap();
    assert!(sim.frozen());
    let (version, field) = (sim.grid().version, counts(sim.as_mut()));
    advance(sim.as_mut(), 3);
    assert_eq!(sim.steps(), 7);
    assert_eq!(sim.grid().version, version);
    assert_eq!(counts(sim.as_mut()), field);
    assert!(sim.tune(&Source::Physarum(small())));
    sim.step().unwrap();
    assert_eq!(sim.steps(), 8);
}

#[test]
fn a_reset_starts_the_same_run_again() {
    let source = Physarum { size: [8, 8, 8], agents: 20_000, deposit: 1 << 24, ..Physarum::default() };
    let mut sim = grow(&source, 9);
    let (field, saturated) = (counts(sim.as_mut()), sim.saturated().unwrap());
    assert!(saturated > 0);
    let agents = sim.read_agents().unwrap();
    advance(sim.as_mut(), 4);
    sim.reset().unwrap();
    assert_eq!(sim.steps(), 0);
    assert_eq!(total(&counts(sim.as_mut())), 0);
    assert_eq!(sim.saturated().unwrap(), 0);
    advance(sim.as_mut(), 9);
    assert_eq!(counts(sim.as_mut()), field);
    assert_eq!(sim.read_agents().unwrap(), agents);
    assert_eq!(sim.saturated().unwrap(), saturated);
}

#[test]
fn tuning_keeps_the_state_and_changes_what_follows() {
    let source = small();
    let mut sim = grow(&source, 10);
    let (field, agents) = (counts(sim.as_mut()), sim.read_agents().unwrap());
    let tuned = Physarum { decay: 0.5, deposit: 1000, step: 3.0, boundary: Edge::Reflect, ..source.clone() };
    assert!(sim.tune(&Source::Physarum(tuned.clone())));
    assert_eq!(sim.steps(), 10);
    assert_eq!(counts(sim.as_mut()), field);
    assert_eq!(sim.read_agents().unwrap(), agents);

    // Tuned there and back between two steps is as if nothing had been.
    let mut untouched = grow(&source, 11);
    assert!(sim.tune(&Source::Physarum(source.clone())));
    sim.step().unwrap();
    assert_eq!(counts(sim.as_mut()), counts(untouched.as_mut()));
    assert!(sim.tune(&Source::Physarum(tuned)));
    sim.step().unwrap();
    untouched.step().unwrap();
    assert_ne!(counts(sim.as_mut()), counts(untouched.as_mut()));

    for other in [
        Physarum { size: [32, 32, 32], ..source.clone() },
        Physarum { agents: 6001, ..source.clone() },
        Physarum { seed: 9, ..source },
    ] {
        assert!(!sim.tune(&Source::Physarum(other)));
    }
    assert!(!sim.tune(&Source::Homogeneous(Homogeneous {})));
    assert_eq!(sim.steps(), 12);
}

#[test]
fn the_grid_is_the_newest_field_and_tells_when_it_changes() {
    let mut sim = build(&small());
    let mut versions = vec![sim.grid().version];
    for _ in 0..3 {
        sim.step().unwrap();
        let grid = sim.grid();
        versions.push(grid.version);
        let words: Vec<u32> = tyndall::gpu::Readback::default().values(&GPU, &grid.words, 32 * 28 * 36).unwrap();
        assert_eq!(words, counts(sim.as_mut()));
        assert_eq!((grid.format, grid.size), (Format::U32, [32, 28, 36]));
        assert!(matches!(grid.auto, AutoWindow::Mean(means) if means > 1.0));
    }
    sim.reset().unwrap();
    versions.push(sim.grid().version);
    versions.push(build(&small()).grid().version);
    let distinct: std::collections::BTreeSet<_> = versions.iter().collect();
    assert_eq!(distinct.len(), versions.len(), "{versions:?}");
}

#[test]
fn the_field_answers_to_both_its_names() {
    let mut sim = grow(&small(), 2);
    let field = sim.read("density").unwrap().unwrap();
    assert_eq!(Some(&field), sim.read("trail").unwrap().as_ref());
    assert_eq!((field.name.as_str(), field.unit.as_str(), field.size), ("trail", "counts", [32, 28, 36]));
    assert!(sim.fields().iter().all(|name| ["trail", "density"].contains(name)));
    assert_eq!(sim.read("pressure").unwrap(), None);
}

#[test]
fn nobody_is_a_crowd_too() {
    let mut sim = grow(&Physarum { agents: 0, ..small() }, 2);
    assert_eq!(total(&counts(sim.as_mut())), 0);
    assert_eq!(sim.read_agents().unwrap().unwrap().positions.len(), 0);
}

/// Asserts that the counts are draws with equal chances.
fn assert_even(what: &str, counts: &[u32]) {
    let expected = f64::from(counts.iter().sum::<u32>()) / counts.len() as f64;
    let chi2 = counts.iter().map(|&count| (f64::from(count) - expected).powi(2) / expected).sum::<f64>();
    let chance = ChiSquared::new(counts.len() as f64 - 1.0).unwrap().sf(chi2);
    assert!((1e-4..1.0 - 1e-4).contains(&chance), "{what}: χ² = {chi2}, p = {chance}");
}

#[test]
#[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "bins are few and not negative")]
fn agents_start_evenly_in_the_box_and_over_all_rotations() {
    let source = Physarum { size: [40, 24, 16], agents: 100_000, ..Physarum::default() };
    let agents = build(&source).read_agents().unwrap().unwrap();
    let bin = |share: f32, bins: usize| ((share * bins as f32) as usize).min(bins - 1);
    let mut cells = [0; 8 * 8 * 8];
    let mut within_voxels = [0; 4 * 4 * 4];
    let mut headings = [0; 16 * 16];
    let mut rolls = [0; 32];
    for (position, &[x, y, z, w]) in agents.positions.iter().zip(&agents.orientations) {
        let cell: [usize; 3] = std::array::from_fn(|axis| bin(position[axis] / source.size[axis] as f32, 8));
        cells[(cell[2] * 8 + cell[1]) * 8 + cell[0]] += 1;
        let part = position.map(|c| bin(c.fract(), 4));
        within_voxels[(part[2] * 4 + part[1]) * 4 + part[0]] += 1;
        // Equal areas of the sphere: height and longitude of the heading.
        let height = 1.0 - 2.0 * (x * x + y * y);
        let longitude = (2.0 * (y * z - w * x)).atan2(2.0 * (x * z + w * y));
        let turns = longitude / std::f32::consts::TAU + 0.5;
        headings[bin(height / 2.0 + 0.5, 16) * 16 + bin(turns, 16)] += 1;
        // The roll about the heading: the longitude of the box's z in the agent's own axes.
        let roll = (2.0 * (y * z + w * x)).atan2(2.0 * (x * z - w * y));
        rolls[bin(roll / std::f32::consts::TAU + 0.5, 32)] += 1;
    }
    assert_even("positions", &cells);
    assert_even("positions within a voxel", &within_voxels);
    assert_even("headings", &headings);
    assert_even("rolls", &rolls);
}

#[test]
fn sources_that_do_not_move_are_no_simulation() {
    for source in [Source::Homogeneous(Homogeneous {}), Source::Cloud(Cloud::default())] {
        assert!(sim::build(&GPU, &source).unwrap().is_none());
        assert_eq!(sim::memory(&source), None);
    }
}

#[test]
fn what_does_not_fit_is_refused_with_the_numbers() {
    let source = Physarum { size: [2048; 3], ..Physarum::default() };
    let needed = 2048u64.pow(3) * 4;
    match sim::build(&GPU, &Source::Physarum(source.clone())).err() {
        Some(GpuError::TooLarge { what, needed: told, allowed, .. }) => {
            assert!(what.contains("2048×2048×2048"), "{what}");
            assert!(told >= needed && allowed < needed, "{told} of {allowed}");
        }
        other => panic!("not refused: {other:?}"),
    }
    assert!(sim::memory(&Source::Physarum(source)).unwrap() >= 2 * needed);
    let absurd = Physarum { size: [u32::MAX; 3], ..Physarum::default() };
    assert!(matches!(sim::build(&GPU, &Source::Physarum(absurd.clone())), Err(GpuError::TooLarge { .. })));
    assert_eq!(sim::memory(&Source::Physarum(absurd)), Some(u64::MAX));
}

/// The smallest share of the volume that holds half of the counts.
fn k50(mut counts: Vec<u32>) -> f64 {
    counts.sort_unstable_by(|a, b| b.cmp(a));
    let half = total(&counts) / 2;
    let mut sum = 0;
    let voxels = counts.iter().take_while(|&&count| {
        sum += u64::from(count);
        sum < half
    });
    voxels.count() as f64 / counts.len() as f64
}

#[test]
fn known_sets_grow_their_known_structures() {
    let base = Physarum { size: [96; 3], agents: 65_900, ..Physarum::default() };
    let tendrils = base.clone();
    let cells = Physarum { sense_angle: 75.0, turn_angle: 60.0, sense_distance: 11.5, step: 3.5, decay: 0.77, ..base };
    // Shares measured with a simulation of the same model on a CPU, stable to a fifth over seeds and boxes.
    for (name, source, expected) in [("tendrils", tendrils, 0.021), ("cells", cells, 0.0335)] {
        let mut sim = grow(&source, 250);
        let share = k50(counts(sim.as_mut()));
        assert!((share / expected - 1.0).abs() < 0.2, "{name}: half of it lies in {share} of the box, not {expected}");
    }
}
