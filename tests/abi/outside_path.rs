//! Frames from outside with depth and poses over all of the frame: what the engine's own `fast` would have made,
//! programs built against the header of before, and careless hands.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ptr::{null, null_mut};

use crate::capi_support::{
    Floats, Small, SmallPath, camera, engine, error_of, finish, must, options, process, sized, status, text,
};
use crate::gpu_support::frames::{INTERVAL_S, request};
use crate::gpu_support::scenes::{rich, walk};
use shutterbug::camera::{Intrinsics, NEAR_M, Pose, ScanOrder};
use shutterbug::capi::*;
use shutterbug::engine::{FastOptions, Method};

const K: Intrinsics = Intrinsics { width: 96, height: 64, fx: 70.0, fy: 72.0, cx: 47.0, cy: 33.0 };
const SIZE: [usize; 2] = [K.width as usize, K.height as usize];

fn stamped(time_s: f64, pose: &Pose) -> shutterbug_stamped_pose {
    let (translation_m, rotation_xyzw) = (pose.translation_m.to_array(), pose.rotation.to_array());
    shutterbug_stamped_pose { time_s, world_from_camera: shutterbug_pose { translation_m, rotation_xyzw } }
}

/// What makes a right call a wrong one.
type Spoil<'a> = &'a dyn Fn(&mut shutterbug_outside);

#[test]
fn the_engines_own_colour_depth_and_poses_give_the_picture_of_fast_bit_for_bit() {
    let test = "the_engines_own_colour_depth_and_poses_give_the_picture_of_fast_bit_for_bit";
    let Some(watched) = crate::gpu_support::device(test) else { return };
    let mut scene = rich(0);
    // All of it rests: paths follow from depth then.
    scene.objects.iter_mut().for_each(|object| object.trajectory = None);
    for (exposure_s, order) in [(0.0, ScanOrder::TopToBottom), (0.012, ScanOrder::RightToLeft)] {
        let asked = request(&K, exposure_s, 0.025, order);
        let options = crate::gpu_support::frames::options(Method::Fast(FastOptions::default()), 1);
        let expected = std::slice::from_ref(&asked);
        let mut own = crate::gpu_support::frames::engine(&watched, &scene, &walk(), K, options, expected);
        let want = own.render(&asked).unwrap().picture.data;
        let inputs = own.warp_inputs(&asked).unwrap().expect("paths from depth");
        let engine = engine(test, crate::capi_support::options(4, 1)).unwrap();
        let mut c = camera(K.width, K.height);
        (c.fx_px, c.fy_px, c.cx_px, c.cy_px) = (K.fx, K.fy, K.cx, K.cy);
        (c.exposure_time_s, c.readout_time_s, c.scan_order) = (exposure_s, 0.025, order as u32);
        c.frame_period_s = INTERVAL_S;
        must(unsafe { shutterbug_engine_set_camera(engine, &c) }, engine);
        let mut times_s = inputs.knots_s.clone();
        times_s.push(inputs.color_time_s);
        times_s.sort_by(f64::total_cmp);
        times_s.dedup();
        let path = walk();
        let poses: Vec<_> = times_s.iter().map(|&t| stamped(t, &path.pose_at(t))).collect();
        let (mut color, mut depth) = (Floats::of(&inputs.color), Floats::of(&inputs.inverse_depth));
        let (color, depth) = (color.image(), depth.image());
        let mut convention: shutterbug_depth_convention = sized();
        (convention.kind, convention.near_m) = (1, NEAR_M);
        let mut o = crate::capi_support::outside();
        (o.frame_index, o.time_s, o.color_time_s) = (asked.index, asked.shutter.start_s, inputs.color_time_s);
        [o.margin_x_px, o.margin_y_px] = inputs.margin_px;
        (o.color, o.depth, o.depth_convention) = (&color, &depth, &convention);
        (o.poses, o.pose_count, o.flags) = (poses.as_ptr(), poses.len() as u32, 1);
        let got = process(engine, &o, SIZE).unwrap();
        let differ = got.iter().zip(&want).filter(|(a, b)| a != b).count();
        assert_eq!(differ, 0, "exposure {exposure_s}, {order}: bytes that differ, of {}", want.len());
        // Controls: the colour of another instant; a camera at rest.
        let other = shutterbug_outside { color_time_s: o.color_time_s + 1e-3, ..o };
        assert!(process(engine, &other, SIZE).unwrap() != want, "control: another instant");
        let rests = path.pose_at(inputs.color_time_s);
        let still: Vec<_> = times_s.iter().map(|&t| stamped(t, &rests)).collect();
        let other = shutterbug_outside { poses: still.as_ptr(), ..o };
        assert!(process(engine, &other, SIZE).unwrap() != want, "control: a camera at rest");
        finish(engine);
    }
}

/// Sizes of `shutterbug_outside` before frames brought poses over all of the frame, and before they brought several
/// pictures.
const SIZE_OF_BEFORE: u32 = std::mem::offset_of!(shutterbug_outside, pose_count) as u32;
const SIZE_OF_ONE_PICTURE: u32 = std::mem::offset_of!(shutterbug_outside, picture_count) as u32;

#[test]
fn programs_built_against_the_header_of_before_are_served() {
    let test = "programs_built_against_the_header_of_before_are_served";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    let small = Small::new(32, 24);
    let want = process(engine, &small.outside, [32, 24]).unwrap();
    // What lies behind the struct of before is not the library's to read: nonsense there changes nothing.
    let mut old = small.outside;
    (old.struct_size, old.pose_count, old.body_count) = (SIZE_OF_BEFORE, 77, 99);
    (old.nearest_m, old.ids, old.bodies) = (f64::NAN, std::ptr::dangling(), std::ptr::dangling());
    assert_eq!(process(engine, &old, [32, 24]).unwrap(), want);
    old.struct_size = size_of::<shutterbug_outside>() as u32;
    assert_eq!(
        process(engine, &old, [32, 24]).unwrap_err().0,
        status("ARGUMENT"),
        "control: read where it is said"
    );
    let own = SmallPath::new(32, 24);
    let mut path = own.outside;
    let want = process(engine, &path, [32, 24]).unwrap();
    (path.struct_size, path.picture_count, path.pictures) = (SIZE_OF_ONE_PICTURE, 5, std::ptr::dangling());
    assert_eq!(process(engine, &path, [32, 24]).unwrap(), want);
    for wrong in [SIZE_OF_BEFORE - 8, SIZE_OF_BEFORE + 8, SIZE_OF_ONE_PICTURE + 4] {
        old.struct_size = wrong;
        assert_eq!(process(engine, &old, [32, 24]).unwrap_err().0, status("STRUCT_SIZE"));
    }
    finish(engine);
}

#[test]
fn careless_hands() {
    let Some(engine) = engine("careless_hands", options(0, 1)) else { return };
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    let small = SmallPath::new(32, 24);
    let submit = |change: &dyn Fn(&mut shutterbug_outside)| {
        let mut o = small.outside;
        change(&mut o);
        process(engine, &o, [32, 24]).map(drop)
    };
    let turned = [small.poses[0], small.poses[0]];
    let mut wrong_pose = *small.poses;
    wrong_pose[1].world_from_camera.rotation_xyzw = [f64::NAN; 4];
    let twice = [small.bodies[0]; 2];
    let one_pose = [shutterbug_body { pose_count: 1, ..small.bodies[0] }];
    let no_poses = [shutterbug_body { poses: null(), ..small.bodies[0] }];
    let late = [small.poses[1], shutterbug_stamped_pose { time_s: 9.0, ..small.poses[1] }];
    let late_body = [shutterbug_body { poses: late.as_ptr(), ..small.bodies[0] }];
    let (color, depth) = (small.outside.color, small.outside.depth);
    let good = shutterbug_picture { time_s: 0.02, color, depth, ids: small.outside.ids };
    let further = |p: shutterbug_picture| [p];
    let same_time = further(shutterbug_picture { time_s: small.outside.color_time_s, ..good });
    let no_time = further(shutterbug_picture { time_s: f64::NAN, ..good });
    let late_picture = further(shutterbug_picture { time_s: 7.0, ..good });
    let no_color = further(shutterbug_picture { color: null(), ..good });
    let no_ids = further(shutterbug_picture { ids: null(), ..good });
    let depth_for_color = further(shutterbug_picture { color: depth, ..good });
    let cases: [(&str, &str, Spoil<'_>); 28] = [
        ("ARGUMENT", "picture_count is 8", &|o| o.picture_count = 8),
        ("ARGUMENT", "pictures is null", &|o| o.picture_count = 1),
        ("ARGUMENT", "reserved", &|o| o.reserved_more = 1),
        ("ARGUMENT", "two pictures", &|o| (o.pictures, o.picture_count) = (same_time.as_ptr(), 1)),
        ("ARGUMENT", "pictures[0].time_s", &|o| (o.pictures, o.picture_count) = (no_time.as_ptr(), 1)),
        ("TIME", "colour", &|o| (o.pictures, o.picture_count) = (late_picture.as_ptr(), 1)),
        ("ARGUMENT", "pictures[0].color is null", &|o| {
            (o.pictures, o.picture_count) = (no_color.as_ptr(), 1);
        }),
        ("ARGUMENT", "pictures[0].ids is null", &|o| (o.pictures, o.picture_count) = (no_ids.as_ptr(), 1)),
        ("FORMAT", "pictures[0].color is RGB8", &|o| {
            (o.pictures, o.picture_count) = (depth_for_color.as_ptr(), 1);
        }),
        ("ARGUMENT", "pose_count is 1", &|o| o.pose_count = 1),
        ("ARGUMENT", "poses", &|o| o.poses = null()),
        ("ARGUMENT", "pose 1", &|o| o.poses = wrong_pose.as_ptr()),
        ("INPUT", "increase", &|o| o.poses = turned.as_ptr()),
        ("TIME", "never extrapolated", &|o| o.poses = late.as_ptr()),
        ("TIME", "frame 0", &|o| o.time_s = 3.0),
        ("TIME", "colour", &|o| o.color_time_s = -1.0),
        ("ARGUMENT", "nearest_m", &|o| o.nearest_m = f64::NAN),
        ("ARGUMENT", "nearest_m", &|o| o.nearest_m = -1.0),
        ("ARGUMENT", "flags", &|o| o.flags = 16),
        ("ARGUMENT", "not with motion", &|o| (o.motion_count, o.depth) = (1, null())),
        ("ARGUMENT", "without", &|o| o.pose_count = 0),
        ("ARGUMENT", "256", &|o| o.body_count = 256),
        ("ARGUMENT", "bodies is null", &|o| o.bodies = null()),
        ("ARGUMENT", "null", &|o| o.ids = null()),
        ("FORMAT", "R8U", &|o| o.ids = o.depth),
        ("ARGUMENT", "the id 5", &|o| (o.bodies, o.body_count) = (twice.as_ptr(), 2)),
        ("ARGUMENT", "body 5: pose_count is 1", &|o| o.bodies = one_pose.as_ptr()),
        ("ARGUMENT", "poses", &|o| o.bodies = no_poses.as_ptr()),
    ];
    for (name, says, change) in cases {
        let (code, said) = submit(change).expect_err(says);
        assert!(code == status(name) && said.contains(says), "{code}: `{said}` for {name}, `{says}`");
    }
    let (code, said) = submit(&|o| o.bodies = late_body.as_ptr()).unwrap_err();
    assert!(code == status("TIME") && said.contains("body 5"), "{said}");
    assert_eq!(submit(&|_| ()), Ok(()), "control");
    let good = further(good);
    let two = submit(&|o| (o.pictures, o.picture_count) = (good.as_ptr(), 1));
    assert_eq!(two, Ok(()), "control: two pictures");
    finish(engine);
}

#[test]
fn a_method_makes_its_own_frames_or_says_why_not() {
    let test = "a_method_makes_its_own_frames_or_says_why_not";
    let (path, motion) = (SmallPath::new(32, 24), Small::new(32, 24));
    for (method, takes) in
        [(0, [true, true]), (1, [false; 2]), (2, [false, true]), (3, [false; 2]), (4, [true, false])]
    {
        let Some(engine) = engine(test, options(method, 0)) else { return };
        must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
        for (outside, taken) in [path.outside, motion.outside].iter().zip(takes) {
            let got = process(engine, outside, [32, 24]);
            assert_eq!(got.is_ok(), taken, "method {method}");
            if let Err((code, said)) = got {
                assert!(code == status("UNSUPPORTED") && said.contains("options.method"), "{said}");
            }
        }
        finish(engine);
    }
}

#[test]
fn margins_that_cannot_be_asked_for() {
    let Some(engine) = engine("margins_that_cannot_be_asked_for", options(4, 1)) else { return };
    let bound: shutterbug_motion_bound = sized();
    let ask = |bound: &shutterbug_motion_bound, x: *mut u32| {
        let mut y = 7;
        let code = unsafe { shutterbug_engine_margin(engine, bound, x, &mut y) };
        assert!(code == 0 || y == 7, "outputs are written on success only");
        code
    };
    let mut x = 7;
    assert_eq!(ask(&bound, &mut x), status("STATE"), "no camera: {}", error_of(engine));
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    let changes: [&dyn Fn(&mut shutterbug_motion_bound); 6] = [
        &|b| b.turn_rate_rad_s = f64::NAN,
        &|b| b.speed_m_s = -1.0,
        &|b| b.speed_m_s = 1.0,
        &|b| b.nearest_m = f64::INFINITY,
        &|b| b.color_delay_s = f64::NAN,
        &|b| b.reserved = 1,
    ];
    for change in changes {
        let mut wrong = bound;
        change(&mut wrong);
        assert_eq!(ask(&wrong, &mut x), status("ARGUMENT"), "{}", error_of(engine));
    }
    assert_eq!(ask(&bound, null_mut()), status("ARGUMENT"));
    assert_eq!(unsafe { shutterbug_engine_margin(engine, null(), &mut x, &mut x) }, status("ARGUMENT"));
    assert_eq!(unsafe { shutterbug_engine_margin(null_mut(), &bound, &mut x, &mut x) }, status("HANDLE"));
    assert_eq!(x, 7);
    must(ask(&bound, &mut x), engine);
    assert_eq!(x, 0, "nothing moves, nothing is bent");
    let folds = text("width = 32\nheight = 24\nfx = 16\nfy = 16\ncx = 16\ncy = 12\nframe_period_s = 0.04\n");
    must(unsafe { shutterbug_engine_set_camera_text(engine, folds.as_ptr()) }, engine);
    let fast = shutterbug_motion_bound {
        turn_rate_rad_s: 3.0,
        speed_m_s: 1.0,
        nearest_m: 0.5,
        color_delay_s: 0.02,
        ..bound
    };
    must(ask(&fast, &mut x), engine);
    assert!(x > 0, "control: {x}");
    finish(engine);
}
