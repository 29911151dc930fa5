//! Every parser of what may come from strangers, as a function of bytes, with a whole file of its kind: for the test
//! that spoils files by a generator of numbers (`tests/cli/abuse/mutations.rs`) and for the fuzzer (`fuzz/parsers`).
#![allow(dead_code, clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};

use shutterbug::camera::Trajectory;
use shutterbug::capture::{CameraFile, parse_frames, parse_lights};
use shutterbug::plane::{decode_picture, read_exr};
use shutterbug::scene::load_obj;
use shutterbug_cli::formats::{Profiles, parse_camera, read_euroc, read_kitti, read_target, read_times};
use shutterbug_cli::import::{Recording, Request};
use shutterbug_diagnose::board::read_corners;
use shutterbug_diagnose::diagnose::{DiagnoseOptions, Pair, Report, example_of_a_journal, read_journal};
use shutterbug_diagnose::out::{Out, OutRules};

const CAMERA: &str =
    "width = 32\nheight = 24\nfx = 30.0\nfy = 30.0\ncx = 16.0\ncy = 12.0\nframe_period_s = 0.04\n";
const SCENE: &str = "mtllib colours.mtl\no wall\nv 3 -4 -4\nv 3 4 -4\nv 3 4 4\nv 3 -4 4\nvt 0 0\nvt 1 0\nvt 0 1\n\
                     vn 0 0 1\nusemtl grey\nf 1 2 3 4\nusemtl red\nf 1/1/1 2/2/1 3/3/1\ng more\nf -1 -2 -3\n";
const MATERIALS: &str = "newmtl grey\nKd 0.4 0.5 0.6\nd 0.5\nnewmtl red\nKd 0.6 0.1 0.1\n";

type Parse = dyn Fn(&[u8]) -> Result<(), String>;

/// A parser: its name, a file that it reads, and the function.
pub struct Parser {
    pub name: &'static str,
    pub whole: Vec<u8>,
    parse: Box<Parse>,
}

impl Parser {
    fn new(
        name: &'static str,
        whole: impl Into<Vec<u8>>,
        parse: impl Fn(&[u8]) -> Result<(), String> + 'static,
    ) -> Self {
        Self { name, whole: whole.into(), parse: Box::new(parse) }
    }

    /// Reads these bytes as if they were a file.
    ///
    /// # Errors
    /// What a user would be told.
    pub fn parse(&self, bytes: &[u8]) -> Result<(), String> {
        (self.parse)(bytes)
    }
}

fn told<T>(result: shutterbug::Result<T>) -> Result<(), String> {
    result.map(drop).map_err(|e| e.to_string())
}

fn text<T>(parse: impl Fn(&Path, &str) -> shutterbug::Result<T>) -> impl Fn(&[u8]) -> Result<(), String> {
    move |bytes| told(parse(Path::new("input"), &String::from_utf8_lossy(bytes)))
}

/// A reader of a file: it gets one of that name with the bytes.
fn file<T, R: Fn(&Path) -> shutterbug::Result<T>>(
    folder: &Path,
    name: &'static str,
    read: R,
) -> impl Fn(&[u8]) -> Result<(), String> + use<T, R> {
    let path = folder.join(name);
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    move |bytes| {
        fs::write(&path, bytes).unwrap();
        told(read(&path))
    }
}

fn encoded(format: image::ImageFormat) -> Vec<u8> {
    let picture =
        image::RgbImage::from_fn(24, 16, |x, y| image::Rgb([x as u8 * 9, y as u8 * 13, (x * y) as u8]));
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// All of them. `folder`: an empty one for their files; `data`: the recordings of `tests/data/import`.
pub fn parsers(folder: &Path, data: &Path) -> Vec<Parser> {
    let mut all = captures(folder);
    all.extend(cameras(folder));
    all.extend(pictures(folder));
    all.extend(results(folder));
    all.extend(pairs(folder));
    all.extend(recordings(folder, data));
    all
}

fn captures(folder: &Path) -> Vec<Parser> {
    let effects = format!(
        "{CAMERA}[rolling_shutter]\nreadout_time_s = 0.02\n[lens_distortion]\nk1 = -0.1\n[auto_exposure]\n\
         target = 0.3\n"
    );
    let lights = "[[light]]\nposition = [0, 0, 1]\ncolor = [1, 1, 1]\nattenuation = [1, 0, 0.5]\n";
    let frames = "10000000000,000000.png\n10040000000,000001.png\n";
    let poses = "10 0 0 0 0 0 0 1\n10.5 1 0 0 0 0 0 1\n11 2 0 0 0.5 -0.5 0.5 -0.5\n";
    let root = folder.join("capture");
    fs::create_dir_all(&root).unwrap();
    let scene = |changed: &'static str, other: &'static str, text: &'static str| {
        let root = root.clone();
        move |bytes: &[u8]| {
            fs::write(root.join(other), text).unwrap();
            fs::write(root.join(changed), bytes).unwrap();
            told(load_obj(&root.join("scene.obj"), &root))
        }
    };
    vec![
        Parser::new("camera.toml", effects, text(CameraFile::parse)),
        Parser::new("lights.toml", lights, text(parse_lights)),
        Parser::new("frames.csv", frames, text(parse_frames)),
        Parser::new("trajectory.tum", poses, text(|path, text| Trajectory::parse(path, text, 0))),
        Parser::new("scene.obj", SCENE, scene("scene.obj", "colours.mtl", MATERIALS)),
        Parser::new("colours.mtl", MATERIALS, scene("colours.mtl", "scene.obj", SCENE)),
    ]
}

fn cameras(folder: &Path) -> Vec<Parser> {
    let ros = "image_width: 64\nimage_height: 48\ncamera_matrix:\n  rows: 3\n  cols: 3\n  \
               data: [50.0, 0.0, 31.5, 0.0, 50.0, 23.5, 0.0, 0.0, 1.0]\ndistortion_model: plumb_bob\n\
               distortion_coefficients:\n  data: [0.1, 0, 0, 0, 0]\n";
    let kalibr = "cam0:\n  camera_model: pinhole\n  intrinsics: [50.0, 50.0, 31.5, 23.5]\n  \
                  distortion_model: equidistant\n  distortion_coeffs: [0.01, 0, 0, 0]\n  resolution: [64, 48]\n  \
                  T_cam_imu:\n  - [1, 0, 0, 0]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  - [0, 0, 0, 1]\n";
    let sensor = "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  \
                  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]\nrate_hz: 20\nresolution: [64, 48]\n\
                  camera_model: pinhole\nintrinsics: [50, 50, 31.5, 23.5]\ndistortion_model: radial-tangential\n\
                  distortion_coefficients: [0.1, 0, 0, 0]\n";
    let target = "target_type: checkerboard\ntargetCols: 7\ntargetRows: 5\nrowSpacingMeters: 0.03\n\
                  colSpacingMeters: 0.03\n";
    let states =
        "#timestamp,p,q\n1000000000,0,0,0,1,0,0,0\n1500000000,1,0,0,1,0,0,0\n2000000000,2,0,0,1,0,0,0\n";
    let euroc = folder.join("euroc");
    let images = euroc.join("mav0/cam0/data.csv");
    fs::create_dir_all(images.parent().unwrap()).unwrap();
    fs::write(&images, "#timestamp,name\n1100000000,1100000000.png\n1200000000,1200000000.png\n").unwrap();
    fs::write(euroc.join("mav0/cam0/sensor.yaml"), sensor).unwrap();
    let whole_motion = move |path: &Path| {
        read_euroc(path.ancestors().nth(3).expect("mav0/state_groundtruth_estimate0"), None)
    };
    let kitti = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1 0 1 0 0 0 0 1 0\n";
    let times = folder.join("times.txt");
    fs::write(&times, "0\n0.1\n").unwrap();
    let camera = || text(|path, text| parse_camera(path, text, None, None));
    let gyroflow = "{\"camera_brand\":\"A\",\"calib_dimension\":{\"w\":64,\"h\":48},\"fps\":25,\
                    \"frame_readout_time\":8.5,\"fisheye_params\":{\"camera_matrix\":[[50,0,31.5],[0,50,23.5],[0,0,1]],\
                    \"distortion_coeffs\":[0.01,0,0,0]},\"distortion_model\":\"opencv_fisheye\"}";
    let table = "brand,model,lens,setting,width_px,height_px,fps,readout_ms,distortion_model,\
                 fx_px,fy_px,cx_px,cy_px,d1,d2,d3,d4,rms_px,images\n\
                 A,\"B, C\",,,64,48,25,8.5,opencv_fisheye,50,50,32,24,0.01,0,0,0,0.5,20\n";
    let all = folder.join("profiles");
    fs::create_dir_all(&all).unwrap();
    // A line that is no profile is no error of the folder.
    let profiles = move |bytes: &[u8]| {
        fs::write(all.join("a.csv"), bytes).unwrap();
        let profiles = Profiles::read(&all).map_err(|e| e.to_string())?;
        profiles.names().filter_map(|name| profiles.preset(name)).try_for_each(told)?;
        profiles.refused.first().map_or(Ok(()), |e| Err(e.clone()))
    };
    vec![
        Parser::new("Gyroflow", gyroflow, camera()),
        Parser::new("profiles.csv", table, profiles),
        Parser::new("ROS", ros, camera()),
        Parser::new("Kalibr", kalibr, camera()),
        Parser::new("EuRoC", sensor, camera()),
        Parser::new("target.yaml", target, file(folder, "target.yaml", read_target)),
        Parser::new(
            "data.csv",
            states,
            file(&euroc, "mav0/state_groundtruth_estimate0/data.csv", whole_motion),
        ),
        Parser::new("KITTI", kitti, file(folder, "poses.txt", move |path| read_kitti(path, Some(&times)))),
        Parser::new("times.txt", "0\n0.1\n0.2\n", file(folder, "more/times.txt", read_times)),
        Parser::new(
            "corners.csv",
            "a.png,0,0,1.5,2.5\na.png,1,0,3.5,2.5\nb.png,0,1,1.5,4.5\n",
            file(folder, "corners.csv", read_corners),
        ),
    ]
}

fn pictures(folder: &Path) -> Vec<Parser> {
    let picture = |bytes: &[u8]| told(decode_picture(Path::new("input"), bytes));
    let exr = folder.join("whole.exr");
    shutterbug::plane::write_exr_atomic(&exr, 5, 4, &[("Z", &[1.5; 20]), ("A", &[0.5; 20])]).unwrap();
    vec![
        Parser::new("PNG", encoded(image::ImageFormat::Png), picture),
        Parser::new("JPEG", encoded(image::ImageFormat::Jpeg), picture),
        Parser::new("EXR", fs::read(&exr).unwrap(), file(folder, "a.exr", read_exr)),
    ]
}

/// What a run reads of earlier ones.
fn results(folder: &Path) -> Vec<Parser> {
    let root = folder.join("out");
    // Beside the folder: nothing that a manifest says may touch it.
    let mine = folder.join("mine.txt");
    fs::write(&mine, "mine").unwrap();
    let manifest = "{\"shutterbug\":\"0.1.0\",\"command\":\"simulate\",\"arguments\":[],\"made_from\":{\"a\":\"b\"}}\n\
                    {\"name\":\"000000.png\",\"bytes\":4,\"sha256\":\
                    \"aabc42e66bf1a6eb7f6a89cf6f3d37f0d0ad7d0a1eb6ae7bf1d2c2c4d6dd0b1a\"}\n\
                    {\"working\":\"progress.jsonl\"}\n\
                    {\"folder\":\"case-000\"}\n";
    let resume = move |bytes: &[u8]| {
        let _ = fs::remove_dir_all(&root);
        fs::create_dir_all(&root).unwrap();
        fs::write(root.join("manifest.jsonl"), bytes).unwrap();
        fs::write(root.join("000000.png"), "mine").unwrap();
        let done = ["goes on", "begins"].map(|how| {
            let rules =
                OutRules { command: "simulate", inputs: &[], overwrite: false, goes_on: how == "goes on" };
            let out = Out::open(&root, &rules)?;
            out.has("000000.png");
            if rules.goes_on { out.go_on() } else { out.start() }
        });
        assert_eq!(fs::read(&mine).unwrap(), b"mine", "a file beside the folder");
        done.into_iter().try_for_each(told)
    };
    let report = "{\"verdict\":\"no_gap\",\"gap\":{\"unit\":\"DN\"}}";
    vec![
        Parser::new("manifest.jsonl", manifest, resume),
        Parser::new("report.json", report, text(Report::from_json)),
        Parser::new(
            "progress.jsonl",
            example_of_a_journal("key"),
            file(folder, "progress.jsonl", |path| read_journal(path, "key")),
        ),
    ]
}

/// What says which frames of two folders go together.
fn pairs(folder: &Path) -> Vec<Parser> {
    let [sim, real] = ["sim", "real"].map(|name| folder.join("pairs").join(name));
    for (f, at) in [&sim, &real].into_iter().enumerate() {
        fs::create_dir_all(at).unwrap();
        for i in 0..6u32 {
            let value = |x: u32, y: u32| image::Rgb([(x * 9 + i) as u8, (y * 13) as u8, (x * y) as u8]);
            let name = format!("{}{i}.png", ["s", "r"][f]);
            image::RgbImage::from_fn(16, 16, value).save(at.join(name)).unwrap();
        }
    }
    let whole = "sim,real\ns0.png,r1.png\ns1.png,r2.png\ns2.png,r3.png\ns3.png,r4.png\n";
    let read = move |path: &Path| Pair::read(&sim, &real, Some(path), None, &DiagnoseOptions::default());
    vec![Parser::new("match.csv", whole, file(folder, "match.csv", read))]
}

fn recordings(folder: &Path, data: &Path) -> Vec<Parser> {
    let names = [
        "ros1_plain.bag",
        "ros1_bz2.bag",
        "ros1_lz4.bag",
        "ros2_lz4.mcap",
        "ros2_zstd.mcap",
        "foxglove_json.mcap",
        "ros2_plain.db3",
        "ros2_messages_zstd.db3",
    ];
    let read = |path: PathBuf| {
        move |bytes: &[u8]| {
            fs::write(&path, bytes).unwrap();
            let recording = Recording::open(&path).map_err(|e| e.to_string())?;
            let listed = recording.listing(&mut |_, _| Ok(())).map_err(|e| e.to_string())?;
            assert!(!listed.0.contains('\u{1b}'), "{}", listed.0);
            told(recording.prepare(&Request::default(), &mut |_, _| Ok(())))
        }
    };
    names.map(|name| Parser::new(name, fs::read(data.join(name)).unwrap(), read(folder.join(name)))).into()
}
