//! Gazebo: a camera `<sensor>` of SDF 1.9, to paste under a `<link>`. Written by hand: a dozen tags with numbers need
//! no XML library, only the escaping of one name.
//!
//! gz-sensors (`CameraSensor::BuildProjectionMatrix`) counts cx and cy from the upper left corner of the picture, whose
//! edges are 0 and width: as here, without a half pixel. Gazebo Classic takes cy from the lower edge
//! (gazebosim/gazebo-classic issue 2587).

use std::fmt::Write as _;

use super::CameraModel;
use super::common::lens_left_out;
use shutterbug::camera::{Distortion, NEAR_M};
use shutterbug::plane::srgb_slope;

/// Far clip plane, m. Gazebo needs one, this program has none; its own default is 100.
const FAR_M: f64 = 1000.0;
/// Linear radiance at which the slope of the sRGB curve turns linear noise into displayed noise: a mid grey.
const MID_GREY: f64 = 0.2;

/// What the format cannot hold; `sigma`: of the noise.
fn notes(camera: &CameraModel, sigma: f64) -> Vec<String> {
    const TARGET: &str = "SDF";
    let mut notes = camera.left_out(TARGET, &["read_noise", "paper_noise"]);
    if sigma > 0.0 {
        notes.push(format!(
            "noise of {sigma} of full scale (linear) is written as {:.6} of the displayed value, its size at a mid \
             grey: Gazebo adds noise after the tone curve",
            sigma * srgb_slope(MID_GREY)
        ));
    }
    notes.extend(paper_noise_parts(camera));
    if !matches!(camera.distortion, Distortion::None | Distortion::BrownConrady { .. }) {
        notes.push(lens_left_out(camera, TARGET));
    }
    if camera.rate_hz.is_none() {
        notes.push("the frame rate is not known: Gazebo then renders as often as it can".to_owned());
    }
    if camera.body_from_camera.is_some() {
        notes.push("the camera's place on its body is left out: Gazebo's <pose> looks along +x".to_owned());
    }
    notes.push(
        "cy counts from the upper edge, as new Gazebo does; Gazebo Classic counts from the lower".to_owned(),
    );
    notes
}

/// Writes the sensor; with it, what it cannot hold.
pub(super) fn export(camera: &CameraModel) -> (String, Vec<String>) {
    let k = &camera.intrinsics;
    let sigma = linear_noise_sigma(camera);
    let notes = notes(camera, sigma);
    let mut text = String::new();
    // A double hyphen would end the comment.
    text.extend(
        notes.iter().map(|note| format!("<!-- {} -->\n", note.replace("--", "- -").replace('\n', " "))),
    );
    let fov_rad = 2.0 * (0.5 * f64::from(k.width) / k.fx).atan();
    let mut add = |line: String| writeln!(text, "{line}").expect("writing to a String cannot fail");
    add(format!("<sensor name=\"{}\" type=\"camera\">", escaped(&camera.name)));
    if let Some(rate) = camera.rate_hz {
        add(format!("  <update_rate>{rate:?}</update_rate>"));
    }
    add(format!("  <camera>\n    <horizontal_fov>{fov_rad:?}</horizontal_fov>"));
    add(format!(
        "    <image>\n      <width>{}</width>\n      <height>{}</height>\n      <format>R8G8B8</format>\n    </image>",
        k.width, k.height
    ));
    add(format!("    <clip>\n      <near>{NEAR_M:?}</near>\n      <far>{FAR_M:?}</far>\n    </clip>"));
    if sigma > 0.0 {
        let stddev = sigma * srgb_slope(MID_GREY);
        add(format!(
            "    <noise>\n      <type>gaussian</type>\n      <mean>0.0</mean>\n      <stddev>{stddev:?}</stddev>\n    \
             </noise>"
        ));
    }
    if let Distortion::BrownConrady { k: [k1, k2, k3], p: [p1, p2] } = camera.distortion {
        let centre = [k.cx / f64::from(k.width), k.cy / f64::from(k.height)];
        add(format!(
            "    <distortion>\n      <k1>{k1:?}</k1>\n      <k2>{k2:?}</k2>\n      <k3>{k3:?}</k3>\n      \
             <p1>{p1:?}</p1>\n      <p2>{p2:?}</p2>\n      <center>{:?} {:?}</center>\n    </distortion>",
            centre[0], centre[1]
        ));
    }
    add(format!(
        "    <lens>\n      <intrinsics>\n        <fx>{:?}</fx>\n        <fy>{:?}</fy>\n        <cx>{:?}</cx>\n        \
         <cy>{:?}</cy>\n        <s>0.0</s>\n      </intrinsics>\n    </lens>\n  </camera>\n</sensor>",
        k.fx, k.fy, k.cx, k.cy
    ));
    (text, notes)
}

/// Standard deviation of the white noise that does not depend on the picture, of full scale, linear.
fn linear_noise_sigma(camera: &CameraModel) -> f64 {
    let of = |effect, name| camera.settings.number(effect, name, 0.0);
    let white = ["color_variance_r", "color_variance_g", "color_variance_b"].map(|n| of("paper_noise", n));
    let read = of("read_noise", "sigma");
    (read * read + white.iter().sum::<f64>() / 3.0).sqrt()
}

/// The parts of the paper's noise that Gaussian noise is not.
fn paper_noise_parts(camera: &CameraModel) -> Option<String> {
    let on = |part: &str| {
        let any = |c: &str| camera.settings.number("paper_noise", &format!("{part}_variance_{c}"), 0.0) > 0.0;
        ["r", "g", "b"].iter().any(|c| any(c)).then(|| part.to_owned())
    };
    let parts: Vec<String> = ["static", "edge"].iter().filter_map(|p| on(p)).collect();
    (!parts.is_empty()).then(|| {
        format!(
            "paper_noise ({} parts; differences between channels) has no place in SDF",
            parts.join(" and ")
        )
    })
}

fn escaped(text: &str) -> String {
    let escape = |c: char| match c {
        '&' => "&amp;".to_owned(),
        '<' => "&lt;".to_owned(),
        '>' => "&gt;".to_owned(),
        '"' => "&quot;".to_owned(),
        // XML 1.0 has no place for other control characters.
        c if c.is_control() => "_".to_owned(),
        c => c.to_string(),
    };
    text.chars().map(escape).collect()
}
