//! Random scenes: a closed room with things in it, as the files of a capture.

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::path::Path;

use super::draw::Draw;
use shutterbug::error::Result;
use shutterbug::plane::{Plane, srgb8, write_atomic, write_png_atomic};

/// Size of a room: x, y, z in m; the floor's middle is the origin.
pub(super) const ROOM_M: [f64; 3] = [6.0, 5.0, 3.0];
/// Side of a texture, texels. At 12 mm a texel is about a pixel at 3 m, so that nothing aliases.
const TEXELS: usize = 256;
const TEXEL_M: f64 = 0.012;

/// An object that moves: name, path of its middle (m) over time.
pub(super) struct Mover {
    pub(super) name: String,
    centre_m: [f64; 3],
    swing_m: [f64; 3],
    rate_hz: f64,
    phase_rad: f64,
}

impl Mover {
    /// Position at a time, m, and angle about the vertical, rad.
    pub(super) fn at(&self, time_s: f64) -> ([f64; 3], f64) {
        let swing = (TAU * self.rate_hz * time_s + self.phase_rad).sin();
        ([0, 1, 2].map(|i| self.centre_m[i] + self.swing_m[i] * swing), 0.6 * swing)
    }
}

/// What a scene asks of its capture.
pub(super) struct Room {
    pub(super) lit: bool,
    pub(super) movers: Vec<Mover>,
}

/// Writes `scene.obj`, `scene.mtl`, textures and, for some, `lights.toml`.
///
/// # Errors
/// Files that cannot be written.
pub(super) fn write(folder: &Path, draw: &mut Draw) -> Result<Room> {
    let mut files =
        Files { obj: "mtllib scene.mtl\n".to_owned(), mtl: String::new(), vertices: 0, materials: 0 };
    // Each side of the room: a material of its own.
    let [x, y, z] = ROOM_M;
    let textures = 2 + draw.index(3);
    for i in 0..textures {
        write_png_atomic(&folder.join(format!("texture{i}.png")), &texture(draw))?;
    }
    files.obj += "o room\n";
    let (half, low) = ([x / 2.0, y / 2.0], 0.0);
    for face in 0..6 {
        // A blank wall that fills the picture shows nothing of anything.
        files.material(draw, textures, 0.9);
        files.face([-half[0], -half[1], low], [half[0], half[1], z], face);
    }
    for i in 0..8 + draw.index(9) {
        let size = [(); 3].map(|()| draw.between(0.15, 0.9));
        let at = ring_place(draw, size[2]);
        writeln!(files.obj, "o thing{i}").expect("a String");
        for face in 0..6 {
            if face == 0 || draw.chance(0.35) {
                files.material(draw, textures, 0.5);
            }
            files.cuboid_face(at, size, face);
        }
    }
    let movers: Vec<Mover> = (0..[0, 0, 1, 1, 2][draw.index(5)]).map(|i| mover(draw, i)).collect();
    for mover in &movers {
        writeln!(files.obj, "o {}", mover.name).expect("a String");
        files.material(draw, textures, 0.5);
        let size = [(); 3].map(|()| draw.between(0.2, 0.5));
        (0..6).for_each(|face| files.cuboid_face([0.0; 3], size, face));
    }
    let lit = draw.chance(0.3);
    if lit {
        write_atomic(&folder.join("lights.toml"), lights(draw).as_bytes())?;
    }
    write_atomic(&folder.join("scene.obj"), files.obj.as_bytes())?;
    write_atomic(&folder.join("scene.mtl"), files.mtl.as_bytes())?;
    Ok(Room { lit, movers })
}

/// A place away from the room's middle, where the camera is.
fn ring_place(draw: &mut Draw, height_m: f64) -> [f64; 3] {
    let (angle, radius) = (draw.between(0.0, TAU), draw.between(1.3, 2.1));
    let z = if draw.chance(0.5) { height_m / 2.0 } else { draw.between(0.4, 2.4) };
    [radius * angle.cos(), radius * angle.sin(), z]
}

fn mover(draw: &mut Draw, i: usize) -> Mover {
    Mover {
        name: format!("mover{i}"),
        centre_m: ring_place(draw, 0.4),
        swing_m: [(); 3].map(|()| draw.between(-0.25, 0.25)),
        rate_hz: draw.between(0.2, 0.8),
        phase_rad: draw.between(0.0, TAU),
    }
}

pub(super) fn lights(draw: &mut Draw) -> String {
    let light = |draw: &mut Draw| {
        let [x, y] = [draw.between(-2.0, 2.0), draw.between(-1.7, 1.7)];
        let color = [(); 3].map(|()| draw.between(0.8, 1.6));
        format!(
            "[[light]]\nposition = [{x}, {y}, 2.7]\ncolor = [{}, {}, {}]\nattenuation = [0.4, 0.1, 0.1]\n",
            color[0], color[1], color[2]
        )
    };
    (0..2 + draw.index(2)).map(|_| light(draw)).collect()
}

/// The text of an OBJ and its MTL in the making.
struct Files {
    obj: String,
    mtl: String,
    vertices: usize,
    materials: usize,
}

impl Files {
    /// A new material, textured with a probability.
    fn material(&mut self, draw: &mut Draw, textures: usize, textured: f64) {
        let kd = [(); 3].map(|()| draw.log_between(0.04, 0.95));
        let name = format!("m{}", self.materials);
        self.materials += 1;
        write!(self.mtl, "newmtl {name}\nKd {} {} {}\n", kd[0], kd[1], kd[2]).expect("a String");
        if draw.chance(textured) {
            writeln!(self.mtl, "map_Kd texture{}.png", draw.index(textures)).expect("a String");
        }
        writeln!(self.obj, "usemtl {name}").expect("a String");
    }

    fn cuboid_face(&mut self, at: [f64; 3], size: [f64; 3], face: usize) {
        let low = [0, 1, 2].map(|i| at[i] - size[i] / 2.0);
        self.face(low, [0, 1, 2].map(|i| at[i] + size[i] / 2.0), face);
    }

    /// Face 0..6 of an axis-aligned box, with texture coordinates in texels of their true size.
    fn face(&mut self, low: [f64; 3], high: [f64; 3], face: usize) {
        let (axis, level) = (face / 2, if face.is_multiple_of(2) { low } else { high });
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        for (a, b) in [(low, low), (high, low), (high, high), (low, high)] {
            let mut p = level;
            (p[u], p[v]) = (a[u], b[v]);
            let texels = |m: f64| m / (TEXEL_M * TEXELS as f64);
            let text = format!("v {} {} {}\nvt {} {}\n", p[0], p[1], p[2], texels(p[u]), texels(p[v]));
            self.obj += &text;
        }
        let n = self.vertices;
        let corner = |i: usize| format!("{0}/{0}", n + i);
        writeln!(self.obj, "f {} {} {} {}", corner(1), corner(2), corner(3), corner(4)).expect("a String");
        self.vertices += 4;
    }
}

/// A texture that repeats, smooth at one texel: noise of several sizes, stripes, checks or spots.
fn texture(draw: &mut Draw) -> Plane<u8> {
    // One dark, one light: two colours that are alike would be no texture.
    let colors = [[(); 3].map(|()| draw.between(0.03, 0.45)), [(); 3].map(|()| draw.between(0.4, 1.0))];
    let kind = draw.index(4);
    let cell = [8, 16, 32, 64][draw.index(4)];
    let lattice: Vec<f64> = (0..TEXELS * TEXELS).map(|_| draw.unit()).collect();
    let at = |x: usize, y: usize| lattice[(y % TEXELS) * TEXELS + x % TEXELS];
    let value = |x: usize, y: usize| -> f64 {
        match kind {
            0 => [64, 32, 16, 8]
                .iter()
                .zip([0.5, 0.25, 0.15, 0.1])
                .map(|(c, w)| w * smooth(&at, x, y, *c))
                .sum(),
            1 => f64::from(u8::from((x / cell).is_multiple_of(2))),
            2 => f64::from(u8::from((x / cell + y / cell).is_multiple_of(2))),
            _ => f64::from(u8::from(smooth(&at, x, y, cell) > 0.55)),
        }
    };
    let sharp: Vec<f64> = (0..TEXELS * TEXELS).map(|i| value(i % TEXELS, i / TEXELS)).collect();
    let sharp_at = |x: usize, y: usize| sharp[(y % TEXELS) * TEXELS + x % TEXELS];
    Plane::from_fn(TEXELS, TEXELS, |x, y| {
        // A binomial filter of 3x3: other programs' filters then agree closely.
        let mut part = 0.0;
        for (dy, wy) in [0.25, 0.5, 0.25].into_iter().enumerate() {
            for (dx, wx) in [0.25, 0.5, 0.25].into_iter().enumerate() {
                part += wx * wy * sharp_at(x + dx + TEXELS - 1, y + dy + TEXELS - 1);
            }
        }
        [0, 1, 2].map(|c| srgb8((colors[0][c] + part * (colors[1][c] - colors[0][c])) as f32))
    })
}

/// Value noise of a cell size that divides the texture's.
fn smooth(at: &impl Fn(usize, usize) -> f64, x: usize, y: usize, cell: usize) -> f64 {
    let (cx, cy, count) = (x / cell, y / cell, TEXELS / cell);
    let ease = |v: usize| {
        let t = (v % cell) as f64 / cell as f64;
        t * t * (3.0 - 2.0 * t)
    };
    let (tx, ty) = (ease(x), ease(y));
    let corner = |dx: usize, dy: usize| at((cx + dx) % count + 7 * cell, (cy + dy) % count);
    let top = corner(0, 0) + tx * (corner(1, 0) - corner(0, 0));
    let bottom = corner(0, 1) + tx * (corner(1, 1) - corner(0, 1));
    top + ty * (bottom - top)
}
