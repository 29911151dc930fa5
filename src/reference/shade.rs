//! Radiance of a surface point (docs/reference/capture.md): unlit, or lit by point lights after Blinn and Phong.

use std::sync::LazyLock;

use glam::{DVec3, Vec3};

use crate::camera::Pose;
use crate::plane::{srgb_decode, three};
use crate::scene::{PointLight, Scene, Shading, Texture, Vertex};

/// Linear value of every 8-bit sRGB value.
static LINEAR: LazyLock<[f32; 256]> =
    LazyLock::new(|| std::array::from_fn(|v| srgb_decode(v as f32 / 255.0)));

/// Shades points of a scene as it stands at one instant.
pub struct Shader<'a> {
    scene: &'a Scene,
    world_from_object: Vec<Pose>,
    eye_m: DVec3,
}

impl<'a> Shader<'a> {
    /// For the scene at `time_s`, seen from `eye_m` (world coordinates).
    pub fn new(scene: &'a Scene, time_s: f64, eye_m: DVec3) -> Self {
        let world_from_object = scene.objects.iter().map(|o| o.world_from_object(time_s)).collect();
        Self { scene, world_from_object, eye_m }
    }

    /// Linear RGB radiance of the point of triangle `triangle` with barycentric coordinates `at`.
    pub fn radiance(&self, triangle: usize, at: [f64; 3]) -> [f32; 3] {
        let corners = corners(self.scene, triangle);
        let material = &self.scene.materials[corners[0].material as usize];
        let mut kd = material.kd;
        if let Some(texture) = material.texture {
            let uv = |c: usize| (0..3).map(|i| at[i] * f64::from(corners[i].uv[c])).sum();
            let uv = [uv(0), uv(1)];
            let texel = bilinear_repeat(&self.scene.textures[texture], uv);
            kd = three(|c| kd[c] * texel[c]);
        }
        let Shading::Lit(lights) = &self.scene.shading else { return kd };
        let pose = &self.world_from_object[corners[0].object as usize];
        let point_m = pose.transform(weigh(corners, at, |v| v.position_m));
        let to_eye = (self.eye_m - point_m).normalize_or_zero();
        let normal = (pose.rotation * weigh(corners, at, |v| v.normal)).normalize_or_zero();
        // Two-sided: the side that is seen is the side that is lit.
        let normal = if normal.dot(to_eye) < 0.0 { -normal } else { normal };
        let mut sum = [0.0_f32; 3];
        for light in lights {
            let lit = blinn_phong(light, point_m, normal, to_eye, material.ns);
            for c in 0..3 {
                sum[c] +=
                    (kd[c] * lit.diffuse + material.ks[c] * lit.specular) * light.color[c] * lit.falloff;
            }
        }
        sum
    }
}

/// The three corners of a triangle.
pub(super) fn corners(scene: &Scene, triangle: usize) -> [&Vertex; 3] {
    three(|i| &scene.vertices[scene.indices[3 * triangle + i] as usize])
}

/// Barycentric mean of a vector at the corners.
pub(super) fn weigh(corners: [&Vertex; 3], at: [f64; 3], f: impl Fn(&Vertex) -> [f32; 3]) -> DVec3 {
    (0..3).map(|i| at[i] * Vec3::from(f(corners[i])).as_dvec3()).sum()
}

/// One light's share, without colours.
struct Lit {
    diffuse: f32,
    specular: f32,
    falloff: f32,
}

fn blinn_phong(light: &PointLight, point_m: DVec3, normal: DVec3, to_eye: DVec3, exponent: f32) -> Lit {
    let offset_m = Vec3::from(light.position_m).as_dvec3() - point_m;
    let distance_m = offset_m.length();
    let to_light = offset_m.normalize_or_zero();
    let half = (to_light + to_eye).normalize_or_zero();
    let [constant, linear, quadratic] = light.attenuation.map(f64::from);
    Lit {
        diffuse: normal.dot(to_light).max(0.0) as f32,
        specular: normal.dot(half).max(0.0).powf(f64::from(exponent)) as f32,
        falloff: (1.0 / (constant + linear * distance_m + quadratic * distance_m * distance_m)) as f32,
    }
}

/// A texture at (u, v), v up: texels decoded to linear, then interpolated bilinearly, repeating; centres at +0.5.
fn bilinear_repeat(texture: &Texture, uv: [f64; 2]) -> [f32; 3] {
    let x = uv[0] * f64::from(texture.width) - 0.5;
    let y = (1.0 - uv[1]) * f64::from(texture.height) - 0.5;
    let (fx, fy) = ((x - x.floor()) as f32, (y - y.floor()) as f32);
    let texel = |dx: i64, dy: i64, channel: usize| {
        let column = (x.floor() as i64 + dx).rem_euclid(i64::from(texture.width)) as usize;
        let row = (y.floor() as i64 + dy).rem_euclid(i64::from(texture.height)) as usize;
        LINEAR[texture.rgba[4 * (row * texture.width as usize + column) + channel] as usize]
    };
    three(|c| {
        let upper = texel(0, 0, c) * (1.0 - fx) + texel(1, 0, c) * fx;
        let lower = texel(0, 1, c) * (1.0 - fx) + texel(1, 1, c) * fx;
        upper * (1.0 - fy) + lower * fy
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{Material, Object};

    /// 2x2 texels: red varies along the columns, green along the rows.
    fn texture() -> Texture {
        let rgba = vec![10, 20, 0, 255, 200, 20, 0, 255, 10, 180, 0, 255, 200, 180, 0, 255];
        Texture { path: "t.png".into(), width: 2, height: 2, rgba }
    }

    #[test]
    fn texture_has_v_up_centres_at_half_and_repeats() {
        let linear = |v: u8| srgb_decode(f32::from(v) / 255.0);
        let upper_left = bilinear_repeat(&texture(), [0.25, 0.75]);
        assert!((upper_left[0] - linear(10)).abs() < 1e-6 && (upper_left[1] - linear(20)).abs() < 1e-6);
        let lower_right = bilinear_repeat(&texture(), [0.75, 0.25]);
        assert!((lower_right[0] - linear(200)).abs() < 1e-6 && (lower_right[1] - linear(180)).abs() < 1e-6);
        // Interpolated AFTER decoding: half way between 10 and 200 in linear values, far from sRGB 105.
        let between = bilinear_repeat(&texture(), [0.5, 0.75])[0];
        assert!((between - 0.5 * (linear(10) + linear(200))).abs() < 1e-6);
        assert!((between - linear(105)).abs() > 0.1, "control");
        for shift in [[1.0, 0.0], [-3.0, 2.0]] {
            let repeated = bilinear_repeat(&texture(), [0.6 + shift[0], 0.3 + shift[1]]);
            let first = bilinear_repeat(&texture(), [0.6, 0.3]);
            assert!((0..3).all(|c| (repeated[c] - first[c]).abs() < 1e-5));
        }
        // The seam interpolates between the last and the first column.
        let seam = bilinear_repeat(&texture(), [0.0, 0.75])[0];
        assert!((seam - 0.5 * (linear(10) + linear(200))).abs() < 1e-6);
    }

    /// A triangle in z = 0 with normal +z, a light 2 m above its origin, the eye at `eye_m`.
    fn lit(eye_m: DVec3) -> [f32; 3] {
        let corner = |x: f32, y: f32| Vertex {
            position_m: [x, y, 0.0],
            object: 0,
            normal: [0.0, 0.0, 1.0],
            material: 0,
            uv: [0.0; 2],
        };
        let light =
            PointLight { position_m: [0.0, 0.0, 2.0], color: [1.0, 0.5, 2.0], attenuation: [1.0, 0.5, 0.25] };
        let kd = [0.4, 0.6, 0.2];
        let scene = Scene {
            vertices: vec![corner(-1.0, -1.0), corner(1.0, -1.0), corner(0.0, 2.0)],
            indices: vec![0, 1, 2],
            materials: vec![Material { name: "m".into(), kd, ks: [0.3; 3], ns: 20.0, texture: None }],
            objects: vec![Object { name: "o".into(), trajectory: None }],
            shading: Shading::Lit(vec![light]),
            ..Scene::default()
        };
        Shader::new(&scene, 0.0, eye_m).radiance(0, [1.0 / 3.0; 3])
    }

    #[test]
    fn blinn_phong_in_closed_form() {
        // The point is the origin, straight under the light; the eye stands 60 degrees off the normal, so the half
        // vector is 30 degrees off it.
        let got = lit(DVec3::new(3.0_f64.sqrt(), 0.0, 1.0));
        let specular = 0.3 * 0.75_f32.sqrt().powf(20.0);
        let falloff = 1.0 / (1.0 + 0.5 * 2.0 + 0.25 * 4.0);
        for (c, (kd, color)) in [(0.4, 1.0), (0.6, 0.5), (0.2, 2.0)].into_iter().enumerate() {
            assert!((got[c] - (kd + specular) * color * falloff).abs() < 1e-6, "{got:?}");
        }
        // Seen from below the normal turns over, away from the light: no diffuse light, no highlight.
        let below = lit(DVec3::new(0.1, 0.0, -1.0));
        assert!(below.iter().all(|&c| c.abs() < 1e-6), "{below:?}");
    }
}
