// Sums each pixel's luminance and its standard error, a partial sum an invocation.

struct Job {
    pixels: u32,
    invocations: u32,
}

@group(0) @binding(0) var<uniform> job: Job;
@group(0) @binding(1) var<storage, read> film: array<vec4u>;
/// (sum of standard errors, sum of luminances) of each invocation's pixels.
@group(0) @binding(2) var<storage, read_write> sums: array<vec2f>;

const LUMINANCE: vec3f = vec3f(0.2126, 0.7152, 0.0722);

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    var sum = vec2f(0.0);
    for (var i = id.x; i < job.pixels; i += job.invocations) {
        let spread = film[2u * i + 1u];
        let n = f32(spread.w & 0x1fffffu);
        if (n > 1.0) {
            // The channels share their paths, so that their errors add linearly.
            let error = sqrt(max(bitcast<vec3f>(spread.xyz), vec3f(0.0)) / (n * (n - 1.0)));
            sum += vec2f(dot(error, LUMINANCE), dot(bitcast<vec4f>(film[2u * i]).rgb, LUMINANCE));
        }
    }
    sums[id.x] = sum;
}
