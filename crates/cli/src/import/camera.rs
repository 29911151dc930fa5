//! A message's camera as `camera.toml`, by way of the reader of ROS files.

use std::path::Path;

use super::contents::CameraInfo;
use crate::formats::{CameraModel, Format, parse_camera};
use shutterbug::error::Result;

/// The camera of pictures as they are delivered: behind region and binning; of rectified ones without a lens. `label`
/// is what errors name. With it, what was left out.
pub(super) fn camera_of(
    info: &CameraInfo,
    rectified: bool,
    label: &Path,
) -> Result<(CameraModel, Vec<String>)> {
    let bin = info.binning.map(|b| b.max(1));
    let [x, y, roi_width, roi_height] = info.roi;
    let [width, height] =
        [(roi_width, info.width), (roi_height, info.height)].map(|(r, w)| if r > 0 { r } else { w });
    let mut k = info.k;
    let (mut d, mut model) = (info.d.clone(), info.model.clone());
    let mut notes = Vec::new();
    if rectified {
        let p = &info.p;
        k = [p[0], p[1], p[2], p[4], p[5], p[6], p[8], p[9], p[10]];
        (d, model) = (vec![0.0; 5], "plumb_bob".to_owned());
        notes.push("pictures are rectified: the pinhole is that of P, without a lens".to_owned());
    }
    // Pixel centres are at whole numbers there: the first binned pixel's is half way between those of its first and
    // last.
    let cut = |c: f64, from: u32, by: u32| (c - f64::from(from) + 0.5) / f64::from(by) - 0.5;
    let plain = bin == [1, 1] && [x, y] == [0, 0];
    if !plain {
        k = [
            k[0] / f64::from(bin[0]),
            k[1],
            cut(k[2], x, bin[0]),
            k[3],
            k[4] / f64::from(bin[1]),
            cut(k[5], y, bin[1]),
            k[6],
            k[7],
            k[8],
        ];
        notes.push(format!(
            "the pinhole is that of the part at ({x}, {y}), binned by {} and {}",
            bin[0], bin[1]
        ));
    }
    let yaml = serde_json::json!({
        "width": width / bin[0], "height": height / bin[1], "distortion_model": model, "d": d, "k": k,
    });
    let imported = parse_camera(label, &yaml.to_string(), Some(Format::Ros), None)?;
    notes.extend(imported.notes);
    Ok((imported.camera, notes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info() -> CameraInfo {
        let k = [500.0, 0.0, 319.5, 0.0, 510.0, 239.5, 0.0, 0.0, 1.0];
        let p = [400.0, 0.0, 300.0, 0.0, 0.0, 400.0, 200.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let model = "plumb_bob".to_owned();
        CameraInfo {
            width: 640,
            height: 480,
            model,
            d: vec![-0.1, 0.01, 0.0, 0.0, 0.0],
            k,
            p,
            ..CameraInfo::default()
        }
    }

    #[test]
    fn region_and_binning_move_the_pinhole() {
        let label = Path::new("bag: /camera_info");
        let (plain, _) = camera_of(&info(), false, label).expect("a camera");
        assert_eq!((plain.intrinsics.cx, plain.intrinsics.fy, plain.intrinsics.width), (320.0, 510.0, 640));
        assert!(!plain.distortion.is_identity());
        let half = CameraInfo { binning: [2, 2], roi: [40, 20, 320, 240], ..info() };
        let (half, notes) = camera_of(&half, false, label).expect("a camera");
        let k = half.intrinsics;
        assert_eq!((k.width, k.height, k.fx, k.cx, k.cy), (160, 120, 250.0, 140.0, 110.0), "{notes:?}");
        let (flat, _) = camera_of(&info(), true, label).expect("a camera");
        assert_eq!((flat.intrinsics.fx, flat.intrinsics.cx), (400.0, 300.5));
        assert!(flat.distortion.is_identity());
        let none = CameraInfo { k: [0.0; 9], ..info() };
        let refused = camera_of(&none, false, label).expect_err("not calibrated").to_string();
        assert!(refused.contains("bag: /camera_info") && refused.contains("not calibrated"), "{refused}");
    }
}
