//! The room, the field with lines, goals and nets, landmarks, lamps, banners and columns. Metres, z up, the field's
//! centre at the origin, the yellow goal at +x.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};

use super::at;
use crate::demo_capture::mesh::Mesh;
use crate::pitch::Lines;

/// Inner corners of the room, m.
pub const ROOM: [DVec3; 2] = [dvec3(-5.5, -4.0, 0.0), dvec3(5.5, 4.0, 3.2)];
/// Half the field's length and width between the middles of its lines, m.
const FIELD_HALF: [f64; 2] = [3.0, 2.0];
/// Where the lights are, a little under their lamps, m.
pub const LIGHTS: [DVec3; 5] = [
    dvec3(-3.2, 1.9, 2.55),
    dvec3(-3.2, -1.9, 2.55),
    dvec3(0.0, 0.0, 2.55),
    dvec3(3.2, 1.9, 2.55),
    dvec3(3.2, -1.9, 2.55),
];
/// The carpet's height over the floor, and that of paint over the carpet, m.
const CARPET_M: f64 = 0.01;
const PAINT_M: f64 = 0.004;
/// Longest side of a piece of the room's faces, m.
const PIECE_M: f64 = 0.8;
const LINES: Lines = Lines {
    half_m: FIELD_HALF,
    width_m: 0.06,
    heights_m: [CARPET_M + PAINT_M, CARPET_M + 1.5 * PAINT_M],
    area_half_width_m: 1.2,
    circle_radius_m: 0.75,
    circle_sides: 48,
};
/// Half the distance of a goal's posts, their height, radius, and the net's depth, m.
const GOAL: [f64; 4] = [0.8, 0.95, 0.05, 0.5];

/// Materials of this file. Colours are linear.
pub const MATERIALS: &str = concat!(
    ground_and_wall!(),
    "\
newmtl banner
Kd 0.95 0.95 0.95
Ks 0 0 0
Ns 1
map_Kd banner.png
newmtl parquet
Kd 0.42 0.26 0.13
Ks 0.12 0.12 0.12
Ns 24
newmtl ceiling
Kd 0.55 0.55 0.52
Ks 0 0 0
Ns 1
newmtl column
Kd 0.10 0.11 0.14
Ks 0.12 0.12 0.12
Ns 16
newmtl line
Kd 0.85 0.85 0.85
Ks 0 0 0
Ns 1
newmtl blue
Kd 0.02 0.10 0.65
Ks 0.4 0.4 0.4
Ns 32
newmtl yellow
Kd 0.85 0.62 0.02
Ks 0.4 0.4 0.4
Ns 32
newmtl pink
Kd 0.85 0.12 0.35
Ks 0.3 0.3 0.3
Ns 32
newmtl net
Kd 0.75 0.75 0.75
Ks 0 0 0
Ns 1
newmtl lamp
Kd 0.9 0.9 0.85
Ks 0.5 0.5 0.5
Ns 40
"
);

/// Adds 34 objects.
pub fn add(mesh: &mut Mesh) {
    room(mesh);
    carpet(mesh);
    LINES.add(mesh);
    for (side, color, goal_name, net_name) in
        [(-1.0, "blue", "goal_blue", "net_blue"), (1.0, "yellow", "goal_yellow", "net_yellow")]
    {
        let place = dvec3(side * FIELD_HALF[0], 0.0, CARPET_M);
        let turn = if side > 0.0 { 0.0 } else { PI };
        mesh.object(goal_name);
        at(mesh, place, turn, |m| goal(m, color));
        mesh.object(net_name);
        at(mesh, place, turn, net);
    }
    beacons(mesh);
    for (i, light) in LIGHTS.iter().enumerate() {
        mesh.object(&format!("lamp_{}", i + 1));
        at(mesh, *light, 0.0, lamp);
    }
    banners(mesh);
    for i in 0..8 {
        let x = -3.9 + 2.6 * f64::from(i % 4);
        let y = if i < 4 { ROOM[1].y - 0.18 } else { ROOM[0].y + 0.18 };
        mesh.object(&format!("column_{}", i + 1));
        at(mesh, dvec3(x, y, 0.0), 0.0, |m| {
            m.lathe("column", &[[0.20, 0.0], [0.14, 0.12], [0.12, 1.6], [0.18, 3.2]], 8);
        });
    }
}

fn room(mesh: &mut Mesh) {
    let [min, max] = ROOM;
    let size = max - min;
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    mesh.object("room");
    mesh.rectangle_in(PIECE_M, "parquet", [min, x, y], [0.0; 2]);
    mesh.rectangle_in(PIECE_M, "ceiling", [min + z, y, x], [0.0; 2]);
    // Foot of each wall and its direction to the right, as seen from inside.
    for (foot, right) in [(min + x + y, -y), (min, y), (min + y, x), (min + x, -x)] {
        mesh.rectangle_in(PIECE_M, "wall", [foot, right, z], [right.length(), size.z]);
    }
}

fn carpet(mesh: &mut Mesh) {
    mesh.object("carpet");
    let (half_x, half_y) = (FIELD_HALF[0] + 0.6, FIELD_HALF[1] + 0.5);
    let origin = dvec3(-half_x, -half_y, CARPET_M);
    mesh.rectangle("grass", origin, DVec3::X * 2.0 * half_x, DVec3::Y * 2.0 * half_y, [half_x, half_y]);
}

/// Posts and bar in the plane x = 0, open towards -x, with stays for the net.
fn goal(mesh: &mut Mesh, material: &'static str) {
    let [half, height, radius, depth] = GOAL;
    for y in [-half, half] {
        mesh.bar(material, dvec3(0.0, y, 0.0), dvec3(0.0, y, height), radius);
        mesh.bar(material, dvec3(0.0, y, height), dvec3(depth, y, 0.02), 0.4 * radius);
    }
    // A little above the posts' ends, so that their open tops are inside the crossbar.
    mesh.bar(material, dvec3(0.0, -half - radius, height), dvec3(0.0, half + radius, height), radius);
    mesh.bar(material, dvec3(depth, -half, 0.02), dvec3(depth, half, 0.02), 0.4 * radius);
}

/// Cords behind a goal: flat strips in the plane from the bar to the ground.
fn net(mesh: &mut Mesh) {
    let [half, height, _, depth] = GOAL;
    let (top, bottom) = (dvec3(0.03, 0.0, height), dvec3(depth, 0.0, 0.02));
    let down = bottom - top;
    let normal = DVec3::Y.cross(down).normalize();
    let cord_m = 0.012;
    for i in 1..16 {
        let y = DVec3::Y * (half * (f64::from(i) / 8.0 - 1.0) - 0.5 * cord_m);
        mesh.rectangle("net", bottom + y, DVec3::Y * cord_m, -down, [0.0; 2]);
    }
    for i in 1..9 {
        let start = bottom - down * (f64::from(i) / 9.0) - DVec3::Y * half + 0.002 * normal;
        let across = cord_m * down.normalize();
        mesh.rectangle("net", start, DVec3::Y * 2.0 * half, -across, [0.0; 2]);
    }
}

/// The landmarks of the four-legged league: two colours one above the other.
fn beacons(mesh: &mut Mesh) {
    let places = [(-3.0, 2.3), (0.0, 2.3), (3.0, 2.3), (-3.0, -2.3), (0.0, -2.3), (3.0, -2.3)];
    let colors = [
        ("blue", "pink"),
        ("pink", "line"),
        ("yellow", "pink"),
        ("pink", "blue"),
        ("line", "pink"),
        ("pink", "yellow"),
    ];
    for (i, ((x, y), (low, high))) in places.into_iter().zip(colors).enumerate() {
        mesh.object(&format!("beacon_{}", i + 1));
        at(mesh, dvec3(x, y, CARPET_M), 0.0, |m| {
            m.lathe("line", &[[0.12, 0.0], [0.10, 0.30]], 10);
            m.lathe(low, &[[0.10, 0.30], [0.10, 0.50]], 10);
            m.lathe(high, &[[0.10, 0.50], [0.10, 0.70]], 10);
            m.lathe("line", &[[0.10, 0.70], [0.0, 0.72]], 10);
        });
    }
}

/// A hanging shade around the light at the origin, open below.
fn lamp(mesh: &mut Mesh) {
    let ceiling_m = ROOM[1].z - LIGHTS[0].z;
    mesh.lathe("lamp", &[[0.30, 0.02], [0.26, 0.14], [0.015, 0.22], [0.015, ceiling_m]], 10);
}

fn banners(mesh: &mut Mesh) {
    let [min, max] = ROOM;
    let mut one = |number: u32, foot: DVec3, right: DVec3| {
        let inwards = right.cross(DVec3::Z).normalize();
        mesh.object(&format!("banner_{number}"));
        mesh.rectangle("banner", foot + 0.03 * inwards + 1.45 * DVec3::Z, right, 0.5 * DVec3::Z, [1.0, 1.0]);
    };
    for i in 0..2 {
        let s = f64::from(i);
        one(1 + i, dvec3(-4.4 + 4.9 * s, max.y, 0.0), DVec3::X * 3.9);
        one(3 + i, dvec3(4.4 - 4.9 * s, min.y, 0.0), -DVec3::X * 3.9);
        one(5 + i, dvec3(max.x, 3.7 - 3.8 * s, 0.0), -DVec3::Y * 3.6);
        one(7 + i, dvec3(min.x, -3.7 + 3.8 * s, 0.0), DVec3::Y * 3.6);
    }
}
