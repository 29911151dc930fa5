//! MTL text to materials. As with OBJ, `tobj` reads the numbers of lines that a scan has checked and written anew
//! (version 4.0.5 panics on a colour of fewer than three numbers, `Ks 0`, which Blender wrote for years, takes the
//! options of `map_Kd` for a part of the file name, and refuses a material without a name).

use std::fmt::Write;
use std::path::Path;

use super::text::{excerpt, logical_lines, number, split_keyword, words};
use crate::error::{Error, Result};

/// Diffuse colour of faces without a material, and of materials without `Kd` and texture.
pub(super) const DEFAULT_KD: [f32; 3] = [0.8; 3];
/// Specular exponent where `Ns` is missing or 0 (which exporters write for "none"): the broadest lobe that still fades.
pub(super) const DEFAULT_NS: f32 = 1.0;

/// A material as the file defines it.
#[derive(Debug)]
pub(super) struct Definition {
    pub name: String,
    /// The line of `newmtl`.
    pub line: usize,
    pub kd: [f32; 3],
    pub ks: [f32; 3],
    pub ns: f32,
    /// Line and file name of the last `map_Kd`.
    pub map_kd: Option<(usize, String)>,
}

/// Parses the text of an MTL file; `path` is for errors and warnings. Statements before the first `newmtl` are ignored.
pub(super) fn parse(text: &str, path: &Path) -> Result<Vec<Definition>> {
    let mut definitions: Vec<Definition> = Vec::new();
    let mut clean = String::new();
    let mut transparent = 0;
    for (line, content) in logical_lines(text) {
        let (keyword, rest) = split_keyword(&content);
        let keyword = keyword.to_ascii_lowercase();
        if keyword == "newmtl" {
            // `tobj` gets numbers for names: it cannot do with an empty one.
            let _ = writeln!(clean, "newmtl {}", definitions.len());
            definitions.push(Definition { name: rest.to_owned(), line, ..Definition::default() });
            continue;
        }
        let Some(current) = definitions.last_mut() else { continue };
        match keyword.as_str() {
            "kd" | "ks" => {
                if let Some([r, g, b]) = color(rest, || Error::input(path, line, excerpt(&content), COLOR))? {
                    let _ = writeln!(clean, "{} {r} {g} {b}", if keyword == "kd" { "Kd" } else { "Ks" });
                } else {
                    tracing::warn!(
                        "{}:{line}: spectral and xyz colours are not supported; ignored",
                        path.display()
                    );
                }
            }
            "ns" => {
                let exponent =
                    words(rest).next().and_then(|w| Some((w, number(w)?))).filter(|(_, v)| v.is_finite());
                let (word, _) =
                    exponent.ok_or_else(|| Error::input(path, line, excerpt(&content), "a finite number"))?;
                let _ = writeln!(clean, "Ns {word}");
            }
            "map_kd" => current.map_kd = texture_name(rest, line, path).map(|name| (line, name)),
            "d" => transparent += usize::from(words(rest).last().and_then(number).is_some_and(|d| d < 1.0)),
            "tr" => transparent += usize::from(words(rest).last().and_then(number).is_some_and(|t| t > 0.0)),
            _ => {}
        }
    }
    if transparent > 0 {
        tracing::warn!("{}: {transparent} statements ask for transparency; faces are opaque", path.display());
    }
    read_values(&clean, &mut definitions, path)?;
    Ok(definitions)
}

const COLOR: &str = "one number or three, finite and not negative";

impl Default for Definition {
    fn default() -> Self {
        Self { name: String::new(), line: 0, kd: DEFAULT_KD, ks: [0.0; 3], ns: DEFAULT_NS, map_kd: None }
    }
}

/// The words of a colour, `r` alone standing for all three; `None` for the forms that are not supported.
fn color(rest: &str, bad: impl Fn() -> Error) -> Result<Option<[&str; 3]>> {
    let found: Vec<&str> = words(rest).collect();
    let rgb = match found[..] {
        ["spectral" | "xyz", ..] => return Ok(None),
        [grey] => [grey; 3],
        [r, g, b, ..] => [r, g, b],
        _ => return Err(bad()),
    };
    let usable = |word: &&str| number(word).is_some_and(|v| v.is_finite() && v >= 0.0);
    if rgb.iter().all(usable) { Ok(Some(rgb)) } else { Err(bad()) }
}

/// Lets `tobj` read the checked lines and fills in what they leave open.
fn read_values(clean: &str, definitions: &mut [Definition], path: &Path) -> Result<()> {
    let refused = |found: String| Error::input(path, None, found, "materials that the MTL reader accepts");
    let (read, _) = tobj::load_mtl_buf(&mut clean.as_bytes()).map_err(|e| refused(e.to_string()))?;
    if read.len() != definitions.len() {
        return Err(refused(format!(
            "{} materials where the scan counted {}",
            read.len(),
            definitions.len()
        )));
    }
    for (definition, read) in definitions.iter_mut().zip(read) {
        // The colour multiplies the texture: where only the texture is given, it shows as it is.
        let open = if definition.map_kd.is_some() { [1.0; 3] } else { DEFAULT_KD };
        definition.kd = read.diffuse.unwrap_or(open);
        definition.ks = read.specular.unwrap_or([0.0; 3]);
        definition.ns = read.shininess.filter(|ns| *ns > 0.0).unwrap_or(DEFAULT_NS);
    }
    Ok(())
}

/// Options of texture statements: name, least and most number of words after it, and the words that change nothing.
const OPTIONS: &[(&str, usize, usize, &[&str])] = &[
    ("-blendu", 1, 1, &["on"]),
    ("-blendv", 1, 1, &["on"]),
    ("-bm", 1, 1, &["1"]),
    ("-boost", 1, 1, &["0"]),
    ("-cc", 1, 1, &["off"]),
    ("-clamp", 1, 1, &["off"]),
    ("-colorspace", 1, 1, &["srgb"]),
    ("-imfchan", 1, 1, &[]),
    ("-mm", 2, 2, &["0 1"]),
    ("-o", 1, 3, &["0", "0 0", "0 0 0"]),
    ("-s", 1, 3, &["1", "1 1", "1 1 1"]),
    ("-t", 1, 3, &["0", "0 0", "0 0 0"]),
    ("-texres", 1, 1, &[]),
    ("-type", 1, 1, &[]),
];

/// The file name in the operands of `map_Kd`: what follows the options, blanks inside included. Options that would
/// change the picture are warned of.
fn texture_name(rest: &str, line: usize, path: &Path) -> Option<String> {
    let mut rest = rest;
    let mut ignored = Vec::new();
    loop {
        let (word, after) = split_keyword(rest);
        let Some((name, least, most, neutral)) = OPTIONS.iter().find(|o| word.eq_ignore_ascii_case(o.0))
        else {
            break;
        };
        let (arguments, after) = option_arguments(after, *least, *most);
        if !neutral.contains(&arguments.to_ascii_lowercase().as_str()) {
            ignored.push(*name);
        }
        rest = after;
    }
    // Some exporters write options behind the name.
    let is_option = |word: &str| OPTIONS.iter().any(|o| word.eq_ignore_ascii_case(o.0));
    let behind = rest.match_indices(" -").find(|(at, _)| is_option(split_keyword(&rest[at + 1..]).0));
    if let Some((at, _)) = behind {
        ignored.push("those behind the file name");
        rest = rest[..at].trim_end();
    }
    if !ignored.is_empty() {
        let list = ignored.join(", ");
        tracing::warn!("{}:{line}: texture options are not supported; ignored: {list}", path.display());
    }
    let name = rest.strip_prefix('"').and_then(|r| r.strip_suffix('"')).unwrap_or(rest).trim();
    if name.is_empty() {
        tracing::warn!("{}:{line}: `map_Kd` without a file name; ignored", path.display());
    }
    (!name.is_empty()).then(|| name.to_owned())
}

/// Splits `least` words off, then numbers up to `most`, but never the last word: that is the file name.
fn option_arguments(rest: &str, least: usize, most: usize) -> (String, &str) {
    let mut arguments: Vec<&str> = Vec::new();
    let mut rest = rest;
    while arguments.len() < most {
        let (word, after) = split_keyword(rest);
        let taken = arguments.len() < least || (number(word).is_some() && !after.is_empty());
        if !taken || word.is_empty() {
            break;
        }
        arguments.push(word);
        rest = after;
    }
    (arguments.join(" "), rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Vec<Definition> {
        parse(text, Path::new("x.mtl")).unwrap()
    }

    #[test]
    fn values_and_defaults() {
        let text =
            "Kd 9 9 9\nnewmtl a b \n\tKd .5 1e-1 20\nKs 0\nNs 0\n newmtl\nNs 32\nnewmtl t\nmap_Kd x.png";
        let [first, second, third] = &parsed(text)[..] else { panic!() };
        assert_eq!((first.name.as_str(), first.line), ("a b", 2));
        assert_eq!((first.kd, first.ks, first.ns), ([0.5, 0.1, 20.0], [0.0; 3], DEFAULT_NS));
        assert_eq!((second.name.as_str(), second.kd, second.ns), ("", DEFAULT_KD, 32.0));
        assert_eq!((third.kd, third.map_kd.clone()), ([1.0; 3], Some((9, "x.png".to_owned()))));
    }

    #[test]
    fn texture_options_and_blanks() {
        for (operands, expected) in [
            ("x.png", "x.png"),
            ("texture  01.png", "texture  01.png"),
            ("-o 0.1 diffuse.jpg", "diffuse.jpg"),
            ("-s 1 2 3 -clamp on a b.png", "a b.png"),
            ("-mm 0 1 7", "7"),
            ("-o 1 2", "2"),
            ("-colorspace sRGB -o 0.1 .\\d.jpg", ".\\d.jpg"),
            ("-texres 512 input.jpg", "input.jpg"),
            ("\"a b.png\"", "a b.png"),
            ("x.png -bm 1.5", "x.png"),
            ("a -b.png", "a -b.png"),
        ] {
            assert_eq!(texture_name(operands, 1, Path::new("x")).as_deref(), Some(expected), "{operands}");
        }
        assert_eq!(texture_name("-clamp on", 1, Path::new("x")), None);
    }

    #[test]
    fn bad_values_name_their_line() {
        for bad in
            ["Kd 1 2", "Kd", "Kd nan 0 0", "Kd 1 2 inf", "Ks a b c", "Kd -1 0 0", "Ns x", "Ns nan", "Ns"]
        {
            let message = parse(&format!("newmtl a\n{bad}\n"), Path::new("x.mtl")).unwrap_err().to_string();
            assert!(message.starts_with(&format!("x.mtl:2: found `{bad}`")), "{message}");
        }
        assert!(parse("newmtl a\nKd spectral file.rfl 1\n", Path::new("x.mtl")).is_ok());
    }
}
