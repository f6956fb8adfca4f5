//! The CPU ray caster: needs no graphics adapter, and is the oracle for the one that does.
//!
//! One ray through each pixel's centre decides depth, label and colour. Where neighbours lie on different surfaces the
//! colour (only) is the mean of that ray's and three more, spread over the pixel. Every pixel is computed alone, so the picture is the same
//! to the bit on any number of threads.

use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::sync::Arc;

use image::RgbImage;
use nalgebra::{Isometry3, Matrix3, Point3, Vector3};
use rayon::prelude::*;

use super::bvh::{Aabb, Bvh, Ray};
use super::check::{check_mesh, check_view};
use super::occlusion::{on_disk, open_share, rotation};
use super::pyramid::Pyramid;
use super::shading::{MIN_ROUGHNESS, Surface, ViewLighting};
use super::srgb::{LINEAR_OF_8BIT, color_to_linear};
use super::{Lighting, NEAR, RenderScene, Renderer, Rendering, SUBPIXELS};
use crate::camera::Intrinsics;
use crate::error::Result;
use crate::images::Image;
use crate::mesh::Mesh;
use crate::pose::{Camera, Pose, World};

/// Rays to points of an area light: few first, and all of them only where those do not agree, in the half-shadow.
const LIGHT_RAYS: u32 = 16;
/// Every n-th of them comes first.
const FIRST_RAYS: usize = 5;

/// Shadow rays start this far off their surface, metres.
const SHADOW_OFFSET: f32 = 2e-4;

/// The ray caster, with the meshes and textures that it has prepared.
pub struct CpuRenderer {
    meshes: HashMap<usize, (Arc<Mesh>, Arc<TracedMesh>)>,
    textures: HashMap<usize, (Arc<RgbImage>, Option<Arc<Pyramid>>)>,
    smooth_edges: bool,
}

impl Default for CpuRenderer {
    fn default() -> Self {
        Self::new()
    }
}

impl CpuRenderer {
    /// A ray caster with nothing prepared yet.
    pub fn new() -> Self {
        Self { meshes: HashMap::new(), textures: HashMap::new(), smooth_edges: true }
    }

    /// Whether edges in the colour image are smoothed by four rays a pixel (on by default).
    #[must_use]
    pub fn with_smooth_edges(mut self, smooth_edges: bool) -> Self {
        self.smooth_edges = smooth_edges;
        self
    }

    fn prepare(&mut self, scene: &RenderScene, camera_from_world: &Isometry3<f64>) -> Result<View> {
        // What nobody else holds any more cannot come back.
        self.meshes.retain(|_, (key, _)| Arc::strong_count(key) > 1);
        self.textures.retain(|_, (key, _)| Arc::strong_count(key) > 1);
        let mut instances = Vec::with_capacity(scene.instances.len());
        for instance in &scene.instances {
            let mesh = &instance.visual.mesh;
            if mesh.triangles.is_empty() {
                continue;
            }
            let mesh = match self.meshes.entry(Arc::as_ptr(mesh) as usize) {
                Entry::Occupied(entry) => entry.get().1.clone(),
                Entry::Vacant(entry) => {
                    check_mesh("cpu", mesh)?;
                    let traced = Arc::new(TracedMesh::new(mesh.clone()));
                    entry.insert((mesh.clone(), traced)).1.clone()
                }
            };
            let material = &instance.visual.material;
            let texture = material.texture.as_ref().and_then(|image| {
                let key = Arc::as_ptr(image) as usize;
                let entry = self
                    .textures
                    .entry(key)
                    .or_insert_with(|| (image.clone(), Pyramid::new(image).map(Arc::new)));
                entry.1.clone()
            });
            let camera_from_mesh = camera_from_world * instance.pose;
            let mesh_from_camera = camera_from_mesh.inverse();
            instances.push(PlacedMesh {
                mesh_from_camera: (
                    mesh_from_camera.rotation.to_rotation_matrix().matrix().cast(),
                    mesh_from_camera.translation.vector.cast(),
                ),
                camera_from_mesh,
                mesh,
                texture,
                base_color: color_to_linear(material.base_color),
                roughness: material.roughness.clamp(MIN_ROUGHNESS, 1.0),
                metallic: material.metallic.clamp(0.0, 1.0),
                label: instance.label,
            });
        }
        let boxes: Vec<Aabb> = instances.iter().map(PlacedMesh::bounds).collect();
        Ok(View { bvh: Bvh::new(&boxes), instances })
    }
}

impl Renderer for CpuRenderer {
    fn name(&self) -> &'static str {
        "cpu"
    }

    fn device(&self) -> String {
        format!("CPU ray caster, {} threads", rayon::current_num_threads())
    }

    fn render(
        &mut self,
        scene: &RenderScene,
        lighting: &Lighting,
        intrinsics: &Intrinsics,
        world_from_camera: &Pose<World, Camera>,
    ) -> Result<Rendering> {
        check_view("cpu", scene, lighting, intrinsics, world_from_camera)?;
        let view = self.prepare(scene, world_from_camera.inverse().iso())?;
        // Without any light the picture is black, and depth and labels are all there is to find.
        let dark = lighting.ambient_lux == 0.0 && lighting.lights.is_empty();
        let lighting = ViewLighting::new(lighting, scene.bounce.as_ref(), world_from_camera);
        let (width, height) = (intrinsics.width, intrinsics.height);

        let mut hits: Vec<Option<Hit>> = vec![None; width * height];
        hits.par_chunks_mut(width).enumerate().for_each(|(v, row)| {
            for (u, hit) in row.iter_mut().enumerate() {
                *hit = view.cast(&pixel_ray(intrinsics, u as f64, v as f64));
            }
        });

        let seen = |u: usize, v: usize| hits[v * width + u].map_or(0.0, |hit| hit.depth as f32);
        let mut rendering = Rendering {
            radiance: Image::filled(width, height, [0.0; 3]),
            depth: Image::filled(width, height, 0.0),
            labels: Image::filled(width, height, 0),
            cos_incidence: Image::filled(width, height, 0.0),
        };
        rendering
            .radiance
            .data_mut()
            .par_chunks_mut(width)
            .zip(rendering.depth.data_mut().par_chunks_mut(width))
            .zip(rendering.labels.data_mut().par_chunks_mut(width))
            .zip(rendering.cos_incidence.data_mut().par_chunks_mut(width))
            .enumerate()
            .for_each(|(v, (((radiance, depth), labels), cos))| {
                for u in 0..width {
                    let hit = hits[v * width + u];
                    if let Some(hit) = &hit {
                        depth[u] = hit.depth as f32;
                        labels[u] = view.instances[hit.instance as usize].label;
                        cos[u] = hit.cos_incidence;
                    }
                    if dark {
                        continue;
                    }
                    let edge = self.smooth_edges && is_edge(&hits, width, height, u, v);
                    let shade = |du: f64, dv: f64, hit: Option<&Hit>| {
                        let open = |point: &Point3<f32>, normal: &Vector3<f32>| {
                            open_share(seen, intrinsics, [u, v], point, normal)
                        };
                        view.shade(hit, &lighting, intrinsics, [u as f64 + du, v as f64 + dv], open)
                    };
                    radiance[u] = shade(0.0, 0.0, hit.as_ref());
                    if edge {
                        for [du, dv] in &SUBPIXELS[1..] {
                            let ray = pixel_ray(intrinsics, u as f64 + du, v as f64 + dv);
                            let color = shade(*du, *dv, view.cast(&ray).as_ref());
                            for c in 0..3 {
                                radiance[u][c] += color[c];
                            }
                        }
                        radiance[u] = radiance[u].map(|c| 0.25 * c);
                    }
                }
            });
        Ok(rendering)
    }
}

/// Direction, with z = 1, of the ray through image point (u, v): its parameter is depth.
fn pixel_ray(intrinsics: &Intrinsics, u: f64, v: f64) -> Vector3<f64> {
    intrinsics.back_project(u, v, 1.0).coords
}

/// Whether the pixel's neighbours lie on another surface.
fn is_edge(hits: &[Option<Hit>], width: usize, height: usize, u: usize, v: usize) -> bool {
    let here = &hits[v * width + u];
    let neighbours = [
        (u > 0).then(|| v * width + u - 1),
        (u + 1 < width).then(|| v * width + u + 1),
        (v > 0).then(|| (v - 1) * width + u),
        (v + 1 < height).then(|| (v + 1) * width + u),
    ];
    neighbours.into_iter().flatten().any(|i| match (here, &hits[i]) {
        (None, None) => false,
        (Some(a), Some(b)) => {
            a.instance != b.instance
                || (a.depth - b.depth).abs() > 0.02 * a.depth
                || a.face.dot(&b.face) < 0.9
        }
        _ => true,
    })
}

/// A mesh ready for rays.
struct TracedMesh {
    mesh: Arc<Mesh>,
    bvh: Bvh,
    /// Corner and two edges of each triangle, in the hierarchy's order.
    triangles: Vec<[[f32; 3]; 3]>,
    bounds: Aabb,
}

impl TracedMesh {
    fn new(mesh: Arc<Mesh>) -> Self {
        let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize]);
        let boxes: Vec<Aabb> = mesh.triangles.iter().map(|t| Aabb::of(corners(t))).collect();
        let bvh = Bvh::new(&boxes);
        let triangles = bvh
            .order
            .iter()
            .map(|&i| {
                let [a, b, c] = corners(&mesh.triangles[i as usize]);
                [a.coords.into(), (b - a).into(), (c - a).into()]
            })
            .collect();
        Self { bounds: boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b)), triangles, bvh, mesh }
    }
}

/// A mesh at its place before the camera.
struct PlacedMesh {
    camera_from_mesh: Isometry3<f64>,
    /// Rotation and shift, for finding hits; [`View::refine`] makes them precise.
    mesh_from_camera: (Matrix3<f32>, Vector3<f32>),
    mesh: Arc<TracedMesh>,
    texture: Option<Arc<Pyramid>>,
    base_color: [f32; 3],
    roughness: f32,
    metallic: f32,
    label: u16,
}

impl PlacedMesh {
    /// Box in the camera's frame.
    fn bounds(&self) -> Aabb {
        let Aabb { min, max } = self.mesh.bounds;
        Aabb::of((0..8).map(|i| {
            let pick = |bit: usize| {
                if i >> bit & 1 == 0 { min[bit] } else { max[bit] }
            };
            let corner = Point3::new(pick(0), pick(1), pick(2)).cast::<f64>();
            (self.camera_from_mesh * corner).cast::<f32>()
        }))
        .loosened(1e-5)
    }

    #[inline]
    fn ray(&self, origin: &Point3<f32>, direction: &Vector3<f32>, start: f32) -> Ray {
        let (rotation, shift) = &self.mesh_from_camera;
        let origin = rotation * origin.coords + shift;
        Ray::new(origin.into(), rotation * direction, start)
    }

    /// Corners of a triangle in the camera's frame.
    fn corners(&self, triangle: [u32; 3]) -> [Point3<f64>; 3] {
        triangle.map(|i| self.camera_from_mesh * self.mesh.mesh.positions[i as usize].cast::<f64>())
    }
}

/// What a primary ray meets first.
#[derive(Debug, Clone, Copy)]
struct Hit {
    depth: f64,
    instance: u32,
    triangle: u32,
    /// Weights of the triangle's second and third corner.
    weights: [f64; 2],
    /// The triangle's unit normal on the camera's side.
    face: Vector3<f32>,
    cos_incidence: f32,
}

/// All meshes before the camera.
struct View {
    instances: Vec<PlacedMesh>,
    bvh: Bvh,
}

impl View {
    /// The nearest surface along `direction` (z = 1) from the camera.
    fn cast(&self, direction: &Vector3<f64>) -> Option<Hit> {
        let direction32 = direction.cast::<f32>();
        let ray = Ray::new(Point3::origin(), direction32, NEAR as f32);
        let mut nearest: Option<(u32, u32, f32)> = None;
        self.bvh.traverse(&ray, f32::MAX, |rank, limit| {
            let index = self.bvh.order[rank];
            let placed = &self.instances[index as usize];
            let ray = placed.ray(&Point3::origin(), &direction32, NEAR as f32);
            let mut limit = limit;
            placed.mesh.bvh.traverse(&ray, limit, |rank, nearer| {
                limit = nearer;
                if let Some(t) = intersect(&placed.mesh.triangles[rank], &ray, nearer) {
                    nearest = Some((index, placed.mesh.bvh.order[rank], t));
                    limit = t;
                }
                Some(limit)
            });
            Some(limit)
        });
        let (instance, triangle, t) = nearest?;
        self.refine(instance, triangle, f64::from(t), direction)
    }

    /// Depth, weights and normals, in double precision, of a hit found at `t` in single precision.
    fn refine(&self, instance: u32, triangle: u32, t: f64, direction: &Vector3<f64>) -> Option<Hit> {
        let placed = &self.instances[instance as usize];
        let indices = placed.mesh.mesh.triangles[triangle as usize];
        let plane = Plane::new(placed.corners(indices))?;
        // A triangle seen edge on has no better answer than the one found.
        let depth = plane.depth(direction).filter(|d| (d - t).abs() < 1e-3 * t).unwrap_or(t);
        let weights = plane.weights(&(direction * depth));
        let face = plane.normal * -(plane.normal.dot(direction)).signum();
        let normal = self.normal(instance, triangle, weights, &face.cast());
        let cos = -(normal.dot(&direction.normalize().cast()));
        Some(Hit { depth, instance, triangle, weights, face: face.cast(), cos_incidence: cos.abs().min(1.0) })
    }

    /// The smooth unit normal, on the side that the triangle shows.
    fn normal(&self, instance: u32, triangle: u32, weights: [f64; 2], face: &Vector3<f32>) -> Vector3<f32> {
        let placed = &self.instances[instance as usize];
        let mesh = &placed.mesh.mesh;
        let [a, b, c] = mesh.triangles[triangle as usize].map(|i| i as usize);
        let [wb, wc] = weights.map(|w| w as f32);
        let smooth = mesh.normals[a] * (1.0 - wb - wc) + mesh.normals[b] * wb + mesh.normals[c] * wc;
        let Some(smooth) = smooth.try_normalize(1e-6).filter(|n| n.x.is_finite()) else {
            return *face;
        };
        let smooth = (placed.camera_from_mesh.rotation * smooth.cast::<f64>()).cast::<f32>();
        // Whichever way the triangle's corners go round, the side that is seen counts.
        if smooth.dot(face) < 0.0 { -smooth } else { smooth }
    }

    /// Luminance of what was hit through image point (u, v), or of the background. `open(point, normal)` is the share of
    /// ambient light that arrives.
    fn shade(
        &self,
        hit: Option<&Hit>,
        lighting: &ViewLighting,
        intrinsics: &Intrinsics,
        [u, v]: [f64; 2],
        open: impl Fn(&Point3<f32>, &Vector3<f32>) -> f32,
    ) -> [f32; 3] {
        let Some(hit) = hit else {
            return lighting.background;
        };
        let point = (Point3::from(pixel_ray(intrinsics, u, v) * hit.depth)).cast::<f32>();
        let normal = self.normal(hit.instance, hit.triangle, hit.weights, &hit.face);
        let [roughness, metallic] = self.finish(hit);
        let albedo = self.albedo(hit, intrinsics, u, v).into();
        let surface = Surface { point, normal, albedo, roughness, metallic };
        let angle = rotation(u.round() as usize, v.round() as usize);
        surface.radiance(lighting, open(&point, &normal), |light, to_light| {
            let side = hit.face * hit.face.dot(to_light).signum();
            let start = point + side * (SHADOW_OFFSET * (1.0 + point.z));
            let light = &lighting.lights[light];
            if light.radius <= 0.0 {
                return f32::from(!self.blocked(&start, &light.position));
            }
            let across = to_light.cross(&if to_light.x.abs() < 0.8 { Vector3::x() } else { Vector3::y() });
            let across = across.normalize() * light.radius;
            let along = to_light.cross(&across);
            let arrives = |i: u32| {
                let [x, y] = on_disk(i, LIGHT_RAYS, angle);
                !self.blocked(&start, &(light.position + across * x + along * y))
            };
            let first: Vec<bool> = (0..LIGHT_RAYS).step_by(FIRST_RAYS).map(arrives).collect();
            if first.iter().all(|&a| a == first[0]) {
                return f32::from(first[0]);
            }
            (0..LIGHT_RAYS).filter(|&i| arrives(i)).count() as f32 / LIGHT_RAYS as f32
        })
    }

    /// Roughness and metallic of what was hit: the vertices' own, or the material's.
    fn finish(&self, hit: &Hit) -> [f32; 2] {
        let placed = &self.instances[hit.instance as usize];
        let mesh = &placed.mesh.mesh;
        if mesh.finish.is_empty() {
            return [placed.roughness, placed.metallic];
        }
        let [a, b, c] = mesh.triangles[hit.triangle as usize].map(|i| mesh.finish[i as usize].map(f32::from));
        let [wb, wc] = hit.weights.map(|w| w as f32);
        std::array::from_fn(|i| (a[i] * (1.0 - wb - wc) + b[i] * wb + c[i] * wc) / 255.0)
    }

    /// Base colour times vertex colour times texture, linear.
    fn albedo(&self, hit: &Hit, intrinsics: &Intrinsics, u: f64, v: f64) -> [f32; 3] {
        let placed = &self.instances[hit.instance as usize];
        let mesh = &placed.mesh.mesh;
        let indices = mesh.triangles[hit.triangle as usize];
        let mut color = placed.base_color;
        if !mesh.colors.is_empty() {
            let [a, b, c] = indices.map(|i| mesh.colors[i as usize]);
            let [wb, wc] = hit.weights.map(|w| w as f32);
            for i in 0..3 {
                let [a, b, c] = [a, b, c].map(|color| LINEAR_OF_8BIT[color[i] as usize]);
                color[i] *= a * (1.0 - wb - wc) + b * wb + c * wc;
            }
        }
        if let (Some(texture), false) = (&placed.texture, mesh.uvs.is_empty()) {
            let uvs = indices.map(|i| mesh.uvs[i as usize]);
            let uv_at = |[wb, wc]: [f64; 2]| -> [f64; 2] {
                std::array::from_fn(|i| {
                    let [a, b, c] = uvs.map(|uv| f64::from(uv[i]));
                    a * (1.0 - wb - wc) + b * wb + c * wc
                })
            };
            let here = uv_at(hit.weights);
            // Where the rays of the next pixels right and below meet the plane of this triangle.
            let plane = Plane::new(placed.corners(indices));
            let step = |du: f64, dv: f64| {
                plane
                    .as_ref()
                    .and_then(|plane| {
                        let ray = pixel_ray(intrinsics, u + du, v + dv);
                        let there = uv_at(plane.weights(&(ray * plane.depth(&ray)?)));
                        Some([there[0] - here[0], there[1] - here[1]].map(|d| d as f32))
                    })
                    .unwrap_or_default()
            };
            let texel = texture.sample(here.map(|c| c as f32), step(1.0, 0.0), step(0.0, 1.0));
            for i in 0..3 {
                color[i] *= texel[i];
            }
        }
        color
    }

    /// Whether anything stands between two points.
    fn blocked(&self, from: &Point3<f32>, to: &Point3<f32>) -> bool {
        let direction = to - from;
        let ray = Ray::new(*from, direction, 0.0);
        let mut blocked = false;
        self.bvh.traverse(&ray, 1.0, |rank, limit| {
            let placed = &self.instances[self.bvh.order[rank] as usize];
            let ray = placed.ray(from, &direction, 0.0);
            placed.mesh.bvh.traverse(&ray, limit, |rank, limit| {
                blocked = intersect(&placed.mesh.triangles[rank], &ray, limit).is_some();
                (!blocked).then_some(limit)
            });
            (!blocked).then_some(limit)
        });
        blocked
    }
}

/// Where a ray meets a triangle (Moeller and Trumbore 1997), if it does between its start and `limit`.
#[inline]
fn intersect([corner, e1, e2]: &[[f32; 3]; 3], ray: &Ray, limit: f32) -> Option<f32> {
    // A ray through an edge must not slip between two triangles because of rounding.
    const SLACK: f32 = 1e-5;
    let p = cross(&ray.direction, e2);
    let determinant = dot(e1, &p);
    if determinant == 0.0 {
        return None;
    }
    let inverse = 1.0 / determinant;
    let s: [f32; 3] = std::array::from_fn(|i| ray.origin[i] - corner[i]);
    let b = dot(&s, &p) * inverse;
    if !(-SLACK..=1.0 + SLACK).contains(&b) {
        return None;
    }
    let q = cross(&s, e1);
    let c = dot(&ray.direction, &q) * inverse;
    if c < -SLACK || b + c > 1.0 + SLACK {
        return None;
    }
    let t = dot(e2, &q) * inverse;
    (t > ray.start && t < limit).then_some(t)
}

#[inline]
fn cross(a: &[f32; 3], b: &[f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn dot(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The plane of a triangle in the camera's frame.
struct Plane {
    corner: Point3<f64>,
    normal: Vector3<f64>,
    /// `weight of corner i = dual_i . (point - corner)`.
    dual: [Vector3<f64>; 2],
}

impl Plane {
    /// `None` for a triangle without area.
    fn new([a, b, c]: [Point3<f64>; 3]) -> Option<Self> {
        let (e1, e2) = (b - a, c - a);
        let n = e1.cross(&e2);
        let squared = n.norm_squared();
        (squared > 0.0).then(|| Self {
            corner: a,
            normal: n / squared.sqrt(),
            dual: [e2.cross(&n) / squared, n.cross(&e1) / squared],
        })
    }

    /// Parameter at which a ray from the camera meets the plane.
    fn depth(&self, direction: &Vector3<f64>) -> Option<f64> {
        let along = self.normal.dot(direction);
        let depth = self.normal.dot(&self.corner.coords) / along;
        depth.is_finite().then_some(depth)
    }

    fn weights(&self, point: &Vector3<f64>) -> [f64; 2] {
        let offset = point - self.corner.coords;
        self.dual.map(|d| d.dot(&offset))
    }
}
