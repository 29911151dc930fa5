//! The C ABI in careless hands: each wrong argument gives its status, touches nothing, and leaves the handle as it was.
#![allow(clippy::type_complexity, unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ptr::{null, null_mut};

use crate::capi_support::*;
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

/// A test's engine with a camera of 32x24 px.
fn small_engine(test: &str) -> Option<Handle> {
    let engine = engine(test, options(2, 3))?;
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    Some(engine)
}

#[track_caller]
fn refused(engine: Handle, code: Status, name: &str, says: &str) {
    assert_eq!(code, status(name), "{}", error_of(engine));
    let text = error_of(engine);
    assert!(text.contains(says), "`{text}` does not say `{says}`");
}

#[test]
fn handles_that_are_null_made_up_destroyed_or_of_another_kind() {
    let test = "handles_that_are_null_made_up_destroyed_or_of_another_kind";
    let Some(engine) = small_engine(test) else { return };
    let mut small = Small::new(32, 24);
    let mut frame = null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, &small.outside, &mut frame) }, engine);
    let Some(gone) = self::engine(test, options(2, 0)) else { return };
    assert_eq!(shutterbug_engine_destroy(gone), OK);
    let on_the_stack = 7u64;
    let looks_alive = (engine as usize) + 2 * 1000;
    for wrong in [
        null_mut(),
        gone,
        frame,
        made_up(1 << 40 | 8),
        made_up(usize::MAX),
        made_up(looks_alive),
        (&raw const on_the_stack).cast_mut().cast(),
    ] {
        let mut out = made_up(99);
        let mut info: shutterbug_engine_info = sized();
        let c = camera(32, 24);
        let handle = status("HANDLE");
        unsafe {
            assert_eq!(shutterbug_engine_set_camera(wrong, &c), handle);
            assert_eq!(shutterbug_engine_get_info(wrong, &mut info), handle);
            assert_eq!(shutterbug_engine_submit_outside(wrong, &small.outside, &mut out), handle);
            assert_eq!(shutterbug_memory_export_fd(wrong, 64, &mut out, null_mut()), handle);
        }
        assert_eq!(out, made_up(99), "outputs are written on success only");
        if !wrong.is_null() {
            assert_eq!(shutterbug_engine_destroy(wrong), handle);
        }
    }
    for wrong in [null_mut(), engine, gone, made_up(3)] {
        let mut ready = 5;
        assert_eq!(unsafe { shutterbug_frame_poll(wrong, &mut ready) }, status("HANDLE"));
        assert_eq!((ready, shutterbug_frame_wait(wrong, -1.0)), (5, status("HANDLE")));
        assert_eq!(shutterbug_memory_destroy(engine), status("HANDLE"));
        assert_eq!(shutterbug_semaphore_destroy(frame), status("HANDLE"));
    }
    // Null is fine to destroy; a second destruction is found out.
    assert_eq!(shutterbug_engine_destroy(null_mut()), OK);
    assert_eq!(shutterbug_frame_destroy(null_mut()), OK);
    assert_eq!(shutterbug_frame_destroy(frame), OK);
    assert_eq!(shutterbug_frame_destroy(frame), status("HANDLE"));
    // Control: the engine is unharmed.
    small.outside.frame_index = 1;
    assert!(process(engine, &small.outside, [32, 24]).is_ok());
    finish(engine);
    assert_eq!(shutterbug_engine_destroy(engine), status("HANDLE"));
}

#[test]
fn sizes_strides_alignment_and_formats() {
    let test = "sizes_strides_alignment_and_formats";
    let Some(engine) = small_engine(test) else { return };
    let mut small = Small::new(32, 24);
    // struct_size: one less, one more, zero, huge.
    for wrong in [-1i64, 1, -(size_of::<shutterbug_outside>() as i64), 1 << 31] {
        let mut o = small.outside;
        o.struct_size = (i64::from(o.struct_size) + wrong) as u32;
        let mut frame = made_up(42);
        let code = unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) };
        refused(engine, code, "STRUCT_SIZE", "shutterbug_outside.struct_size");
        assert_eq!(frame, made_up(42));
        let mut c = camera(32, 24);
        c.struct_size = (i64::from(c.struct_size) + wrong) as u32;
        refused(
            engine,
            unsafe { shutterbug_engine_set_camera(engine, &c) },
            "STRUCT_SIZE",
            "shutterbug_camera",
        );
    }
    let color = unsafe { *small.outside.color };
    let given = |change: &dyn Fn(&mut shutterbug_image)| {
        let mut image = color;
        change(&mut image);
        let mut o = small.outside;
        o.color = &image;
        process(engine, &o, [32, 24]).map(drop)
    };
    let row = 32 * 16;
    let cases: [(&str, &str, &dyn Fn(&mut shutterbug_image)); 13] = [
        ("TOO_SMALL", "stride_bytes is 511, a row takes 512", &|i| i.stride_bytes = row - 1),
        ("TOO_SMALL", "capacity_bytes", &|i| i.capacity_bytes -= 1),
        ("TOO_SMALL", "capacity_bytes", &|i| i.stride_bytes = row + 4),
        ("ARGUMENT", "overflows", &|i| i.stride_bytes = u64::MAX - 3),
        ("ARGUMENT", "splits a value", &|i| {
            i.stride_bytes = row + 2;
            i.capacity_bytes *= 2;
        }),
        ("ARGUMENT", "pixels is null", &|i| i.pixels = null_mut()),
        ("ARGUMENT", "multiple of 4", &|i| i.pixels = unsafe { i.pixels.byte_add(1) }),
        ("ARGUMENT", "33x24 px; the camera with its margin is 32x24", &|i| {
            i.width = 33;
            i.stride_bytes = 33 * 16;
            i.capacity_bytes = 33 * 16 * 24;
        }),
        ("ARGUMENT", "no size", &|i| i.height = 0),
        ("FORMAT", "format 0", &|i| i.format = 0),
        ("FORMAT", "format 99", &|i| i.format = 99),
        ("FORMAT", "color is", &|i| i.format = PixelFormat::R32f as u32),
        ("HANDLE", "no such handle", &|i| i.memory = made_up(5)),
    ];
    for (name, says, change) in cases {
        let (code, text) = given(change).expect_err(says);
        assert_eq!(code, status(name), "{says}: {text}");
        assert!(text.contains(says), "`{text}` does not say `{says}`");
    }
    assert_eq!(given(&|_| ()), Ok(()), "control: unchanged, it is accepted");
    // Reading into too little room writes nothing.
    let mut frame = null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, &small.outside, &mut frame) }, engine);
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut bytes = vec![0x5a; 32 * 24 * 3];
    let mut to = image(PixelFormat::Rgb8, 32, 24, &mut bytes);
    to.capacity_bytes -= 1;
    assert_eq!(unsafe { shutterbug_frame_read(frame, 1, &to) }, status("TOO_SMALL"));
    to.capacity_bytes += 1;
    for plane in [0, 2, 5, u32::MAX] {
        assert_ne!(unsafe { shutterbug_frame_read(frame, plane, &to) }, OK, "plane {plane}");
    }
    to.width = 31;
    assert_eq!(unsafe { shutterbug_frame_read(frame, 1, &to) }, status("ARGUMENT"));
    assert!(bytes.iter().all(|b| *b == 0x5a), "nothing was written");
    must(shutterbug_frame_destroy(frame), frame);
    small.outside.frame_index = 2;
    finish(engine);
}

#[test]
fn numbers_that_are_none() {
    let test = "numbers_that_are_none";
    let Some(engine) = small_engine(test) else { return };
    let small = Small::new(32, 24);
    let submit = |change: &dyn Fn(&mut shutterbug_outside)| {
        let mut o = small.outside;
        change(&mut o);
        process(engine, &o, [32, 24]).map(drop)
    };
    let nan_times: [&dyn Fn(&mut shutterbug_outside); 6] = [
        &|o| o.time_s = f64::NAN,
        &|o| o.color_time_s = f64::INFINITY,
        &|o| o.motion_step_s = f64::NAN,
        &|o| o.motion_count = 7,
        &|o| o.flags = 1,
        &|o| o.motion_count = 0,
    ];
    for change in nan_times {
        assert_eq!(submit(change).unwrap_err().0, status("ARGUMENT"));
    }
    assert_eq!(submit(&|o| o.margin_x_px = 33).unwrap_err().0, status("LIMIT"));
    assert_eq!(
        submit(&|o| o.margin_x_px = 1).unwrap_err().0,
        status("ARGUMENT"),
        "pictures without the margin"
    );
    assert_eq!(submit(&|o| o.color = null()).unwrap_err().0, status("ARGUMENT"));
    assert_eq!(submit(&|o| o.motions = null()).unwrap_err().0, status("ARGUMENT"));
    assert_eq!(submit(&|o| o.motion_convention = null()).unwrap_err().0, status("ARGUMENT"));
    assert_eq!(submit(&|_| ()), Ok(()), "control");
    // NaN poses, quaternions that are none, times that do not increase.
    let pose = |time_s: f64| shutterbug_stamped_pose {
        time_s,
        world_from_camera: shutterbug_pose { translation_m: [0.0; 3], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] },
    };
    let set = |poses: &[shutterbug_stamped_pose]| unsafe {
        shutterbug_engine_set_trajectory(engine, poses.as_ptr(), poses.len())
    };
    let mut wrong = [pose(0.0), pose(1.0)];
    wrong[1].world_from_camera.translation_m[2] = f64::NAN;
    refused(engine, set(&wrong), "ARGUMENT", "pose 1");
    wrong = [pose(0.0), pose(f64::NAN)];
    refused(engine, set(&wrong), "ARGUMENT", "pose 1");
    wrong = [pose(0.0), pose(1.0)];
    wrong[0].world_from_camera.rotation_xyzw = [0.0; 4];
    refused(engine, set(&wrong), "ARGUMENT", "pose 0");
    refused(engine, set(&[pose(1.0), pose(1.0)]), "INPUT", "times that increase");
    assert_eq!(unsafe { shutterbug_engine_set_trajectory(engine, null(), 2) }, status("ARGUMENT"));
    assert_eq!(
        unsafe { shutterbug_engine_set_trajectory(engine, wrong.as_ptr(), usize::MAX) },
        status("ARGUMENT")
    );
    must(set(&[pose(0.0), pose(1.0)]), engine);
    let cameras: [(&str, &dyn Fn(&mut shutterbug_camera)); 6] = [
        ("ARGUMENT", &|c| c.fx_px = f64::NAN),
        ("ARGUMENT", &|c| c.scan_order = 4),
        ("INPUT", &|c| c.width = 0),
        ("INPUT", &|c| c.exposure_time_s = -1.0),
        ("INPUT", &|c| c.width = 1 << 30),
        ("ARGUMENT", &|c| c.reserved = 1),
    ];
    for (name, change) in cameras {
        let mut c = camera(32, 24);
        change(&mut c);
        assert_eq!(unsafe { shutterbug_engine_set_camera(engine, &c) }, status(name), "{}", error_of(engine));
    }
    let json = |more: &str| {
        let text = format!(
            "{{\"width\": 64, \"height\": 48, \"fx\": 50, \"fy\": 50, \"cx\": 32, \"cy\": 24{more}}}"
        );
        let text = std::ffi::CString::new(text).unwrap();
        unsafe { shutterbug_engine_set_camera_text(engine, text.as_ptr()) }
    };
    let tables = ",\n\"frame_period_s\": 0.04, \"jpeg\": {\"quality\": 10}, \"jpeg\": {\"quality\": 90}";
    refused(engine, json(tables), "INPUT", "camera JSON:2: found the key `jpeg` a second time");
    refused(
        engine,
        json(", \"frame_period_s\": 0.04, \"width\": 65"),
        "INPUT",
        "the key `width` a second time",
    );
    must(json(", \"frame_period_s\": 0.04, \"jpeg\": {\"quality\": 10}"), engine);
    finish(engine);
}

#[test]
fn calls_in_the_wrong_order() {
    let test = "calls_in_the_wrong_order";
    let Some(engine) = engine(test, options(2, 1)) else { return };
    let (small, mut request) = (Small::new(32, 24), sized::<shutterbug_request>());
    let mut frame = null_mut();
    let submit = |request: &shutterbug_request, frame: &mut Handle| unsafe {
        shutterbug_engine_submit(engine, request, frame)
    };
    assert_eq!(process(engine, &small.outside, [32, 24]).unwrap_err().0, status("STATE"));
    refused(engine, submit(&request, &mut frame), "STATE", "camera");
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    refused(engine, submit(&request, &mut frame), "STATE", "trajectory");
    let capture = text("demo/capture");
    must(unsafe { shutterbug_engine_load_capture(engine, capture.as_ptr()) }, engine);
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    request.flags = 1;
    refused(engine, submit(&request, &mut frame), "STATE", "SHUTTERBUG_ENGINE_PLANES");
    (request.flags, request.time_s) = (0, 1e6);
    refused(engine, submit(&request, &mut frame), "TIME", "trajectory");
    request.time_s = 10.05;
    must(submit(&request, &mut frame), engine);
    let mut info: shutterbug_frame_info = sized();
    assert_eq!(unsafe { shutterbug_frame_get_info(frame, &mut info) }, status("NOT_READY"));
    refused(engine, unsafe { shutterbug_engine_set_camera(engine, &camera(30, 24)) }, "STATE", "in flight");
    // Only what is drawn from pixels changes: allowed at any time.
    let mut c = camera(32, 24);
    c.exposure_time_s = 0.001;
    must(unsafe { shutterbug_engine_set_camera(engine, &c) }, engine);
    // The engine goes first: the frame answers, and can be destroyed.
    finish(engine);
    assert_eq!(shutterbug_frame_wait(frame, -1.0), status("HANDLE"));
    assert_eq!(unsafe { shutterbug_frame_get_info(frame, &mut info) }, status("HANDLE"));
    assert_eq!(shutterbug_frame_destroy(frame), OK);
    // A missing folder names itself.
    let Some(engine) = self::engine(test, options(2, 0)) else { return };
    let nowhere = text("/nowhere/at all");
    refused(
        engine,
        unsafe { shutterbug_engine_load_capture(engine, nowhere.as_ptr()) },
        "INPUT",
        "/nowhere/at all",
    );
    refused(engine, unsafe { shutterbug_engine_load_scene(engine, null()) }, "ARGUMENT", "null");
    let no_utf8 = [0xc3u8, 0x28, 0];
    let code = unsafe { shutterbug_engine_load_scene(engine, no_utf8.as_ptr().cast()) };
    refused(engine, code, "ARGUMENT", "UTF-8");
    finish(engine);
}

#[test]
fn effects_that_act_where_a_scene_is_rendered_are_no_ones_of_frames_from_outside() {
    let test = "effects_that_act_where_a_scene_is_rendered_are_no_ones_of_frames_from_outside";
    let Some(engine) = engine(test, options(0, 1)) else { return };
    let small = Small::new(32, 24);
    let camera = "width = 32\nheight = 24\nfx = 16\nfy = 16\ncx = 16\ncy = 12\nframe_period_s = 0.04\n";
    let with = |effect: &str| {
        let code =
            unsafe { shutterbug_engine_set_camera_text(engine, text(&format!("{camera}{effect}")).as_ptr()) };
        if code == OK {
            process(engine, &small.outside, [32, 24]).map(drop)
        } else {
            Err((code, error_of(engine)))
        }
    };
    for effect in [
        "[lens_distortion]\nk1 = 0.05",
        "[chromatic_aberration]\nscale_r = 1.01",
        "[focal_length_error]\nratio = 1.1",
        "[pose_offset]\nrotvec_rad = [0.0, 0.0, 0.02]",
    ] {
        let name = effect[1..].split(']').next().unwrap();
        let (code, says) = with(effect).expect_err(effect);
        assert_eq!(code, status("UNSUPPORTED"), "{says}");
        assert!(says.contains(name), "`{says}` does not say `{name}`");
    }
    // A lens that folds inside the picture is refused when it is set, and the camera stays as it was.
    let (code, says) = with("[lens_distortion]\nk1 = -1.0").unwrap_err();
    assert_eq!(code, status("INPUT"), "{says}");
    assert_eq!(with("[vignetting]\na1 = -0.1"), Ok(()), "control: effects on pixels");
    assert_eq!(with("[time_offset]\noffset_s = 0.01"), Ok(()), "control: a shutter that starts late");
    assert_eq!(with(""), Ok(()), "control");
    finish(engine);
}

#[test]
fn options_that_cannot_be_are_refused_with_a_sentence() {
    let cases: [(&str, &str, &dyn Fn(&mut shutterbug_engine_options)); 11] = [
        ("ARGUMENT", "samples is 3", &|o| o.samples = 3),
        ("ARGUMENT", "frames_in_flight is 9", &|o| o.frames_in_flight = 9),
        ("ARGUMENT", "flags", &|o| o.flags = 1 << 20),
        ("ARGUMENT", "time_limit_s is NaN", &|o| o.time_limit_s = f64::NAN),
        ("ARGUMENT", "motion_images is 7", &|o| o.motion_images = 7),
        ("ARGUMENT", "motion_images is 3, not 2, 4 or 6", &|o| (o.method, o.motion_images) = (4, 3)),
        ("ARGUMENT", "time_limit_s is 1e300, not 0 to 1e9", &|o| o.time_limit_s = 1e300),
        ("UNSUPPORTED", "no method 77", &|o| o.method = 77),
        ("NO_DEVICE", "no such device", &|o| o.device = c"no such device".as_ptr()),
        ("ARGUMENT", "not UTF-8", &|o| o.device = c"\xff".as_ptr()),
        ("STRUCT_SIZE", "", &|o| o.struct_size += 8),
    ];
    for (name, says, change) in cases {
        let mut o = options(2, 0);
        let mut text = vec![0; 300];
        (o.error_text, o.error_capacity) = (text.as_mut_ptr(), text.len() as u64);
        change(&mut o);
        let mut engine = made_up(11);
        let code = unsafe { shutterbug_engine_create(&o, &mut engine) };
        let text = unsafe { std::ffi::CStr::from_ptr(text.as_ptr()) }.to_string_lossy();
        if name == "NO_DEVICE" && text.contains("Install") {
            continue; // No loader at all: said instead.
        }
        assert_eq!((code, engine), (status(name), made_up(11)), "{text}");
        assert!(text.contains(says), "`{text}` does not say `{says}`");
    }
    assert_eq!(unsafe { shutterbug_engine_create(null(), null_mut()) }, status("ARGUMENT"));
    let (mut o, mut said) = (options(2, 0), vec![0; 300]);
    (o.error_text, o.error_capacity) = (said.as_mut_ptr(), said.len() as u64);
    assert_eq!(unsafe { shutterbug_engine_create(&o, null_mut()) }, status("ARGUMENT"));
    assert!(unsafe { std::ffi::CStr::from_ptr(said.as_ptr()) }.to_string_lossy().contains("engine is null"));
    let mut engine = null_mut();
    assert_eq!(unsafe { shutterbug_engine_create(null(), &mut engine) }, status("ARGUMENT"));
}

#[test]
fn two_threads_at_once_on_one_handle_are_an_error_code_and_two_engines_are_none() {
    let test = "two_threads_at_once_on_one_handle_are_an_error_code_and_two_engines_are_none";
    let Some(engine) = small_engine(test) else { return };
    let (busy, other) = (std::sync::atomic::AtomicU32::new(0), std::sync::atomic::AtomicU32::new(0));
    let handle = engine as usize;
    let limit = std::time::Instant::now() + std::time::Duration::from_secs(20);
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| {
                let small = Small::new(32, 24);
                while busy.load(std::sync::atomic::Ordering::Relaxed) < 20
                    && std::time::Instant::now() < limit
                {
                    match process(handle as Handle, &small.outside, [32, 24]) {
                        Err((code, _)) if code == status("BUSY") => {
                            busy.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        }
                        // Frames of the others are in flight, or their wait had the engine.
                        Err((code, _)) if code == status("FULL") => {}
                        Err((code, text)) => panic!("{code}: {text}"),
                        Ok(_) => {
                            other.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
                        }
                    }
                }
            });
        }
    });
    assert!(busy.into_inner() >= 20, "the threads never met, in {} frames", other.into_inner());
    // The lost frames of the loop above were destroyed or are still in flight: the engine answers.
    let mut info: shutterbug_engine_info = sized();
    must(unsafe { shutterbug_engine_get_info(engine, &mut info) }, engine);
    assert_eq!(shutterbug_engine_destroy(engine), OK);
    // Two engines, two threads: no call is refused.
    std::thread::scope(|scope| {
        for _ in 0..2 {
            scope.spawn(|| {
                let engine = create(options(2, 0)).unwrap();
                must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
                let small = Small::new(32, 24);
                let first = process(engine, &small.outside, [32, 24]).unwrap();
                for _ in 0..20 {
                    assert!(process(engine, &small.outside, [32, 24]).unwrap() == first);
                }
                must(shutterbug_engine_destroy(engine), engine);
            });
        }
    });
}

#[test]
fn calls_without_a_handle_put_their_sentence_where_the_caller_says() {
    let mut convention: shutterbug_motion_convention = sized();
    let mut motion = [[1.0f32, 2.0]; 12];
    let good = image(PixelFormat::Rg32f, 4, 3, bytemuck::cast_slice_mut(&mut motion));
    let to = good;
    let mut said = [0x55 as std::ffi::c_char; 80];
    let heard = |said: &[std::ffi::c_char]| {
        unsafe { std::ffi::CStr::from_ptr(said.as_ptr()) }.to_string_lossy().into_owned()
    };
    let code = unsafe { shutterbug_motion_preset(6, &mut convention, said.as_mut_ptr(), said.len() as u64) };
    assert_eq!((code, heard(&said).as_str()), (status("ARGUMENT"), "there is no preset 6; they are 0 to 5"));
    convention.struct_size -= 1;
    let code = unsafe { shutterbug_motion_preset(0, &mut convention, said.as_mut_ptr(), said.len() as u64) };
    assert_eq!(code, status("STRUCT_SIZE"));
    assert!(heard(&said).starts_with("shutterbug_motion_convention.struct_size is 39"), "{}", heard(&said));
    convention.struct_size += 1;
    must(unsafe { shutterbug_motion_preset(3, &mut convention, null_mut(), 0) }, null_mut());
    let mut convert = |change: &dyn Fn(&mut shutterbug_image, &mut f64), room: usize| {
        let (mut from, mut interval_s) = (good, 0.04);
        change(&mut from, &mut interval_s);
        said.fill(0x55);
        let code = unsafe {
            shutterbug_motion_convert(&from, &convention, interval_s, &to, said.as_mut_ptr(), room as u64)
        };
        assert!(said[room..].iter().all(|c| *c == 0x55), "beyond its capacity");
        (code, if room > 0 && said[0] != 0x55 { heard(&said) } else { String::new() })
    };
    type Change = &'static dyn Fn(&mut shutterbug_image, &mut f64);
    let cases: [(&str, &str, Change); 5] = [
        ("TOO_SMALL", "from: stride_bytes is 31", &|i, _| i.stride_bytes = 31),
        ("ARGUMENT", "frame_interval_s is NaN", &|_, s| *s = f64::NAN),
        ("FORMAT", "from is RG16F or RG32F", &|i, _| {
            (i.format, i.stride_bytes, i.capacity_bytes) = (2, 16, 48);
        }),
        ("LIMIT", "not below 2^32", &|i, _| (i.height, i.stride_bytes) = (1, 1 << 32)),
        ("ARGUMENT", "from: pixels is null", &|i, _| i.pixels = null_mut()),
    ];
    for (name, says, change) in cases {
        let (code, text) = convert(change, 80);
        assert_eq!(code, status(name), "{text}");
        assert!(text.contains(says), "`{text}` does not say `{says}`");
        assert_eq!(convert(change, 8), (code, text[..7].to_owned()), "cut");
        assert_eq!(convert(change, 0), (code, String::new()), "no room");
    }
    assert_eq!(convert(&|_, _| (), 80), (OK, String::new()), "control: nothing is written on success");
}

/// Three frames in two places, waited for in another order than they were submitted in.
fn out_of_order(engine: Handle, submit: &dyn Fn(u32, &mut Handle) -> Status) {
    let frame = |index: u32| {
        let mut frame = null_mut();
        (submit(index, &mut frame), frame)
    };
    let picture = |frame: Handle| {
        must(shutterbug_frame_wait(frame, -1.0), frame);
        let mut rgb = vec![0; 32 * 24 * 3];
        let to = image(PixelFormat::Rgb8, 32, 24, &mut rgb);
        must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
        must(shutterbug_frame_destroy(frame), null_mut());
        rgb
    };
    let alone: Vec<_> = (0..3).map(|i| picture(frame(i).1)).collect();
    assert!(alone[0] != alone[1] && alone[1] != alone[2], "control: three pictures");
    let (first, second) = (frame(0).1, frame(1).1);
    assert_eq!(frame(2).0, status("FULL"), "{}", error_of(engine));
    assert!(picture(second) == alone[1]);
    let (code, third) = frame(2);
    must(code, engine);
    assert_eq!(frame(2).0, status("FULL"), "control: the first is still on its way");
    assert!(picture(third) == alone[2] && picture(first) == alone[0]);
}

#[test]
fn frames_may_be_waited_for_in_any_order() {
    let test = "frames_may_be_waited_for_in_any_order";
    let mut o = options(2, 0);
    o.frames_in_flight = 2;
    let Some(engine) = engine(test, o) else { return };
    must(unsafe { shutterbug_engine_load_capture(engine, text("demo/capture").as_ptr()) }, engine);
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    let small = Small::new(32, 24);
    out_of_order(engine, &|index, frame| {
        let mut o = small.outside;
        o.color_time_s = 0.004 * f64::from(index);
        unsafe { shutterbug_engine_submit_outside(engine, &o, frame) }
    });
    out_of_order(engine, &|index, frame| {
        let mut request: shutterbug_request = sized();
        request.time_s = 10.05 + 0.1 * f64::from(index);
        unsafe { shutterbug_engine_submit(engine, &request, frame) }
    });
    finish(engine);
}
