//! Cameras as hosts give them: the struct, or the text of CAPTURE.md as TOML or JSON. All go through the one parser, so
//! the same ranges hold and the same sentences come back.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::Value;

use super::status::{Fault, Outcome};
use super::types::shutterbug_camera;
use crate::camera::ScanOrder;
use crate::capture::{CameraFile, parse_json};

/// Flag of the struct: the camera rests during each frame.
pub const CAMERA_STATIC: u32 = 1;

/// The camera of a struct. Only shutter and exposure are modelled then.
pub fn from_struct(c: &shutterbug_camera) -> Outcome<CameraFile> {
    if c.flags & !CAMERA_STATIC != 0 || c.reserved != 0 {
        return Err(Fault::argument("shutterbug_camera: unknown flags, or reserved is not 0"));
    }
    let numbers = [
        ("fx_px", c.fx_px),
        ("fy_px", c.fy_px),
        ("cx_px", c.cx_px),
        ("cy_px", c.cy_px),
        ("frame_period_s", c.frame_period_s),
        ("readout_time_s", c.readout_time_s),
        ("exposure_time_s", c.exposure_time_s),
    ];
    if let Some((name, value)) = numbers.iter().find(|(_, v)| !v.is_finite()) {
        return Err(Fault::argument(format!("shutterbug_camera.{name} is {value}")));
    }
    let Some(order) = ScanOrder::ALL.get(c.scan_order as usize) else {
        return Err(Fault::argument(format!("shutterbug_camera.scan_order is {}, not 0 to 3", c.scan_order)));
    };
    let text = format!(
        "width = {}\nheight = {}\nfx = {:?}\nfy = {:?}\ncx = {:?}\ncy = {:?}\nframe_period_s = {:?}\nstatic = {}\n\
         [rolling_shutter]\nreadout_time_s = {:?}\nscan_order = \"{}\"\n[motion_blur]\nexposure_time_s = {:?}\n",
        c.width,
        c.height,
        c.fx_px,
        c.fy_px,
        c.cx_px,
        c.cy_px,
        c.frame_period_s,
        c.flags & CAMERA_STATIC != 0,
        c.readout_time_s,
        order.name(),
        c.exposure_time_s
    );
    Ok(CameraFile::parse(Path::new("shutterbug_camera"), &text)?)
}

/// The camera of a text: JSON if its first character is `{`, else TOML.
pub fn from_text(text: &str) -> Outcome<CameraFile> {
    if !text.trim_start_matches('\u{feff}').trim_start().starts_with('{') {
        return Ok(CameraFile::parse(Path::new("camera text"), text)?);
    }
    let path = Path::new("camera JSON");
    let value: Value = parse_json(text.as_bytes()).map_err(|e| {
        crate::error::Error::input(path, e.line, e.found, "JSON with the keys of camera.toml, each once")
    })?;
    Ok(CameraFile::parse(path, &toml_of(&value)?)?)
}

/// The same keys as TOML. Lines in errors are then those of this text: keys first, then one table after the other.
fn toml_of(value: &Value) -> Outcome<String> {
    let table = value.as_object().ok_or_else(|| Fault::argument("camera JSON is no object"))?;
    let mut text = String::new();
    for (key, value) in table.iter().filter(|(_, v)| !v.is_object()) {
        write_pair(&mut text, key, value)?;
    }
    for (key, table) in table.iter().filter_map(|(k, v)| v.as_object().map(|t| (k, t))) {
        writeln!(text, "[{}]", quoted(key)).expect("writing to a String cannot fail");
        for (key, value) in table {
            write_pair(&mut text, key, value)?;
        }
    }
    Ok(text)
}

fn write_pair(text: &mut String, key: &str, value: &Value) -> Outcome<()> {
    writeln!(text, "{} = {}", quoted(key), value_of(key, value)?).expect("writing to a String cannot fail");
    Ok(())
}

fn value_of(key: &str, value: &Value) -> Outcome<String> {
    Ok(match value {
        Value::Bool(b) => b.to_string(),
        Value::Number(n) => n.to_string(),
        Value::String(s) => quoted(s),
        Value::Array(values) => {
            let values: Outcome<Vec<_>> = values.iter().map(|v| value_of(key, v)).collect();
            format!("[{}]", values?.join(", "))
        }
        Value::Null | Value::Object(_) => {
            return Err(Fault::argument(format!("camera JSON: `{key}` takes no null and no object here")));
        }
    })
}

/// A JSON string is a basic TOML string but for DEL and the escaped solidus, which this writer never makes.
fn quoted(text: &str) -> String {
    Value::String(text.to_owned()).to_string().replace('\u{7f}', "\\u007f")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOML: &str = "width = 320\nheight = 240\nfx = 280.5\nfy = 280\ncx = 160\ncy = 120\nframe_period_s = 1e-1\n\
                        static = true\n[rolling_shutter]\nreadout_time_s = 0.03\nscan_order = \"left_to_right\"\n\
                        [motion_blur]\nexposure_time_s = 0.01\n";
    const JSON: &str = r#" {"width": 320, "rolling_shutter": {"readout_time_s": 0.03, "scan_order": "left_to_right"},
        "height": 240, "fx": 280.5, "fy": 280, "cx": 160, "cy": 120, "frame_period_s": 1e-1, "static": true,
        "motion_blur": {"exposure_time_s": 0.01}}"#;

    #[test]
    fn struct_toml_and_json_say_the_same() {
        let given = shutterbug_camera {
            struct_size: size_of::<shutterbug_camera>() as u32,
            width: 320,
            height: 240,
            scan_order: 2,
            fx_px: 280.5,
            fy_px: 280.0,
            cx_px: 160.0,
            cy_px: 120.0,
            frame_period_s: 0.1,
            readout_time_s: 0.03,
            exposure_time_s: 0.01,
            flags: CAMERA_STATIC,
            reserved: 0,
        };
        let text = |c: Outcome<CameraFile>| c.expect("a camera").to_toml();
        assert_eq!(text(from_struct(&given)), text(from_text(TOML)));
        assert_eq!(text(from_text(JSON)), text(from_text(TOML)));
        // Control: another value gives another text.
        assert_ne!(text(from_struct(&shutterbug_camera { scan_order: 1, ..given })), text(from_text(TOML)));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let fault = |text: &str| from_text(text).expect_err("refused").text;
        assert!(fault(&JSON.replace("height", "hight")).contains("did you mean `height`"), "a typing error");
        assert!(fault("{\"width\": ").contains("camera JSON:1"), "{}", fault("{\"width\": "));
        let twice = fault(&JSON.replace("\"cy\"", "\"cx\""));
        assert!(
            twice.starts_with("camera JSON:2") && twice.contains("the key `cx` a second time"),
            "{twice}"
        );
        assert!(
            fault(&JSON.replace("motion_blur", "rolling_shutter")).contains("`rolling_shutter` a second")
        );
        assert!(fault(&JSON.replace("true", "null")).contains("`static`"));
        assert!(fault(&TOML.replace("0.03", "nan")).contains("readout_time_s"));
    }
}
