//! Descriptions that are not quite right: once the frames' scene and path are read, the files that a diagnosis sees are
//! falsified a little, as those of every real room are.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use glam::{DQuat, DVec3};

use super::draw::Draw;
use crate::diagnose::{POSES, SURFACES, is_constant_factor};
use shutterbug::error::{Error, Result};
use shutterbug::plane::write_atomic;

/// What of a description is falsified.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Falsified {
    /// Each material's reflectance by 10 %, each channel by a third of that besides.
    Reflectance,
    /// The room is lit by point lamps and described as unlit.
    Lamps,
    /// The poses by 0.15 degrees and 3 mm a axis, smooth over 60 ms.
    Poses,
    /// A thing in the room that the scene does not have.
    Object,
}

impl Falsified {
    /// All of them, in the order of the command line.
    pub const ALL: [Self; 4] = [Self::Reflectance, Self::Lamps, Self::Poses, Self::Object];

    /// Its word on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Reflectance => "reflectance",
            Self::Lamps => "lamps",
            Self::Poses => "poses",
            Self::Object => "object",
        }
    }

    /// The name that a report has for it.
    pub fn said(self) -> &'static str {
        match self {
            Self::Reflectance | Self::Lamps => SURFACES,
            Self::Poses => POSES,
            Self::Object => "undescribed_object",
        }
    }

    /// By its word.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|f| f.name() == name)
    }
}

/// Of effects those that frames can tell where so much is falsified: what unknown paint and lamps may be as well is
/// not hidden.
pub(super) fn tells(what: &[Falsified], mut effects: Vec<&'static str>) -> Vec<&'static str> {
    if what.iter().any(|f| f.said() == SURFACES) {
        effects.retain(|name| !is_constant_factor(name));
    }
    effects
}

/// Relative size of the errors of reflectances, standard deviation.
const REFLECTANCE: f64 = 0.1;
/// Errors of poses, rad and m a axis, standard deviations.
const POSE: [f64; 2] = [0.15 * TAU / 360.0, 3e-3];
/// Time over which they change, s.
const POSE_S: f64 = 0.06;

/// Falsifies the files of a capture's folder.
///
/// # Errors
/// Files that cannot be read or written.
pub(super) fn falsify(folder: &Path, what: &[Falsified], draw: &mut Draw) -> Result<()> {
    let change = |name: &str, by: &mut dyn FnMut(&str) -> String| -> Result<()> {
        let path = folder.join(name);
        let text = fs::read_to_string(&path).map_err(|e| Error::io(&path, "read", e))?;
        write_atomic(&path, by(&text).as_bytes())
    };
    if what.contains(&Falsified::Reflectance) {
        change("scene.mtl", &mut |text| reflectances(text, draw))?;
    }
    if what.contains(&Falsified::Poses) {
        change("trajectory.tum", &mut |text| poses(text, draw))?;
    }
    if what.contains(&Falsified::Object) {
        change("scene.obj", &mut |text| without_object(text, draw))?;
    }
    Ok(())
}

/// Normal variable (Box and Muller 1958).
pub(super) fn normal(draw: &mut Draw) -> f64 {
    (-2.0 * draw.unit().max(1e-300).ln()).sqrt() * (TAU * draw.unit()).cos()
}

fn reflectances(mtl: &str, draw: &mut Draw) -> String {
    let mut out = String::new();
    for line in mtl.lines() {
        let Some(rest) = line.strip_prefix("Kd ") else {
            writeln!(out, "{line}").expect("a String");
            continue;
        };
        let all = REFLECTANCE * normal(draw);
        let own = |v: f64| (v * (all + REFLECTANCE / 3.0 * normal(draw)).exp()).min(1.0);
        let kd: Vec<f64> = rest.split_whitespace().filter_map(|v| v.parse().ok()).map(own).collect();
        writeln!(out, "Kd {} {} {}", kd[0], kd[1], kd[2]).expect("a String");
    }
    out
}

/// Poses off by six Ornstein-Uhlenbeck processes, each the mean over a sixth of its own time.
fn poses(tum: &str, draw: &mut Draw) -> String {
    let rows: Vec<Vec<f64>> = tum
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|l| l.split_whitespace().filter_map(|v| v.parse().ok()).collect())
        .filter(|r: &Vec<f64>| r.len() == 8)
        .collect();
    let step_s = if rows.len() > 1 { rows[1][0] - rows[0][0] } else { POSE_S };
    let (keep, half) = ((-step_s / POSE_S).exp(), (POSE_S / 12.0 / step_s).round() as usize);
    let mut tracks = vec![[0.0; 6]; rows.len()];
    for axis in 0..6 {
        let size = POSE[axis / 3];
        let mut now = size * normal(draw);
        for track in &mut tracks {
            track[axis] = now;
            now = keep * now + size * (1.0 - keep * keep).sqrt() * normal(draw);
        }
    }
    let mut out = String::from("# t tx ty tz qx qy qz qw\n");
    for (i, r) in rows.iter().enumerate() {
        let near = &tracks[i.saturating_sub(half)..(i + half + 1).min(tracks.len())];
        let mean = |axis: usize| near.iter().map(|t| t[axis]).sum::<f64>() / near.len() as f64;
        let turn = DQuat::from_scaled_axis(DVec3::new(mean(0), mean(1), mean(2)));
        let q = (DQuat::from_xyzw(r[4], r[5], r[6], r[7]) * turn).normalize();
        let t = DVec3::new(r[1] + mean(3), r[2] + mean(4), r[3] + mean(5));
        let text = format!(
            "{:.6} {:.9} {:.9} {:.9} {:.12} {:.12} {:.12} {:.12}",
            r[0], t.x, t.y, t.z, q.x, q.y, q.z, q.w
        );
        writeln!(out, "{text}").expect("a String");
    }
    out
}

/// The scene without the faces of one of its things.
fn without_object(obj: &str, draw: &mut Draw) -> String {
    let things: Vec<&str> = obj.lines().filter(|l| l.starts_with("o thing")).collect();
    if things.is_empty() {
        return obj.to_owned();
    }
    let out = things[draw.index(things.len())];
    let mut inside = false;
    let mut kept = |line: &&str| {
        if line.starts_with("o ") {
            inside = *line == out;
        }
        !(inside && (line.starts_with("f ") || line.starts_with("o ")))
    };
    obj.lines().filter(|l| kept(l)).map(|l| format!("{l}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectances_change_by_a_tenth_and_names_stay() {
        let mut draw = Draw::new(1, 0, "falsify");
        let mtl: String = (0..200).map(|i| format!("newmtl m{i}\nKd 0.2 0.2 0.2\n")).collect();
        let out = reflectances(&mtl, &mut draw);
        assert_eq!(out.lines().filter(|l| l.starts_with("newmtl")).count(), 200);
        let logs: Vec<f64> = out
            .lines()
            .filter_map(|l| l.strip_prefix("Kd ")?.split(' ').next()?.parse::<f64>().ok())
            .map(|v| (v / 0.2).ln())
            .collect();
        let rms = (logs.iter().map(|l| l * l).sum::<f64>() / 200.0).sqrt();
        assert!((rms / REFLECTANCE - 1.0).abs() < 0.2, "{rms}");
    }

    #[test]
    fn poses_are_off_by_what_is_said_and_smooth() {
        let mut draw = Draw::new(2, 0, "falsify");
        let tum: String = (0..2000).map(|i| format!("{:.6} 0 0 0 0 0 0 1\n", 0.002 * f64::from(i))).collect();
        let out = poses(&tum, &mut draw);
        let rows: Vec<Vec<f64>> = out
            .lines()
            .skip(1)
            .map(|l| l.split(' ').map(|v| v.parse().expect("a number")).collect())
            .collect();
        let rms = |c: usize| (rows.iter().map(|r| r[c] * r[c]).sum::<f64>() / rows.len() as f64).sqrt();
        assert!((rms(1) / POSE[1] - 0.95).abs() < 0.25, "{}", rms(1));
        assert!((2.0 * rms(4) / POSE[0] - 0.95).abs() < 0.25, "{}", rms(4));
        let step = rows.windows(2).map(|w| (w[1][1] - w[0][1]).powi(2)).sum::<f64>() / rows.len() as f64;
        assert!(step.sqrt() < 0.2 * rms(1), "control: jumps");
    }

    #[test]
    fn what_lamps_may_be_is_not_hidden_beside_them() {
        let all = || vec!["white_balance", "gamma", "exposure_gain"];
        assert_eq!(tells(&[Falsified::Poses, Falsified::Lamps], all()), ["gamma"]);
        assert_eq!(tells(&[Falsified::Poses], all()), all());
    }

    #[test]
    fn one_thing_goes_and_the_numbers_of_vertices_stay() {
        let obj = "o room\nv 0 0 0\nf 1 1 1\no thing0\nv 1 0 0\nf 2 2 2\no mover0\nv 2 0 0\nf 3 3 3\n";
        let out = without_object(obj, &mut Draw::new(3, 0, "falsify"));
        assert!(!out.contains("thing0") && !out.contains("f 2") && out.contains("f 3"), "{out}");
        assert_eq!(out.matches("v ").count(), 3);
    }
}
