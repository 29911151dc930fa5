//! Whatever a file holds, no parser panics, and an error names the file.

use std::path::Path;

use proptest::prelude::*;
use shutterbug::camera::Trajectory;
use shutterbug::capture::{CameraFile, parse_frames, parse_lights};

use super::{CAMERA, FRAMES, Fixture, LIGHTS, TRAJECTORY};

/// Text that was valid before one piece of it was replaced by another.
fn mutated(text: &'static str) -> impl Strategy<Value = String> {
    let piece = prop_oneof![
        "[ -~\\n]{0,6}",
        Just("\n".to_owned()),
        Just("nan".to_owned()),
        Just("-1e400".to_owned()),
        Just("99999999999999999999".to_owned()),
        Just("\u{0}\u{feff}".to_owned()),
        any::<String>(),
    ];
    (any::<prop::sample::Index>(), 0usize..12, piece).prop_map(move |(at, length, piece)| {
        let start = at.index(text.len());
        let end = (start + length).min(text.len());
        format!("{}{piece}{}", &text[..start], &text[end..])
    })
}

/// No panic; an error is one that names the file and fits on a line.
fn judge<T>(result: shutterbug::Result<T>) -> Result<(), TestCaseError> {
    if let Err(error) = result {
        let text = error.to_string();
        prop_assert!(text.starts_with("the/file") && !text.contains('\n'), "{}", text);
    }
    Ok(())
}

fn parse_all(text: &str) -> Result<(), TestCaseError> {
    let path = Path::new("the/file");
    judge(CameraFile::parse(path, text))?;
    judge(parse_lights(path, text))?;
    judge(parse_frames(path, text))?;
    judge(Trajectory::parse(path, text, 1_700_000_000_000_000_000))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn random_text_never_panics(text: String) {
        parse_all(&text)?;
    }

    #[test]
    fn random_bytes_in_a_file_never_panic(bytes: Vec<u8>, which in 0usize..4) {
        let fixture = Fixture::new();
        fixture.write(["camera.toml", "lights.toml", "frames.csv", "trajectory.tum"][which], bytes);
        let _ = fixture.read();
    }

    #[test]
    fn mutated_text_never_panics(
        text in prop_oneof![mutated(CAMERA), mutated(LIGHTS), mutated(FRAMES), mutated(TRAJECTORY)]
    ) {
        parse_all(&text)?;
    }

    #[test]
    fn whatever_camera_is_read_is_written_and_read_the_same(text in mutated(CAMERA)) {
        if let Ok(camera) = CameraFile::parse(Path::new("the/file"), &text) {
            let back = CameraFile::parse(Path::new("the/file"), &camera.to_toml()).expect("its own text");
            prop_assert_eq!(back.intrinsics, camera.intrinsics);
            prop_assert_eq!(back.frame_period_s, camera.frame_period_s);
            prop_assert_eq!(&back.settings, &camera.settings);
            prop_assert_eq!(back.to_toml(), camera.to_toml());
        }
    }
}
