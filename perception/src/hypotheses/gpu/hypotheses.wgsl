// Many pose hypotheses against one frame: a workgroup moves one by Gauss-Newton steps, then renders and compares it.
//
// What is computed is explained in raster.rs, compare.rs and refine.rs, which do the same on the CPU; step.wgsl comes
// after this file. Here the threads of a workgroup share the vertices, then the triangles, then the pixels of an image
// part that fits workgroup memory. Sums are taken in a fixed order, and minima and maxima have none, so equal batches
// give equal bits.
//
// Drivers may take it that no number is NaN or infinite, so what might be is tested by its bits.

struct Batch {
    // Of the level, pixels: focal lengths, principal point, size, values a row of `level`.
    focal: vec2<f32>,
    principal: vec2<f32>,
    size: vec2<i32>,
    pitch: i32,
    vertices: u32,
    triangles: u32,
    // Threads that share a triangle, row by row.
    strips: u32,
    // Steps in this dispatch, and whether it is the last, which compares.
    steps: u32,
    last: u32,
    // Half-width of the kernel, in epsilons.
    kernel: f32,
    // Of the object, metres.
    radius: f32,
    damping: f32,
    // Metres.
    converged: f32,
    // Normal and offset.
    plane: vec4<f32>,
}

struct Hypothesis {
    // Camera from object: quaternion (x, y, z, w) and metres.
    rotation: vec4<f32>,
    translation: vec3<f32>,
    // One of those below.
    state: u32,
    rendered: f32,
    hole: f32,
    occluded: f32,
    violated: f32,
    fit: f32,
    rim: f32,
    edge: f32,
    lowest: f32,
    bounds: vec4<f32>,
}

// Where the hypothesis is in the image.
struct Outline {
    seen: u32,
    // Pixel of the level at the first column and row.
    origin: vec2<i32>,
    size: vec2<i32>,
    lowest: f32,
    bounds: vec4<f32>,
}

// The part of the outline that is in `tile`, in pixels of the outline.
struct Part {
    first: vec2<i32>,
    // One past the last.
    end: vec2<i32>,
    pitch: i32,
}

@group(0) @binding(0) var<uniform> batch: Batch;
// Inverse depth, its tolerance, plane weight, edge evidence; row and column -1 come first.
@group(0) @binding(1) var<storage, read> level: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> vertices: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> triangles: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> hypotheses: array<Hypothesis>;

// Of a workgroup: 64, 128 or 256. Software adapters do best with few, since each barrier is a switch between threads.
override THREADS = 256u;
// Threads that weigh pixels side by side.
const ROW = 16u;
// States: it cannot be rendered; it was compared, and what follows is valid; it is to be moved on; it has come to rest.
// At the end the last two mean that the driver did not run all of the program.
const UNSEEN = 0u;
const COMPARED = 1u;
const MOVING = 2u;
const RESTING = 3u;

const NEAREST = 0.05;
const SLACK = 1e-3;
// Pixels of a part with its apron: as many as fit 16352 bytes beside the other variables.
const TILE = 3960;
// Columns of a part at most: with its apron, 62 columns leave 61 rows.
const COLUMNS = 60;
const SUMS = 27u;

// Bits of inverse depth, whose order is that of the numbers: they are positive. Between renderings, sums on their way.
var<workgroup> tile: array<atomic<u32>, TILE>;
// Least u, v, -u, -v and height over the plane, as integers in the order of the numbers.
var<workgroup> lows: array<atomic<i32>, 5>;
var<workgroup> unusable: atomic<u32>;
var<workgroup> outline: Outline;
var<workgroup> rotation: vec4<f32>;
var<workgroup> translation: vec3<f32>;
var<workgroup> total: array<f32, SUMS>;
var<workgroup> state: u32;

// Of this thread.
var<private> thread: u32;
var<private> turn: mat3x3<f32>;
var<private> shift: vec3<f32>;
var<private> sums: array<vec3<f32>, 9>;

@compute @workgroup_size(THREADS)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_index) index: u32) {
    thread = index;
    if thread == 0u {
        rotation = hypotheses[group.x].rotation;
        translation = hypotheses[group.x].translation;
        state = hypotheses[group.x].state;
    }
    for (var i = 0u; i < batch.steps; i++) {
        if workgroupUniformLoad(&state) != MOVING {
            break;
        }
        find_outline();
        let found = workgroupUniformLoad(&outline);
        // Where nothing can be rendered, nothing pulls.
        if found.seen == 0u {
            break;
        }
        render(found, true);
        reduce();
        if thread == 0u && !advance() {
            state = RESTING;
        }
    }
    if batch.last == 0u {
        if thread == 0u {
            hypotheses[group.x].rotation = rotation;
            hypotheses[group.x].translation = translation;
            hypotheses[group.x].state = state;
        }
        return;
    }
    find_outline();
    let found = workgroupUniformLoad(&outline);
    if found.seen != 0u {
        render(found, false);
        reduce();
    }
    if thread == 0u {
        // Some software drivers end loops after so many turns: then pixels are missing.
        let whole = total[7] == f32(found.size.x * found.size.y);
        state = select(UNSEEN, select(RESTING, COMPARED, whole), found.seen != 0u);
        hypotheses[group.x] = Hypothesis(
            rotation, translation, state, total[0], total[1], total[2], total[3], total[4], total[5], total[6],
            found.lowest, found.bounds,
        );
    }
}

// Whether |x| < limit; false for NaN.
fn below(x: f32, limit: f32) -> bool {
    return (bitcast<u32>(x) & 0x7fffffffu) < bitcast<u32>(limit);
}

fn finite(v: vec3<f32>) -> bool {
    return all((bitcast<vec3<u32>>(v) & vec3(0x7f800000u)) != vec3(0x7f800000u));
}

// An integer in the order of the numbers; its own inverse.
fn ordered(bits: i32) -> i32 {
    return select(bits, bits ^ 0x7fffffff, bits < 0);
}

fn lower_to(slot: u32, value: f32) {
    atomicMin(&lows[slot], ordered(bitcast<i32>(value)));
}

fn least_of(slot: u32) -> f32 {
    return bitcast<f32>(ordered(atomicLoad(&lows[slot])));
}

// The matrix of a unit quaternion.
fn matrix(q: vec4<f32>) -> mat3x3<f32> {
    let d = 2.0 * q.xyz * q.xyz;
    let xy = 2.0 * q.x * q.y;
    let xz = 2.0 * q.x * q.z;
    let yz = 2.0 * q.y * q.z;
    let w = 2.0 * q.w * q.xyz;
    return mat3x3(
        vec3(1.0 - d.y - d.z, xy + w.z, xz - w.y),
        vec3(xy - w.z, 1.0 - d.x - d.z, yz + w.x),
        vec3(xz + w.y, yz - w.x, 1.0 - d.x - d.y),
    );
}

fn posed(vertex: u32) -> vec3<f32> {
    return turn * vertices[vertex].xyz + shift;
}

fn projected(p: vec3<f32>, w: f32) -> vec2<f32> {
    return batch.focal * p.xy * w + batch.principal;
}

// Projects all vertices at the present pose.
fn find_outline() {
    if thread < 5u {
        atomicStore(&lows[thread], 0x7fffffff);
    } else if thread == 5u {
        atomicStore(&unusable, 0u);
    }
    workgroupBarrier();
    turn = matrix(rotation);
    shift = translation;
    var least = vec4(1e30f);
    var height = 1e30f;
    var usable = true;
    for (var i = thread; i < batch.vertices; i += THREADS) {
        let p = posed(i);
        let uv = projected(p, 1.0 / max(p.z, NEAREST));
        usable = usable && p.z > NEAREST && below(p.z, 1e30) && below(uv.x, 1e5) && below(uv.y, 1e5);
        least = min(least, vec4(uv, -uv));
        height = min(height, dot(batch.plane.xyz, p) + batch.plane.w);
    }
    if !usable {
        atomicStore(&unusable, 1u);
    } else if thread < batch.vertices {
        lower_to(0u, least.x);
        lower_to(1u, least.y);
        lower_to(2u, least.z);
        lower_to(3u, least.w);
        lower_to(4u, height);
    }
    workgroupBarrier();
    if thread == 0u {
        outline = Outline();
        if atomicLoad(&unusable) == 0u {
            let bounds = vec4(least_of(0u), least_of(1u), -least_of(2u), -least_of(3u));
            // One pixel beyond the image is drawn too, over padding without readings: the image's border is no
            // silhouette.
            let first = max(vec2<i32>(floor(bounds.xy)), vec2(-1));
            let last = min(vec2<i32>(ceil(bounds.zw)), batch.size);
            let size = last - first + 1;
            outline = Outline(u32(all(size > vec2(0))), first, size, least_of(4u), bounds);
        }
    }
}

// Renders the outline part by part into `tile` and sums over its pixels: what pulls it, or how it compares.
fn render(found: Outline, pulls: bool) {
    sums = array<vec3<f32>, 9>();
    // As few parts as will do, all of about one size.
    let abreast = (found.size.x + COLUMNS - 1) / COLUMNS;
    let columns = (found.size.x + abreast - 1) / abreast;
    let fitting = TILE / (columns + 2) - 2;
    let stacked = (found.size.y + fitting - 1) / fitting;
    let rows = (found.size.y + stacked - 1) / stacked;
    for (var y = 0; y < found.size.y; y += rows) {
        for (var x = 0; x < found.size.x; x += columns) {
            let first = vec2(x, y);
            let part = Part(first, min(first + vec2(columns, rows), found.size), columns + 2);
            for (var i = thread; i < u32((columns + 2) * (rows + 2)); i += THREADS) {
                atomicStore(&tile[i], 0u);
            }
            workgroupBarrier();
            draw(part, found);
            workgroupBarrier();
            weigh(part, found, pulls);
            workgroupBarrier();
        }
    }
}

// Where in `tile` a pixel of the outline is.
fn slot(part: Part, pixel: vec2<i32>) -> i32 {
    let at = pixel - part.first + 1;
    return at.y * part.pitch + at.x;
}

fn inverse_depth(at: i32) -> f32 {
    return bitcast<f32>(atomicLoad(&tile[at]));
}

// Draws all triangles into the part and one pixel about it.
fn draw(part: Part, found: Outline) {
    // Nothing is drawn outside the outline: there the margin is empty.
    let least = vec2<f32>(max(part.first - 1, vec2(0)));
    let end = vec2<f32>(min(part.end + 1, found.size));
    let origin = vec2<f32>(found.origin);
    for (var i = thread; i < batch.triangles * batch.strips; i += THREADS) {
        let corners = triangles[i / batch.strips];
        let pa = posed(corners.x);
        let pb = posed(corners.y);
        let pc = posed(corners.z);
        let w = 1.0 / vec3(pa.z, pb.z, pc.z);
        let a = projected(pa, w.x) - origin;
        let b = projected(pb, w.y) - origin;
        let c = projected(pc, w.z) - origin;
        let ab = b - a;
        let ac = c - a;
        let area = ab.x * ac.y - ab.y * ac.x;
        // In the image y points down, so the front side has negative area.
        if area > -1e-6 {
            continue;
        }
        let first = clamp(ceil(min(min(a, b), c) - SLACK), least, end);
        let beyond = clamp(ceil(max(max(a, b), c) + SLACK), least, end);
        // Blocks of two by two pixels, in every so many rows of blocks.
        let top = first.y + 2.0 * f32(i % batch.strips);
        if first.x >= beyond.x || top >= beyond.y {
            continue;
        }
        let bc = c - b;
        let slope = vec2((w.y - w.x) * ac.y - (w.z - w.x) * ab.y, (w.z - w.x) * ab.x - (w.y - w.x) * ac.x) / area;
        // A sliver's slope is ill-conditioned: no pixel is nearer than the nearest vertex.
        let nearest = max(max(w.x, w.y), w.z);
        var corner = vec2(first.x, top);
        loop {
            let x = corner.x + vec4(0.0, 1.0, 0.0, 1.0);
            let y = corner.y + vec4(0.0, 0.0, 1.0, 1.0);
            // Twice the area that an edge spans with a pixel: negative inside.
            let outside = max(
                max(ab.x * (y - a.y) - ab.y * (x - a.x), bc.x * (y - b.y) - bc.y * (x - b.x)),
                ac.y * (x - c.x) - ac.x * (y - c.y),
            );
            let inside = (outside < vec4(SLACK)) & (x < vec4(beyond.x)) & (y < vec4(beyond.y));
            let value = min(w.x + slope.x * (x - a.x) + slope.y * (y - a.y), vec4(nearest));
            let bits = bitcast<vec4<u32>>(max(value, vec4(0.0)));
            let at = slot(part, vec2<i32>(corner));
            if inside.x {
                atomicMax(&tile[at], bits.x);
            }
            if inside.y {
                atomicMax(&tile[at + 1], bits.y);
            }
            if inside.z {
                atomicMax(&tile[at + part.pitch], bits.z);
            }
            if inside.w {
                atomicMax(&tile[at + part.pitch + 1], bits.w);
            }
            corner.x += 2.0;
            if corner.x >= beyond.x {
                corner = vec2(first.x, corner.y + 2.0 * f32(batch.strips));
                if corner.y >= beyond.y {
                    break;
                }
            }
        }
    }
}

fn weigh(part: Part, found: Outline, pulls: bool) {
    let mine = vec2<i32>(vec2(thread % ROW, thread / ROW));
    // Every so many rows of the outline pull, all are compared.
    let every = select(1, clamp(found.size.y / PULLING_ROWS, 1, SPARSEST), pulls);
    let first = (part.first.y + every - 1) / every * every;
    for (var y = first + mine.y * every; y < part.end.y; y += i32(THREADS / ROW) * every) {
        for (var x = part.first.x + mine.x; x < part.end.x; x += i32(ROW)) {
            let at = slot(part, vec2(x, y));
            let w = inverse_depth(at);
            if !pulls {
                sums[2].y += 1.0;
            }
            if w > 0.0 {
                let pixel = vec2(x, y) + found.origin;
                let seen = level[(pixel.y + 1) * batch.pitch + pixel.x + 1];
                if pulls {
                    pull(at, part.pitch, vec2<f32>(pixel), w, seen);
                } else {
                    compare(at, part.pitch, w, seen);
                }
            }
        }
    }
}

// Adds a pixel to the terms: rendered, hole, occluded; violated, fit, rim; edge, and the pixels looked at.
fn compare(at: i32, pitch: i32, w: f32, seen: vec4<f32>) {
    sums[0].x += 1.0;
    if seen.x <= 0.0 {
        sums[0].y += 1.0;
        return;
    }
    let q = (seen.x - w) / (batch.kernel * seen.y * w);
    sums[1].y += max(1.0 - q * q, 0.0) * seen.z;
    if q >= 1.0 {
        sums[0].z += 1.0;
        return;
    }
    if q < -1.0 {
        sums[1].x += 1.0;
    }
    let across = min(inverse_depth(at - 1), inverse_depth(at + 1));
    let along = min(inverse_depth(at - pitch), inverse_depth(at + pitch));
    if min(across, along) <= 0.0 {
        sums[1].z += 1.0;
        sums[2].x += seen.w;
    }
}

// Stores the parts of `sum` in `tile` at `at` and 128 and 256 behind it, with what is there if `more`.
fn put(at: u32, sum: vec3<f32>, more: bool) {
    var bits = bitcast<vec3<u32>>(sum);
    if more {
        let before = vec3(atomicLoad(&tile[at]), atomicLoad(&tile[at + 128u]), atomicLoad(&tile[at + 256u]));
        bits = bitcast<vec3<u32>>(sum + bitcast<vec3<f32>>(before));
    }
    atomicStore(&tile[at], bits.x);
    atomicStore(&tile[at + 128u], bits.y);
    atomicStore(&tile[at + 256u], bits.z);
}

// Sums `sums` over all threads into `total`: up to 128 threads at a time fit `tile`, then as many as there are share
// each sum, then one adds their parts.
fn reduce() {
    let abreast = min(THREADS, 128u);
    for (var group = 0u; group < THREADS; group += abreast) {
        let mine = thread - group;
        if mine < abreast {
            let more = group > 0u;
            put(mine, sums[0], more);
            put(mine + 384u, sums[1], more);
            put(mine + 768u, sums[2], more);
            put(mine + 1152u, sums[3], more);
            put(mine + 1536u, sums[4], more);
            put(mine + 1920u, sums[5], more);
            put(mine + 2304u, sums[6], more);
            put(mine + 2688u, sums[7], more);
            put(mine + 3072u, sums[8], more);
        }
        workgroupBarrier();
    }
    let sharers = THREADS / 32u;
    var part = 0.0;
    if thread < SUMS * sharers {
        let row = thread / sharers * 128u;
        for (var i = thread % sharers; i < abreast; i += sharers) {
            part += bitcast<f32>(atomicLoad(&tile[row + i]));
        }
    }
    workgroupBarrier();
    atomicStore(&tile[thread], bitcast<u32>(part));
    workgroupBarrier();
    if thread < SUMS {
        part = 0.0;
        for (var i = 0u; i < sharers; i++) {
            part += bitcast<f32>(atomicLoad(&tile[thread * sharers + i]));
        }
        total[thread] = part;
    }
    workgroupBarrier();
}

