//! `demo-capture`: the capture that ships in `demo/capture`. A head on a walking robot looks through the blue goal at
//! a small football field in a closed room and pans at up to 2.6 rad/s, so that shutter and blur show at a glance.
//! The same bytes on every run: all of it is closed forms, written with fixed decimals.

mod field;
pub mod mesh;
pub mod motion;
pub mod textures;

use std::fs;
use std::io::Cursor;
use std::path::Path;

use anyhow::{Context, Result};
use image::{ImageFormat, RgbImage};
use shutterbug::camera::Intrinsics;

/// The pinhole of the capture, px.
const INTRINSICS: Intrinsics =
    Intrinsics { width: 320, height: 240, fx: 250.0, fy: 250.0, cx: 160.0, cy: 120.0 };

const HEAD: &str =
    "# Shutterbug demo capture, made by `shutterbug-tools demo-capture`. Licence: MIT OR Apache-2.0.\n";

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
    Ok(())
}

/// Names, relative to the capture's folder, and contents of all files.
fn files() -> Result<Vec<(&'static str, Vec<u8>)>> {
    let obj = field::mesh().obj(&format!("{HEAD}# Metres, z up.\nmtllib scene.mtl\n"));
    Ok(vec![
        ("camera.toml", camera_toml().into_bytes()),
        ("frames.csv", frames_csv().into_bytes()),
        ("lights.toml", lights_toml().into_bytes()),
        ("scene.obj", obj.into_bytes()),
        ("scene.mtl", format!("{HEAD}{}", field::MATERIALS).into_bytes()),
        ("trajectory.tum", motion::tum(motion::SPAN_S, 500, motion::camera).into_bytes()),
        ("objects/ball.tum", motion::tum(motion::SPAN_S, 200, motion::ball).into_bytes()),
        ("objects/robot.tum", motion::tum(motion::SPAN_S, 200, motion::robot).into_bytes()),
        ("grass.png", png(&textures::grass())?),
        ("wall.png", png(&textures::wall())?),
        ("banner.png", png(&textures::banner())?),
    ])
}

fn camera_toml() -> String {
    let k = INTRINSICS;
    let period_s = 1.0 / motion::FRAME_RATE_HZ;
    format!(
        "{HEAD}width = {}\nheight = {}\nfx = {:.1}\nfy = {:.1}\ncx = {:.1}\ncy = {:.1}\n\
         frame_period_s = {period_s:.9}\nshading = \"lit\"\n",
        k.width, k.height, k.fx, k.fy, k.cx, k.cy
    )
}

fn frames_csv() -> String {
    let rows = (0..motion::FRAMES).map(|i| format!("{},{i:06}.png\n", motion::timestamp_ns(i)));
    std::iter::once("#timestamp [ns],filename\n".to_owned()).chain(rows).collect()
}

fn lights_toml() -> String {
    let [constant, linear, quadratic] = field::ATTENUATION;
    let light = |p: &glam::DVec3| {
        format!(
            "\n[[light]]\nposition = [{:.2}, {:.2}, {:.2}]\ncolor = [{c:.2}, {c:.2}, {c:.2}]\n\
             attenuation = [{constant:.2}, {linear:.2}, {quadratic:.2}]\n",
            p.x,
            p.y,
            p.z,
            c = field::LIGHT_COLOR
        )
    };
    HEAD.to_owned() + &field::LIGHTS.iter().map(light).collect::<String>()
}

/// A picture as a PNG file's bytes.
///
/// # Errors
/// A picture that cannot be encoded.
pub fn png(picture: &RgbImage) -> Result<Vec<u8>> {
    let mut bytes = Cursor::new(Vec::new());
    picture.write_to(&mut bytes, ImageFormat::Png).context("cannot encode a texture")?;
    Ok(bytes.into_inner())
}

#[cfg(test)]
mod tests;
