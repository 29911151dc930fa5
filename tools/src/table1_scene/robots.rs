//! Balls and robots. Those that move are in coordinates of their own; `motion.rs` says where they are.

use glam::{DAffine3, DVec3, dvec3};

use super::{at, motion};
use crate::demo_capture::mesh::Mesh;

/// Radius of a ball, m.
pub const BALL_RADIUS_M: f64 = 0.08;

/// Materials of this file. Colours are linear.
pub const MATERIALS: &str = concat!(
    "\
newmtl orange
Kd 0.90 0.22 0.02
Ks 0.3 0.3 0.3
Ns 32
newmtl white
Kd 0.85 0.85 0.85
Ks 0.3 0.3 0.3
Ns 32
",
    robot_parts!(),
    "\
newmtl jersey_red
Kd 0.75 0.03 0.05
Ks 0.1 0.1 0.1
Ns 8
newmtl jersey_blue
Kd 0.03 0.15 0.70
Ks 0.1 0.1 0.1
Ns 8
newmtl eye
Kd 0.10 0.85 0.95
Ks 0.5 0.5 0.5
Ns 40
"
);

/// Adds 13 objects: 5 balls and 8 robots.
pub fn add(mesh: &mut Mesh) {
    for i in 0..5 {
        let name = format!("ball_{}", i + 1);
        let place = motion::resting(&name);
        mesh.object(&name);
        at(mesh, place.map_or(DVec3::ZERO, |p| p.0), 0.0, |m| {
            m.ball(BALL_RADIUS_M, |sector, ring| match ((sector / 2 + ring / 2) % 2, i) {
                (0, 0..3) => "orange",
                (0, _) => "white",
                _ => "dark",
            });
        });
    }
    for i in 0..8 {
        let name = format!("robot_{}", i + 1);
        let (place, turn) = motion::resting(&name).unwrap_or_default();
        mesh.object(&name);
        let jersey = if i % 2 == 0 { "jersey_red" } else { "jersey_blue" };
        at(mesh, place, turn, |m| robot(m, jersey, 0.35 - 0.2 * f64::from(i % 3)));
    }
}

/// A humanoid of 0.58 m, feet at z = 0, facing +x; `swing_rad` moves the arms.
fn robot(mesh: &mut Mesh, jersey: &'static str, swing_rad: f64) {
    for (side, swing) in [(-1.0, swing_rad), (1.0, -swing_rad)] {
        let y = side * 0.055;
        mesh.cuboid("shell", dvec3(-0.06, y - 0.035, 0.0), dvec3(0.09, y + 0.035, 0.04));
        at(mesh, dvec3(0.0, y, 0.0), 0.0, |m| {
            m.lathe("joint", &[[0.022, 0.04], [0.03, 0.06]], 6);
            m.lathe("shell", &[[0.03, 0.06], [0.042, 0.11], [0.032, 0.15]], 6);
            m.lathe("joint", &[[0.028, 0.15], [0.028, 0.17]], 6);
            m.lathe("shell", &[[0.034, 0.17], [0.045, 0.22], [0.04, 0.26]], 6);
        });
        arm(mesh, dvec3(0.0, side * 0.125, 0.42), swing);
        mesh.ball_at(dvec3(0.0, side * 0.115, 0.425), 0.035, "shell");
    }
    let hip = [[0.04, 0.24], [0.085, 0.26], [0.08, 0.29]];
    mesh.lathe("joint", &hip, 10);
    let torso = [[0.075, 0.29], [0.095, 0.36], [0.10, 0.42], [0.07, 0.455], [0.035, 0.465]];
    mesh.lathe(jersey, &torso, 10);
    mesh.lathe("joint", &[[0.03, 0.46], [0.03, 0.485]], 6);
    let head = [[0.0, 0.475], [0.045, 0.483], [0.068, 0.51], [0.07, 0.535], [0.055, 0.565], [0.0, 0.58]];
    mesh.lathe("shell", &head, 10);
    for side in [-1.0, 1.0] {
        mesh.cuboid(
            "eye",
            dvec3(0.05, side * 0.032 - 0.011, 0.52),
            dvec3(0.071, side * 0.032 + 0.011, 0.542),
        );
        mesh.cuboid(
            "dark",
            dvec3(-0.02, side * 0.072 - 0.008, 0.505),
            dvec3(0.02, side * 0.072 + 0.008, 0.548),
        );
    }
}

fn arm(mesh: &mut Mesh, shoulder_m: DVec3, swing_rad: f64) {
    let before = mesh.place;
    mesh.place = before * DAffine3::from_translation(shoulder_m) * DAffine3::from_rotation_y(swing_rad);
    mesh.lathe("shell", &[[0.02, -0.11], [0.03, -0.06], [0.026, 0.0]], 6);
    mesh.place =
        mesh.place * DAffine3::from_translation(dvec3(0.0, 0.0, -0.11)) * DAffine3::from_rotation_y(-0.5);
    mesh.lathe("shell", &[[0.0, -0.13], [0.024, -0.12], [0.026, -0.06], [0.018, 0.0]], 6);
    mesh.place = before;
}
