//! `lights.toml`: the point lights of a lit scene.

use std::path::Path;

use toml::de::DeTable;

use super::text::TomlText;
use crate::error::{Error, Result};
use crate::scene::{MAX_LIGHTS, PointLight};

const KEYS: [&str; 3] = ["position", "color", "attenuation"];

/// Largest magnitude of any number of a light: squares of it stay finite in an `f32`.
const MAX_VALUE: f64 = 1e9;

/// Reads the text of `lights.toml`: `[[light]]` tables with `position` (m), `color` (linear) and `attenuation`
/// (constant, linear 1/m, quadratic 1/m^2: what the colour is divided by at a distance). `path` is what errors name.
///
/// # Errors
/// No light, an unknown or missing key, values that are not three finite numbers, a negative colour, an attenuation
/// that is negative or zero everywhere; with file and line.
pub fn parse_lights(path: &Path, text: &str) -> Result<Vec<PointLight>> {
    let toml = TomlText::new(path, text);
    let table = toml.parse()?;
    if let Some((key, _)) = table.iter().find(|(key, _)| key.get_ref() != "light") {
        return Err(Error::unknown_name(path, toml.line(key.span()), "key", key.get_ref(), ["light"]));
    }
    let no_light = || Error::input(path, None, "no light", "at least one `[[light]]` table");
    let entry = table.get("light").ok_or_else(no_light)?;
    let lights =
        entry.get_ref().as_array().ok_or_else(|| toml.unexpected("light", entry, "`[[light]]` tables"))?;
    if lights.is_empty() {
        return Err(no_light());
    }
    if let Some(first_beyond) = lights.get(MAX_LIGHTS) {
        let found = format!("{} lights, the first too many here", lights.len());
        let line = toml.line(first_beyond.span());
        return Err(Error::input(path, line, found, format!("at most {MAX_LIGHTS}")));
    }
    let light = |entry: &super::text::Entry| {
        let table = entry
            .get_ref()
            .as_table()
            .ok_or_else(|| toml.unexpected("light", entry, "`[[light]]` tables"))?;
        read_light(&toml, toml.line(entry.span()), table)
    };
    lights.iter().map(light).collect()
}

fn read_light(toml: &TomlText, line: usize, table: &DeTable) -> Result<PointLight> {
    for (key, _) in table.iter() {
        if !KEYS.contains(&key.get_ref().as_ref()) {
            return Err(Error::unknown_name(toml.path(), toml.line(key.span()), "key", key.get_ref(), KEYS));
        }
    }
    let vector = |name: &str, what: &str, signed: bool| {
        let expected = format!("a list of three finite numbers: {what}");
        let missing =
            || Error::input(toml.path(), line, format!("a light without `{name}`"), expected.clone());
        let value = table.get(name).ok_or_else(missing)?;
        let v = toml.vector3(name, value, &expected)?;
        match v.iter().find(|c| c.abs() > MAX_VALUE || (!signed && **c < 0.0)) {
            Some(c) => {
                let least = if signed { -MAX_VALUE } else { 0.0 };
                let found = format!("{name} with {c}");
                Err(Error::input(
                    toml.path(),
                    toml.line(value.span()),
                    found,
                    format!("{least:e} to {MAX_VALUE:e}"),
                ))
            }
            None => Ok((v.map(|c| c as f32), toml.line(value.span()))),
        }
    };
    let (position_m, _) = vector("position", "m, in world coordinates", true)?;
    let (color, _) = vector("color", "linear red, green, blue, at least 0", false)?;
    let (attenuation, at) =
        vector("attenuation", "constant, linear (1/m), quadratic (1/m^2), at least 0", false)?;
    if attenuation == [0.0; 3] {
        let expected = "at least one term above 0: the light is divided by their sum";
        return Err(Error::input(toml.path(), at, "attenuation = [0, 0, 0]", expected));
    }
    Ok(PointLight { position_m, color, attenuation })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_read_in_their_order() {
        let text = "[[light]]\nposition = [1, -2, 3.5]\ncolor = [1.0, 0.5, 0]\nattenuation = [1, 0, 0.25]\n\
                    [[light]]\nposition = [0, 0, 9]\ncolor = [2, 2, 2]\nattenuation = [0, 1, 0]\n";
        let lights = parse_lights(Path::new("lights.toml"), text).expect("valid");
        let first = PointLight {
            position_m: [1.0, -2.0, 3.5],
            color: [1.0, 0.5, 0.0],
            attenuation: [1.0, 0.0, 0.25],
        };
        let second =
            PointLight { position_m: [0.0, 0.0, 9.0], color: [2.0; 3], attenuation: [0.0, 1.0, 0.0] };
        assert_eq!(lights, [first, second]);
    }
}
