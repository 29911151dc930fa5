//! Materials that both scenes have, as text of an MTL file: diffuse, specular, exponent, texture. Colours are linear.

/// A textured ground and wall.
macro_rules! ground_and_wall {
    () => {
        "\
newmtl grass
Kd 0.9 0.9 0.9
Ks 0 0 0
Ns 1
map_Kd grass.png
newmtl wall
Kd 0.9 0.9 0.9
Ks 0 0 0
Ns 1
map_Kd wall.png
"
    };
}

/// A robot but for its jersey.
macro_rules! robot_parts {
    () => {
        "\
newmtl dark
Kd 0.04 0.03 0.03
Ks 0.3 0.3 0.3
Ns 32
newmtl shell
Kd 0.75 0.75 0.78
Ks 0.4 0.4 0.4
Ns 24
newmtl joint
Kd 0.12 0.12 0.14
Ks 0.3 0.3 0.3
Ns 24
"
    };
}
