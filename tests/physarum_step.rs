//! A step of the physarum against a plain one, written from its description in integers and doubles.
#![expect(clippy::unwrap_used, reason = "a test may panic")]
#![expect(
    clippy::cast_possible_truncation,
    clippy::cast_precision_loss,
    clippy::cast_sign_loss,
    reason = "boxes are small, and so are the numbers"
)]

use std::sync::LazyLock;

use tyndall::gpu::{AdapterChoice, Gpu};
use tyndall::scene::{Edge, Physarum, Reorient, Source};
use tyndall::sim::{self, Agents, Simulation};
use tyndall::volume::Samples;

static GPU: LazyLock<Gpu> = LazyLock::new(|| Gpu::open(&AdapterChoice::Auto).unwrap());

type Vec3 = [f64; 3];
/// The axes of a frame, as columns.
type Frame = [Vec3; 3];

fn add(a: Vec3, b: Vec3, scale: f64) -> Vec3 {
    std::array::from_fn(|i| a[i] + b[i] * scale)
}

fn from_quaternion([x, y, z, w]: [f32; 4]) -> Frame {
    let [x, y, z, w] = [x, y, z, w].map(f64::from);
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)],
        [2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)],
        [2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// The frame after R(`around` about its z) and then, about its new x, R(`tilt`).
fn turned([x, y, z]: Frame, around: f64, tilt: f64) -> Frame {
    let zero = [0.0; 3];
    let (x, y) = (add(add(zero, x, around.cos()), y, around.sin()), add(add(zero, y, around.cos()), x, -around.sin()));
    [x, add(add(zero, y, tilt.cos()), z, tilt.sin()), add(add(zero, z, tilt.cos()), y, -tilt.sin())]
}

/// The hash of shaders/lib/random.wgsl, from its paper.
fn pcg3d(mut v: [u32; 3]) -> [u32; 3] {
    v = v.map(|x| x.wrapping_mul(1_664_525).wrapping_add(1_013_904_223));
    for round in 0..2 {
        v[0] = v[0].wrapping_add(v[1].wrapping_mul(v[2]));
        v[1] = v[1].wrapping_add(v[2].wrapping_mul(v[0]));
        v[2] = v[2].wrapping_add(v[0].wrapping_mul(v[1]));
        if round == 0 {
            v = v.map(|x| x ^ (x >> 16));
        }
    }
    v
}

/// Voxel `i` of `count` as the walls have it; `None` where there is nothing.
fn voxel(i: i64, count: u32, walls: Edge) -> Option<i64> {
    let count = i64::from(count);
    match walls {
        Edge::Periodic => Some(i.rem_euclid(count)),
        Edge::Reflect if i.div_euclid(count) % 2 == 0 => Some(i.rem_euclid(count)),
        Edge::Reflect => Some(count - 1 - i.rem_euclid(count)),
        Edge::Absorb => (0..count).contains(&i).then_some(i),
    }
}

fn at(field: &[u32], source: &Physarum, position: [i64; 3]) -> u32 {
    let [nx, ny, _] = source.size.map(i64::from);
    let [x, y, z] = std::array::from_fn(|a| voxel(position[a], source.size[a], source.boundary));
    let (Some(x), Some(y), Some(z)) = (x, y, z) else { return 0 };
    field[usize::try_from((z * ny + y) * nx + x).unwrap()]
}

fn blurred(field: &[u32], source: &Physarum) -> Vec<u32> {
    let [nx, ny, nz] = source.size.map(i64::from);
    let decay = (f64::from(source.decay) * 65_536.0).round() as u128;
    let mut out = Vec::with_capacity(field.len());
    for (z, y, x) in (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x)))) {
        let mut sum = 0u128;
        for (dz, dy, dx) in (0..27).map(|i| (i / 9 - 1, i / 3 % 3 - 1, i % 3 - 1)) {
            let weight = 8 >> (dx * dx + dy * dy + dz * dz);
            sum += weight * u128::from(at(field, source, [x + dx, y + dy, z + dz]));
        }
        out.push(u32::try_from(sum * decay / (64 * 65_536)).unwrap());
    }
    out
}

fn counts(sim: &mut dyn Simulation) -> Vec<u32> {
    let Samples::U32(counts) = sim.read("trail").unwrap().unwrap().samples else { panic!("counts are u32") };
    counts
}

/// What became of the moves that were compared.
#[derive(Default, Debug)]
struct Tally {
    compared: usize,
    /// A tap or a goal lies so close to a boundary that rounding decides.
    doubtful: usize,
    straight: usize,
    /// One of several equal taps was drawn.
    drawn_of_4: usize,
    drawn_of_3: usize,
    beyond_a_wall: usize,
}

fn is_doubtful(position: Vec3) -> bool {
    position.iter().any(|c| (c - c.round()).abs() < 1e-4)
}

/// Follows agent `i` through a step in `field` and compares.
fn compare_move(source: &Physarum, step: u32, field: &[u32], i: usize, before: &Agents, after: &Agents, tally: &mut Tally) {
    let third = std::f64::consts::TAU / 3.0;
    let around = |k: usize| third * k as f64;
    let [sense, turn] = [source.sense_angle, source.turn_angle].map(|degrees| f64::from(degrees).to_radians());
    let tilt = if source.reorient_by == Reorient::Sense { sense } else { turn };
    let p = before.positions[i].map(f64::from);
    let frame = from_quaternion(before.orientations[i]);
    let tap = |k: usize| {
        let direction = if k == 0 { frame } else { turned(frame, around(k), sense) }[2];
        add(p, direction, f64::from(source.sense_distance))
    };
    let taps: [Vec3; 4] = std::array::from_fn(tap);
    let [s0, s1, s2, s3] = taps.map(|tap| at(field, source, tap.map(|c| c.floor() as i64)));
    let random = pcg3d([u32::try_from(i).unwrap(), step, source.seed])[0];
    let k = if s0 == s1 && s1 == s2 && s2 == s3 {
        tally.drawn_of_4 += 1;
        (random >> 30) as usize
    } else if s1 == s2 && s2 == s3 && s1 > s0 {
        tally.drawn_of_3 += 1;
        1 + (((random >> 16) * 3) >> 16) as usize
    } else {
        // max_by_key gives the last of equals.
        [3, 2, 1, 0].into_iter().max_by_key(|&k| [s0, s1, s2, s3][k]).unwrap()
    };
    let direction = if k == 0 { frame } else { turned(frame, around(k), turn) }[2];
    let goal = add(p, direction, f64::from(source.step));
    if taps.into_iter().any(is_doubtful) || is_doubtful(goal) {
        tally.doubtful += 1;
        return;
    }
    tally.compared += 1;
    tally.straight += usize::from(k == 0);
    let size = source.size.map(f64::from);
    let crossed: [i64; 3] = std::array::from_fn(|a| (goal[a] / size[a]).floor() as i64);
    let actual = after.positions[i].map(f64::from);
    assert!((0..3).all(|a| (0.0..size[a]).contains(&actual[a])), "agent {i} has left the box: {actual:?}");
    if crossed != [0; 3] {
        tally.beyond_a_wall += 1;
        if source.boundary == Edge::Absorb {
            return;
        }
    }
    let mut goal: Vec3 = std::array::from_fn(|a| goal[a] - crossed[a] as f64 * size[a]);
    let mut frame = if k == 0 { frame } else { turned(frame, around(k), tilt) };
    if source.boundary == Edge::Reflect {
        for a in (0..3).filter(|&a| crossed[a] % 2 != 0) {
            goal[a] = size[a] - goal[a];
            frame = frame.map(|mut axis| {
                axis[a] = -axis[a];
                axis
            });
            frame[0] = frame[0].map(|c| -c);
        }
    }
    assert!((0..3).all(|a| (goal[a] - actual[a]).abs() < 1e-4), "agent {i} tap {k}: {actual:?} for {goal:?}");
    let axes = from_quaternion(after.orientations[i]);
    for (expected, actual) in frame.iter().flatten().zip(axes.iter().flatten()) {
        assert!((expected - actual).abs() < 1e-4, "agent {i} tap {k}: {axes:?} for {frame:?}");
    }
}

/// Compares `steps` steps of the simulation with plain ones, each from what the simulation had before.
fn compare(source: &Physarum, steps: u32) -> Tally {
    let mut sim = sim::build(&GPU, &Source::Physarum(source.clone())).unwrap().unwrap();
    let mut tally = Tally::default();
    let mut saturated = 0;
    for step in 1..=steps {
        let (field, before) = (counts(sim.as_mut()), sim.read_agents().unwrap().unwrap());
        sim.step().unwrap();
        let (actual, after) = (counts(sim.as_mut()), sim.read_agents().unwrap().unwrap());

        let sensed = blurred(&field, source);
        for i in 0..before.positions.len() {
            compare_move(source, step, &sensed, i, &before, &after, &mut tally);
        }
        let mut sums: Vec<u64> = sensed.into_iter().map(u64::from).collect();
        let [nx, ny, _] = source.size.map(|n| n as usize);
        for [x, y, z] in after.positions.iter().map(|p| p.map(|c| c as usize)) {
            sums[(z * ny + y) * nx + x] += u64::from(source.deposit);
        }
        saturated += sums.iter().map(|sum| sum >> 32).sum::<u64>();
        let expected: Vec<u32> = sums.into_iter().map(|sum| u32::try_from(sum).unwrap_or(u32::MAX)).collect();
        assert_eq!(actual, expected, "step {step} of {source:?}");
        assert_eq!(sim.saturated().unwrap(), saturated, "step {step} of {source:?}");
    }
    assert!(tally.doubtful * 10 < tally.compared, "{tally:?}");
    tally
}

fn small(size: [u32; 3], boundary: Edge) -> Physarum {
    Physarum { size, agents: size.iter().product::<u32>() / 2, boundary, ..Physarum::default() }
}

#[test]
fn a_step_is_the_plain_one_in_a_periodic_box() {
    let tally = compare(&Physarum { sense_distance: 3.1, step: 1.3, ..small([16, 12, 37], Edge::Periodic) }, 6);
    assert!(tally.beyond_a_wall > 100 && tally.drawn_of_4 > 1000 && tally.straight > 1000, "{tally:?}");
}

#[test]
fn a_step_is_the_plain_one_between_walls_that_reflect() {
    let tally = compare(&Physarum { sense_distance: 3.1, step: 1.3, ..small([16, 12, 37], Edge::Reflect) }, 6);
    assert!(tally.beyond_a_wall > 100, "{tally:?}");
}

#[test]
fn a_step_is_the_plain_one_between_walls_that_absorb() {
    let tally = compare(&Physarum { sense_distance: 3.1, step: 1.3, ..small([16, 12, 37], Edge::Absorb) }, 6);
    assert!(tally.beyond_a_wall > 100, "{tally:?}");
}

#[test]
fn boxes_of_any_shape_step_alike() {
    for size in [[4, 4, 4], [8, 6, 40], [8, 5, 6], [20, 7, 4], [5, 6, 7], [6, 4, 33], [7, 13, 5]] {
        for boundary in [Edge::Periodic, Edge::Reflect, Edge::Absorb] {
            compare(&small(size, boundary), 3);
        }
    }
}

#[test]
fn a_move_of_many_boxes_ends_inside() {
    for boundary in [Edge::Periodic, Edge::Reflect, Edge::Absorb] {
        let tally = compare(&Physarum { step: 64.0, sense_distance: 64.0, ..small([4, 9, 6], boundary) }, 4);
        assert!(tally.beyond_a_wall * 10 > tally.compared * 9, "{tally:?}");
    }
}

#[test]
fn equal_flanks_are_drawn_from() {
    // Straight back, the three flanking taps are one point.
    let tally = compare(&Physarum { sense_angle: 180.0, ..small([16, 12, 20], Edge::Periodic) }, 6);
    assert!(tally.drawn_of_3 > 1000, "{tally:?}");
}

#[test]
fn axes_turn_by_the_turn_angle_on_demand() {
    compare(&Physarum { reorient_by: Reorient::Turn, turn_angle: 77.0, ..small([12, 12, 12], Edge::Periodic) }, 4);
}

#[test]
fn sums_past_32_bits_are_exact_held_and_counted() {
    let source = Physarum { agents: 6000, deposit: 1 << 24, decay: 0.999, ..small([8, 4, 5], Edge::Periodic) };
    let mut sim = sim::build(&GPU, &Source::Physarum(source.clone())).unwrap().unwrap();
    compare(&source, 8);
    for _ in 0..8 {
        sim.step().unwrap();
    }
    assert!(sim.saturated().unwrap() > 100);
    assert!(counts(sim.as_mut()).contains(&u32::MAX));
}
