//! What stands in the room: field, goals, walls, ball and robot, with materials and lights. Metres, z up, the field's
//! centre at the origin, the yellow goal at +x.

use glam::{DVec3, dvec3};

use super::mesh::Mesh;
use crate::pitch::Lines;

/// Inner corners of the room, m.
pub const ROOM: [DVec3; 2] = [dvec3(-5.5, -3.5, 0.0), dvec3(4.0, 3.5, 2.8)];
/// Half the field's length (along x) and width, m.
pub const FIELD_HALF: [f64; 2] = [2.25, 1.5];
/// Half the distance between a goal's posts, their height and their radius, m.
pub const GOAL: [f64; 3] = [0.75, 1.1, 0.05];
/// Radius of the ball, m.
pub const BALL_RADIUS_M: f64 = 0.08;
/// Where the lights hang, m.
pub const LIGHTS: [DVec3; 5] = [
    dvec3(-3.6, 1.7, 2.4),
    dvec3(-3.6, -1.7, 2.4),
    dvec3(0.0, 0.0, 2.4),
    dvec3(2.4, 1.7, 2.4),
    dvec3(2.4, -1.7, 2.4),
];
/// Linear colour of every light.
pub const LIGHT_COLOR: f64 = 0.62;
/// Constant, linear (1/m) and quadratic (1/m^2) attenuation of every light.
pub const ATTENUATION: [f64; 3] = [1.0, 0.09, 0.05];

/// Lines lie this far above the grass, m: enough for any depth buffer, too little to see.
const LINE_LIFT_M: f64 = 0.004;
const LINES: Lines = Lines {
    half_m: FIELD_HALF,
    width_m: 0.06,
    heights_m: [LINE_LIFT_M, 1.5 * LINE_LIFT_M],
    area_half_width_m: 1.1,
    circle_radius_m: 0.6,
    circle_sides: 40,
};

/// The materials: diffuse, specular, exponent, texture. Colours are linear.
pub const MATERIALS: &str = concat!(
    ground_and_wall!(),
    "\
newmtl banner
Kd 0.95 0.95 0.95
Ks 0.05 0.05 0.05
Ns 16
map_Kd banner.png
newmtl ceiling
Kd 0.55 0.55 0.52
Ks 0 0 0
Ns 1
newmtl pillar
Kd 0.06 0.065 0.08
Ks 0.1 0.1 0.1
Ns 16
newmtl line
Kd 0.85 0.85 0.85
Ks 0 0 0
Ns 1
newmtl blue
Kd 0.02 0.1 0.65
Ks 0.4 0.4 0.4
Ns 32
newmtl yellow
Kd 0.85 0.62 0.02
Ks 0.4 0.4 0.4
Ns 32
newmtl orange
Kd 0.9 0.22 0.02
Ks 0.3 0.3 0.3
Ns 32
",
    robot_parts!(),
    "\
newmtl jersey
Kd 0.75 0.03 0.05
Ks 0.1 0.1 0.1
Ns 8
"
);

/// The whole scene.
pub fn mesh() -> Mesh {
    let mut mesh = Mesh::default();
    room(&mut mesh);
    LINES.add(&mut mesh);
    for (name, material, x) in
        [("goal_blue", "blue", -FIELD_HALF[0]), ("goal_yellow", "yellow", FIELD_HALF[0])]
    {
        goal(&mut mesh, name, material, x);
    }
    mesh.object("ball");
    mesh.ball(BALL_RADIUS_M, |sector, ring| if (sector / 2 + ring / 2) % 2 == 0 { "orange" } else { "dark" });
    robot(&mut mesh);
    mesh
}

fn room(mesh: &mut Mesh) {
    let [min, max] = ROOM;
    let size = max - min;
    let (x, y, z) = (DVec3::X * size.x, DVec3::Y * size.y, DVec3::Z * size.z);
    mesh.object("room");
    mesh.rectangle("grass", min, x, y, [size.x / 2.0, size.y / 2.0]);
    mesh.rectangle("ceiling", min + z, y, x, [0.0; 2]);
    // Foot of each wall and its direction to the right, as seen from inside.
    let walls = [(min + x + y, -y), (min, y), (min + y, x), (min + x, -x)];
    for (foot, right) in walls {
        let (along, inwards) = (right.normalize(), right.cross(DVec3::Z).normalize());
        let length_m = right.length();
        mesh.rectangle("wall", foot, right, z, [length_m, size.z]);
        // A banner of about 4 m a print, a little in front of the wall.
        let banner = foot + 0.02 * inwards + 1.3 * DVec3::Z;
        mesh.rectangle("banner", banner, right, 0.5 * DVec3::Z, [(length_m / 4.0).round(), 1.0]);
        // Pillars: upright edges over the whole height, on which slant and blur show best.
        let count = (length_m / 1.75).round();
        for i in 1..count as u32 {
            let middle = foot + along * (length_m * f64::from(i) / count) + 0.08 * inwards;
            let half = 0.08 * (along.abs() + inwards.abs());
            mesh.cuboid("pillar", middle - half, middle + half + z);
        }
    }
}

fn goal(mesh: &mut Mesh, name: &str, material: &'static str, x: f64) {
    let [half, height, radius] = GOAL;
    mesh.object(name);
    for y in [-half, half] {
        mesh.bar(material, dvec3(x, y, 0.0), dvec3(x, y, height), radius);
    }
    // A little above the posts' ends, so that their open tops are inside the crossbar.
    mesh.bar(material, dvec3(x, -half - radius, height), dvec3(x, half + radius, height), radius);
}

/// The robot, in its own coordinates: feet at z = 0, facing +x.
fn robot(mesh: &mut Mesh) {
    mesh.object("robot");
    let parts = [
        ("joint", dvec3(-0.06, -0.10, 0.0), dvec3(0.08, -0.03, 0.22)),
        ("joint", dvec3(-0.06, 0.03, 0.0), dvec3(0.08, 0.10, 0.22)),
        ("jersey", dvec3(-0.07, -0.13, 0.22), dvec3(0.07, 0.13, 0.46)),
        ("shell", dvec3(-0.04, -0.19, 0.24), dvec3(0.04, -0.13, 0.45)),
        ("shell", dvec3(-0.04, 0.13, 0.24), dvec3(0.04, 0.19, 0.45)),
        ("shell", dvec3(-0.07, -0.07, 0.48), dvec3(0.07, 0.07, 0.60)),
        ("dark", dvec3(0.0701, -0.05, 0.52), dvec3(0.08, 0.05, 0.56)),
    ];
    for (material, min, max) in parts {
        mesh.cuboid(material, min, max);
    }
}
