// Turns the film's radiance into the picture as shown: exposure, tone map, 8 bits.
#import lib/tonemap.wgsl

struct Job {
    pixels: u32,
    /// Factor of exposure.
    gain: f32,
    tonemap: u32,
}

@group(0) @binding(0) var<uniform> job: Job;
/// Mean radiance and alpha of each pixel stand in its first vector.
@group(0) @binding(1) var<storage, read> film: array<vec4u>;
/// Red in the lowest byte; alpha not premultiplied.
@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

@compute @workgroup_size(64)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u, @builtin(local_invocation_index) lane: u32) {
    let index = (group.y * groups.x + group.x) * 64u + lane;
    if (index >= job.pixels) {
        return;
    }
    let mean = bitcast<vec4f>(film[2u * index]);
    let color = mean.rgb / max(mean.a, 1e-6);
    picture[index] = pack4x8unorm(vec4f(tonemap(job.tonemap, job.gain * color), mean.a));
}
