//! `table1-scene`: the capture that ships in `scenes/table1`, after the paper's section 4: 73 objects from a simple box
//! to a complete room, about 12000 triangles, five lights. A RoboCup field in a gym hall, seen by a robot at the touch
//! line that pans after the ball. The same bytes on every run: all of it is closed forms, written with fixed decimals.

mod furniture;
mod hall;
mod motion;
mod robots;

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use glam::{DAffine3, DVec3};

use crate::demo_capture::mesh::Mesh;
use crate::demo_capture::motion::tum;
use crate::demo_capture::{png, textures};

/// Objects of the paper's benchmark scene.
#[cfg(test)]
const OBJECTS: usize = 73;
/// Triangles that the paper names ("about").
#[cfg(test)]
const TRIANGLES: usize = 12_000;

const HEAD: &str = "# Shutterbug's scene for Table 1 of the paper, made by `shutterbug-tools table1-scene`.\n\
                    # Licence: MIT OR Apache-2.0.\n";

const README: &str = "# The scene of Table 1

Written by `shutterbug-tools table1-scene --out scenes/table1`, the same bytes each time; change the maker in
`tools/src/table1_scene/`, not the files. A test in `tools` checks the bytes and the counts.

What the paper says of its benchmark scene: 73 objects from a simple box up to a complete room, about 12000 triangles a
frame, five light sources, lighting per fragment. This one has exactly 73 objects, 12000 triangles within 1 %, and five
point lights in `lights.toml`. Three balls and four robots move (`objects/`), the camera pans at about 0.9 rad/s.
`cargo bench --bench table1` measures with it; `shutterbug simulate scenes/table1 --method paper --out out/table1`
shows it.

Licence of everything here: MIT OR Apache-2.0.
";

/// Writes the capture.
///
/// # Errors
/// A file or folder that cannot be written.
pub fn write(out: &Path) -> Result<()> {
    for (name, bytes) in files()? {
        let path = out.join(name);
        let folder = path.parent().unwrap_or(out);
        fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        fs::write(&path, bytes).with_context(|| format!("cannot write {}", path.display()))?;
    }
    let mesh = mesh();
    println!("{} objects, {} triangles", mesh.obj("").matches("o ").count(), mesh.triangle_count());
    Ok(())
}

/// The whole scene. Moving objects are in coordinates of their own.
fn mesh() -> Mesh {
    let mut mesh = Mesh::default();
    hall::add(&mut mesh);
    furniture::add(&mut mesh);
    robots::add(&mut mesh);
    mesh
}

/// Puts what is added by `add` to a place, turned to the left by `turn_rad`.
fn at(mesh: &mut Mesh, place_m: DVec3, turn_rad: f64, add: impl FnOnce(&mut Mesh)) {
    let before = mesh.place;
    mesh.place = before * DAffine3::from_translation(place_m) * DAffine3::from_rotation_z(turn_rad);
    add(mesh);
    mesh.place = before;
}

/// Names, relative to the capture's folder, and contents of all files.
fn files() -> Result<Vec<(String, Vec<u8>)>> {
    let obj = mesh().obj(&format!("{HEAD}# Metres, z up.\nmtllib scene.mtl\n"));
    let materials = [HEAD, hall::MATERIALS, furniture::MATERIALS, robots::MATERIALS].concat();
    let mut files = vec![
        ("README.md", README.as_bytes().to_vec()),
        ("camera.toml", camera_toml().into_bytes()),
        ("frames.csv", motion::frames_csv().into_bytes()),
        ("lights.toml", lights_toml().into_bytes()),
        ("scene.obj", obj.into_bytes()),
        ("scene.mtl", materials.into_bytes()),
        ("trajectory.tum", tum(motion::SPAN_S, 500, motion::camera).into_bytes()),
        ("grass.png", png(&textures::grass())?),
        ("wall.png", png(&textures::wall())?),
        ("banner.png", png(&textures::banner())?),
    ]
    .into_iter()
    .map(|(name, bytes)| (name.to_owned(), bytes))
    .collect::<Vec<_>>();
    for (name, pose) in motion::objects() {
        files.push((format!("objects/{name}.tum"), tum(motion::SPAN_S, 200, pose).into_bytes()));
    }
    Ok(files)
}

fn camera_toml() -> String {
    format!(
        "{HEAD}# A cheap camera under gym lights.\nwidth = 640\nheight = 480\nfx = 512.0\nfy = 512.0\ncx = 320.0\n\
         cy = 240.0\nframe_period_s = {:.9}\nshading = \"lit\"\n\n[rolling_shutter]\nreadout_time_s = 0.025\n\
         scan_order = \"top_to_bottom\"\n\n[motion_blur]\nexposure_time_s = 0.010\n\n[paper_noise]\n\
         static_variance_r = 0.00002\nstatic_variance_g = 0.00002\nstatic_variance_b = 0.00003\n\
         color_variance_r = 0.00010\ncolor_variance_g = 0.00008\ncolor_variance_b = 0.00016\n\
         edge_variance_r = 0.002\nedge_variance_g = 0.002\nedge_variance_b = 0.002\n",
        1.0 / motion::FRAME_RATE_HZ
    )
}

fn lights_toml() -> String {
    let light = |p: &DVec3| {
        format!(
            "\n[[light]]\nposition = [{:.2}, {:.2}, {:.2}]\ncolor = [1.12, 1.08, 1.02]\n\
             attenuation = [1.00, 0.06, 0.06]\n",
            p.x, p.y, p.z
        )
    };
    HEAD.to_owned() + &hall::LIGHTS.iter().map(light).collect::<String>()
}

#[cfg(test)]
mod tests;
