// The Gauss-Newton step of hypotheses.wgsl, which this file follows: what refine.rs does on the CPU.

const MIN_KERNEL = 2.0;
const MAX_TURN = 0.4;
const MAX_MOVE = 0.05;
const PULLING_ROWS = 12;
const SPARSEST = 3;

// Central difference at a pixel of value `at`, one-sided at the rim.
fn difference(before: f32, at: f32, after: f32) -> f32 {
    let both = select(1.0, 0.5, min(before, after) > 0.0);
    return (select(at, after, after > 0.0) - select(at, before, before > 0.0)) * both;
}

// Adds a pixel to the normal equations: the upper triangle of J^T W J row by row, then J^T W r.
fn pull(at: i32, pitch: i32, pixel: vec2<f32>, w: f32, seen: vec4<f32>) {
    if seen.x <= 0.0 {
        return;
    }
    let q = (seen.x - w) / (max(batch.kernel, MIN_KERNEL) * seen.y * w);
    let inside = 1.0 - q * q;
    let left = inverse_depth(at - 1);
    let right = inverse_depth(at + 1);
    let up = inverse_depth(at - pitch);
    let down = inverse_depth(at + pitch);
    let strength = inside * inside * seen.z;
    // A pixel with no neighbour in a row or column has no normal.
    if inside <= 0.0 || strength <= 0.0 || min(max(left, right), max(up, down)) <= 0.0 {
        return;
    }
    let slope = vec2(difference(left, w, right), difference(up, w, down));
    let offset = pixel - batch.principal;
    let plane = vec3(batch.focal * slope, w - dot(slope, offset));
    let inverse = 1.0 / max(length(plane), 1e-6);
    let n = plane * inverse;
    let arm = (vec3(offset / batch.focal, 1.0) / w - shift) / batch.radius;
    let r = cross(arm, n);
    let residual = (w / seen.x - 1.0) * inverse;
    let pulled_r = strength * r;
    let pulled_n = strength * n;
    sums[0] += pulled_r.x * r;
    sums[1] += pulled_r.x * n;
    sums[2] += pulled_r.y * vec3(r.yz, n.x);
    sums[3] += vec3(pulled_r.y * n.yz, pulled_r.z * r.z);
    sums[4] += pulled_r.z * n;
    sums[5] += pulled_n.x * n;
    sums[6] += vec3(pulled_n.y * n.yz, pulled_n.z * n.z);
    sums[7] += pulled_r * residual;
    sums[8] += pulled_n * residual;
}

fn limited(v: vec3<f32>, most: f32) -> vec3<f32> {
    let size = length(v);
    return select(v, v * (most / size), size > most);
}

// Solves the damped normal equations and moves the pose; false when it has converged or there is nothing to go by. One
// thread does it.
fn advance() -> bool {
    var h: array<f32, 36>;
    var trace = 0.0;
    var entry = 0u;
    for (var a = 0u; a < 6u; a++) {
        for (var b = a; b < 6u; b++) {
            h[6u * b + a] = total[entry];
            entry++;
        }
        trace += h[7u * a];
    }
    if !(trace > 0.0 && below(trace, 1e30)) {
        return false;
    }
    // Cholesky: the lower triangle becomes that of the factor.
    for (var j = 0u; j < 6u; j++) {
        // Relative damping, and a floor for directions that depth does not see, such as a can's turn about its axis.
        var pivot = h[7u * j] + (batch.damping * h[7u * j] + 1e-4 * trace);
        for (var k = 0u; k < j; k++) {
            pivot -= h[6u * j + k] * h[6u * j + k];
        }
        if !(pivot > 0.0 && below(pivot, 1e30)) {
            return false;
        }
        pivot = sqrt(pivot);
        h[7u * j] = pivot;
        for (var i = j + 1u; i < 6u; i++) {
            var sum = h[6u * i + j];
            for (var k = 0u; k < j; k++) {
                sum -= h[6u * i + k] * h[6u * j + k];
            }
            h[6u * i + j] = sum / pivot;
        }
    }
    var x: array<f32, 6>;
    for (var i = 0u; i < 6u; i++) {
        var sum = total[21u + i];
        for (var k = 0u; k < i; k++) {
            sum -= h[6u * i + k] * x[k];
        }
        x[i] = sum / h[7u * i];
    }
    for (var n = 0u; n < 6u; n++) {
        let i = 5u - n;
        var sum = x[i];
        for (var k = i + 1u; k < 6u; k++) {
            sum -= h[6u * k + i] * x[k];
        }
        x[i] = sum / h[7u * i];
    }
    let turned = limited(vec3(x[0], x[1], x[2]) / batch.radius, MAX_TURN);
    let moved = limited(vec3(x[3], x[4], x[5]), MAX_MOVE);
    if !(finite(turned) && finite(moved)) {
        return false;
    }
    // Half the angle is 0.2 at most: the series are exact to the last bit, the built-in functions need not be.
    let half = 0.5 * turned;
    let s = dot(half, half);
    let sine = half * (1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0)));
    let cosine = 1.0 - s / 2.0 * (1.0 - s / 12.0 * (1.0 - s / 30.0));
    let q = rotation;
    rotation = normalize(vec4(cosine * q.xyz + q.w * sine + cross(sine, q.xyz), cosine * q.w - dot(sine, q.xyz)));
    translation += moved;
    return max(length(moved), length(turned) * batch.radius) >= batch.converged;
}
