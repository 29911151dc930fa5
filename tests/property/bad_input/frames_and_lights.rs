//! Lines of `frames.csv` and `lights.toml` that are wrong.

use super::{FRAMES, Fixture, LIGHTS};

#[test]
fn frames_that_are_wrong() {
    let plain = "expected a plain name such as 000000.png, without folders";
    for (to, error) in [
        ("1700000000040000000", "frames.csv:3: found `1700000000040000000`; expected `timestamp in ns,file \
            name`".to_owned()),
        (
            "1700000000.04,000001.png",
            "frames.csv:3: found timestamp `1700000000.04`; expected a whole number of ns that fits in 64 bits; is \
             it in s?".to_owned(),
        ),
        ("later,000001.png", "frames.csv:3: found timestamp `later`; expected a whole number of ns that fits in 64 \
            bits".to_owned()),
        ("nan,000001.png", "frames.csv:3: found timestamp `nan`; expected a whole number of ns that fits in 64 \
            bits".to_owned()),
        (
            "1699999999999999999,000001.png",
            "frames.csv:3: found timestamp 1699999999999999999 ns after 1700000000000000000 ns in line 2; expected \
             timestamps that increase".to_owned(),
        ),
        (
            "1700000000000000000,000001.png",
            "frames.csv:3: found timestamp 1700000000000000000 ns after 1700000000000000000 ns in line 2; expected \
             timestamps that increase".to_owned(),
        ),
        (
            "1700000000040000000,000000.png",
            "frames.csv:3: found file name `000000.png` again, after line 2; expected names that differ, leaving the \
             extension aside".to_owned(),
        ),
        (
            "1700000000040000000,000000.jpg",
            "frames.csv:3: found file name `000000.jpg` again, after line 2; expected names that differ, leaving the \
             extension aside".to_owned(),
        ),
        ("1700000000040000000,../000001.png", format!("frames.csv:3: found file name `../000001.png`; {plain}")),
        ("1700000000040000000,real/1.png", format!("frames.csv:3: found file name `real/1.png`; {plain}")),
        ("1700000000040000000,real\\1.png", format!("frames.csv:3: found file name `real\\\\1.png`; {plain}")),
        ("1700000000040000000,..", format!("frames.csv:3: found file name `..`; {plain}")),
        ("1700000000040000000,", format!("frames.csv:3: found file name ``; {plain}")),
        ("1700000000040000000,a\0.png", format!("frames.csv:3: found file name `a\\0.png`; {plain}")),
    ] {
        Fixture::spoilt("frames.csv", "1700000000040000000,000001.png", to, &error);
    }
    let none = "frames.csv: found no frame; expected at least one line `timestamp in ns,file name`";
    Fixture::spoilt("frames.csv", FRAMES, "#timestamp [ns],filename\n", none);
}

#[test]
fn lights_that_are_wrong() {
    let numbers = "expected a list of three finite numbers";
    for (from, to, error) in [
        ("color", "colour", "lights.toml:4: unknown key `colour`; did you mean `color`?".to_owned()),
        ("[[light]]", "[[lights]]", "lights.toml:2: unknown key `lights`; did you mean `light`?".to_owned()),
        ("[[light]]", "[light]", "lights.toml:2: found light = a table; expected `[[light]]` tables".to_owned()),
        (LIGHTS, "", "lights.toml: found no light; expected at least one `[[light]]` table".to_owned()),
        (LIGHTS, "light = []", "lights.toml: found no light; expected at least one `[[light]]` table".to_owned()),
        (LIGHTS, "light = [1]", "lights.toml:1: found light = 1; expected `[[light]]` tables".to_owned()),
        ("color = [1.0, 0.9, 0.8]\n", "", format!("lights.toml:2: found a light without `color`; {numbers}: linear \
            red, green, blue, at least 0")),
        ("[1.0, 2.0, 3.0]", "[1.0, 2.0]", format!("lights.toml:3: found position = a list of 2; {numbers}: m, in \
            world coordinates")),
        ("[1.0, 2.0, 3.0]", "[1.0, nan, 3.0]", format!("lights.toml:3: found position = nan; {numbers}: m, in world \
            coordinates")),
        ("0.9", "-0.9", "lights.toml:4: found color with -0.9; expected 0e0 to 1e9".to_owned()),
        ("0.9", "2e9", "lights.toml:4: found color with 2000000000; expected 0e0 to 1e9".to_owned()),
        (
            "[1.0, 0.0, 0.1]",
            "[0, 0, 0]",
            "lights.toml:5: found attenuation = [0, 0, 0]; expected at least one term above 0: the light is divided \
             by their sum".to_owned(),
        ),
    ] {
        Fixture::spoilt("lights.toml", from, to, &error);
    }
}
