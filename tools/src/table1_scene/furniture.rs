//! What stands around the field: chairs, tables, laptops, crates, cones, a trophy, a scoreboard.

use std::f64::consts::PI;

use glam::{DVec3, dvec3};

use super::at;
use crate::demo_capture::mesh::Mesh;

/// Materials of this file. Colours are linear.
pub const MATERIALS: &str = "\
newmtl wood
Kd 0.45 0.28 0.12
Ks 0.1 0.1 0.1
Ns 12
newmtl metal
Kd 0.35 0.36 0.38
Ks 0.6 0.6 0.6
Ns 48
newmtl seat
Kd 0.05 0.20 0.45
Ks 0.1 0.1 0.1
Ns 12
newmtl crate
Kd 0.55 0.40 0.22
Ks 0.02 0.02 0.02
Ns 4
newmtl cone
Kd 0.90 0.20 0.02
Ks 0.2 0.2 0.2
Ns 20
newmtl gold
Kd 0.80 0.55 0.12
Ks 0.9 0.8 0.4
Ns 64
newmtl screen
Kd 0.10 0.30 0.55
Ks 0.5 0.5 0.5
Ns 64
newmtl black
Kd 0.03 0.03 0.035
Ks 0.2 0.2 0.2
Ns 24
newmtl digit
Kd 0.95 0.12 0.05
Ks 0 0 0
Ns 1
";

/// Adds 26 objects.
pub fn add(mesh: &mut Mesh) {
    for i in 0..8 {
        let (x, side) = (-2.9 + 1.9 * f64::from(i % 4), if i < 4 { 1.0 } else { -1.0 });
        mesh.object(&format!("chair_{}", i + 1));
        at(mesh, dvec3(x, side * 3.15, 0.0), side * -0.5 * PI + 0.1 * f64::from(i % 3), chair);
    }
    for (i, (x, y, turn)) in
        [(4.7, 2.6, 0.5 * PI), (4.7, -2.6, 0.5 * PI), (-4.8, 2.6, 0.5 * PI)].into_iter().enumerate()
    {
        mesh.object(&format!("table_{}", i + 1));
        at(mesh, dvec3(x, y, 0.0), turn, table);
        mesh.object(&format!("laptop_{}", i + 1));
        at(mesh, dvec3(x, y - 0.2, 0.74), if x > 0.0 { PI } else { 0.0 }, laptop);
    }
    // From a simple box ...
    let crates = [
        (4.6, 0.9, 0.0, 0.5),
        (4.62, 1.5, 0.0, 0.45),
        (4.6, 1.15, 0.5, 0.4),
        (-4.7, -1.8, 0.0, 0.5),
        (-4.7, -2.5, 0.0, 0.45),
        (4.75, -1.2, 0.0, 0.6),
    ];
    for (i, (x, y, z, side)) in crates.into_iter().enumerate() {
        mesh.object(&format!("crate_{}", i + 1));
        let half = dvec3(0.5 * side, 0.5 * side, 0.0);
        at(mesh, dvec3(x, y, z), 0.3 * i as f64, |m| m.cuboid("crate", -half, half + DVec3::Z * side));
    }
    for (i, (x, y)) in [(3.9, 2.8), (3.9, -2.8), (-3.9, 2.8), (-3.9, -2.8)].into_iter().enumerate() {
        mesh.object(&format!("cone_{}", i + 1));
        at(mesh, dvec3(x, y, 0.0), 0.0, cone);
    }
    mesh.object("trophy");
    at(mesh, dvec3(4.7, 3.0, 0.74), 0.0, trophy);
    mesh.object("scoreboard");
    at(mesh, dvec3(5.44, 0.0, 2.1), PI, scoreboard);
}

/// Faces +x.
fn chair(mesh: &mut Mesh) {
    for (x, y) in [(-0.18, -0.18), (-0.18, 0.18), (0.18, -0.18), (0.18, 0.18)] {
        mesh.cuboid("metal", dvec3(x - 0.015, y - 0.015, 0.0), dvec3(x + 0.015, y + 0.015, 0.44));
    }
    mesh.cuboid("seat", dvec3(-0.21, -0.21, 0.44), dvec3(0.21, 0.21, 0.48));
    mesh.cuboid("seat", dvec3(-0.22, -0.21, 0.55), dvec3(-0.18, 0.21, 0.88));
}

/// Long side along x.
fn table(mesh: &mut Mesh) {
    for (x, y) in [(-0.65, -0.3), (-0.65, 0.3), (0.65, -0.3), (0.65, 0.3)] {
        mesh.cuboid("metal", dvec3(x - 0.02, y - 0.02, 0.0), dvec3(x + 0.02, y + 0.02, 0.70));
    }
    mesh.cuboid("wood", dvec3(-0.72, -0.36, 0.70), dvec3(0.72, 0.36, 0.74));
}

/// Its screen faces +x.
fn laptop(mesh: &mut Mesh) {
    mesh.cuboid("black", dvec3(-0.10, -0.16, 0.0), dvec3(0.12, 0.16, 0.018));
    mesh.cuboid("black", dvec3(-0.12, -0.16, 0.018), dvec3(-0.105, 0.16, 0.22));
    mesh.rectangle("screen", dvec3(-0.104, -0.145, 0.03), DVec3::Y * 0.29, DVec3::Z * 0.18, [0.0; 2]);
}

fn cone(mesh: &mut Mesh) {
    mesh.cuboid("black", dvec3(-0.14, -0.14, 0.0), dvec3(0.14, 0.14, 0.02));
    mesh.lathe("cone", &[[0.11, 0.02], [0.082, 0.14]], 10);
    mesh.lathe("line", &[[0.082, 0.14], [0.056, 0.25]], 10);
    mesh.lathe("cone", &[[0.056, 0.25], [0.025, 0.38], [0.0, 0.39]], 10);
}

fn trophy(mesh: &mut Mesh) {
    mesh.lathe("black", &[[0.08, 0.0], [0.08, 0.05], [0.05, 0.06]], 12);
    let cup = [
        [0.05, 0.06],
        [0.018, 0.09],
        [0.015, 0.16],
        [0.04, 0.19],
        [0.075, 0.24],
        [0.09, 0.31],
        [0.095, 0.36],
        [0.0, 0.37],
    ];
    mesh.lathe("gold", &cup, 16);
    for side in [-1.0, 1.0] {
        mesh.cuboid(
            "gold",
            dvec3(-0.008, side * 0.12 - 0.008, 0.25),
            dvec3(0.008, side * 0.12 + 0.008, 0.34),
        );
    }
}

/// Faces +x: 2 to 1 in seven segments.
fn scoreboard(mesh: &mut Mesh) {
    mesh.cuboid("black", dvec3(0.0, -0.7, 0.0), dvec3(0.05, 0.7, 0.6));
    // Segments as (y, z, along y): top, middle, bottom, upper left, upper right, lower left, lower right.
    const SEGMENTS: [(f64, f64, bool); 7] = [
        (0.0, 0.4, true),
        (0.0, 0.2, true),
        (0.0, 0.0, true),
        (-0.1, 0.2, false),
        (0.1, 0.2, false),
        (-0.1, 0.0, false),
        (0.1, 0.0, false),
    ];
    for (place, lit) in [
        (-0.35, [true, true, true, false, true, true, false]),
        (0.35, [false, false, false, false, true, false, true]),
    ] {
        for ((y, z, along), _) in SEGMENTS.into_iter().zip(lit).filter(|(_, on)| *on) {
            let (low, size) = match along {
                true => (dvec3(0.051, place + y - 0.08, 0.08 + z), [0.16, 0.035]),
                false => (dvec3(0.051, place + y - 0.017, 0.11 + z), [0.035, 0.17]),
            };
            mesh.rectangle("digit", low, DVec3::Y * size[0], DVec3::Z * size[1], [0.0; 2]);
        }
    }
}
