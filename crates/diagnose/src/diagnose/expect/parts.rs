//! Which part of the scene each pixel of a frame shows.

use super::forward::Forward;
use shutterbug::reference::raster::{View, render};
use shutterbug::scene::{Material, Shading};

impl Forward {
    /// What the scene's parts are called: its objects, or its materials where there is one object only.
    pub(crate) fn object_names(&self) -> Vec<String> {
        if self.scene.objects.len() > 1 {
            self.scene.objects.iter().map(|o| o.name.clone()).collect()
        } else {
            self.scene.materials.iter().map(|m| m.name.clone()).collect()
        }
    }

    /// Row, column and part of the scene (see [`Self::object_names`]) of every `step`th pixel of a frame.
    pub(crate) fn objects(&self, at: usize, step: usize) -> Vec<(usize, usize, usize)> {
        let mut scene = (*self.scene).clone();
        let several = scene.objects.len() > 1;
        let count = self.object_names().len();
        for v in &mut scene.vertices {
            v.material = if several { v.object } else { v.material };
        }
        // Unlit, so that the number of the part comes through as its radiance.
        scene.shading = Shading::Unlit;
        let part = |i: usize| Material { kd: [i as f32 + 1.0, 0.0, 0.0], ..Material::default() };
        scene.materials = (0..count.max(1)).map(part).collect();
        let small = self.intrinsics.divided(step as u32);
        let time_s = self.starts_s[at];
        let world_from_camera = self.trajectory.pose_at(time_s);
        let view = View { intrinsics: small, world_from_camera, time_s };
        let seen = render(&scene, &view, &[[0.5, 0.5]], None).color;
        let mut out = Vec::new();
        for y in 0..seen.height {
            for x in 0..seen.width {
                let id = seen.pixel(x, y)[0].round() as usize;
                if id > 0 {
                    out.push((y * step + step / 2, x * step + step / 2, id - 1));
                }
            }
        }
        out
    }
}
