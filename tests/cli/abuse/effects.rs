//! Valid cameras that were refused, and sizes that were not thought of.

use super::*;

/// A1: a dark scene under automatic exposure.
#[test]
fn automatic_exposure_in_the_dark_stays_in_its_range() {
    if !device_is_there("automatic_exposure_in_the_dark_stays_in_its_range") {
        return;
    }
    let capture = Capture::new();
    capture.write("colours.mtl", "newmtl grey\nKd 0 0 0\nnewmtl red\nKd 0 0 0\n");
    for more in ["", "\n[exposure_gain]\ngain = 3.0\n"] {
        capture.write("camera.toml", format!("{CAMERA}\n[auto_exposure]\ntarget = 0.9\n{more}"));
        assert_done(&capture.simulate(&capture.beside("out"), &[]));
    }
}

/// P3: pictures of a few px, by every method and with an effect that works on the host.
#[test]
fn pictures_of_any_size_work() {
    if !device_is_there("pictures_of_any_size_work") {
        return;
    }
    let capture = Capture::new();
    for (width, height) in [(1, 1), (2, 1), (1, 3), (3, 1), (2, 2)] {
        let sized =
            CAMERA.replace("= 24\n", &format!("= {height}\n")).replace("= 32\n", &format!("= {width}\n"));
        let sized = sized.replace("16.0", "0.5").replace("12.0", "0.5");
        capture.write("camera.toml", format!("{sized}\n[jpeg]\nquality = 80\n"));
        for method in ["exact", "fast", "accumulation", "paper"] {
            let out = capture.beside(&format!("{width}x{height}-{method}"));
            let output = capture.simulate(&out, &["--method", method, "--planes", "color,depth"]);
            assert_eq!(output.status.code(), Some(0), "{width}x{height} {method}: {}", said(&output));
            let picture = shutterbug::plane::read_rgb8(&out.join("000003.png")).unwrap();
            assert_eq!((picture.width, picture.height), (width, height), "{method}");
        }
    }
}

/// P4: a diagnosis needs more than a few px.
#[test]
fn a_diagnosis_of_a_few_px_is_refused() {
    if !device_is_there("a_diagnosis_of_a_few_px_is_refused") {
        return;
    }
    let capture = Capture::new();
    for (width, height) in [(1, 1), (2, 2), (2, 24), (24, 2)] {
        let sized =
            CAMERA.replace("= 24\n", &format!("= {height}\n")).replace("= 32\n", &format!("= {width}\n"));
        capture.write("camera.toml", sized);
        fs::create_dir_all(capture.root().join("real")).unwrap();
        for i in 0..4 {
            image::RgbImage::from_pixel(width, height, image::Rgb([90, 80, 70]))
                .save(capture.root().join(format!("real/{i:06}.png")))
                .unwrap();
        }
        let mut diagnose = shutterbug();
        diagnose.arg("diagnose").arg(capture.root()).arg("--out").arg(capture.beside("out"));
        diagnose.args(["--time-limit-s", "18446744073709551615"]);
        assert_refused(
            &diagnose.output().unwrap(),
            1,
            &["camera.toml", &format!("{width}x{height} px"), "at least 16 px"],
        );
    }
}
