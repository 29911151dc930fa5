//! GPU images as input and output of frames, and semaphores around them: those of a host's own device, and images
//! shared by file descriptor. The picture is that of the same pixels in host memory, bit for bit.
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

mod given;

use std::ptr::null_mut;
use std::time::{Duration, Instant};

use crate::capi_host::{Host, HostImage, ImageSpec};
use crate::capi_support::*;
use ash::vk::{self, Handle as _};
use given::{Given, bytes_of};
use shutterbug::capi::*;
use shutterbug::plane::PixelFormat;

const SIZE: [usize; 2] = [32, 24];
const PIXELS: usize = 32 * 24;
const TIMELINE: u32 = 1;

/// An engine on the host's device, with a camera.
fn engine_of(host: &Host) -> Handle {
    let mut names = Vec::new();
    let described = host.describe(&mut names);
    let mut o = options(2, 0);
    o.host = &described;
    let engine = create(o).unwrap();
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    engine
}

/// A host, if there is a device.
fn host(test: &str) -> Option<Host> {
    let host = Host::new(&[ash::khr::external_memory::NAME, ash::khr::external_memory_fd::NAME]);
    if host.is_none() {
        assert!(std::env::var_os("SHUTTERBUG_REQUIRE_DEVICE").is_none(), "{test}: a device is required");
        eprintln!("SKIPPED {test}: no device");
    }
    host
}

fn describe(image: &HostImage<'_>) -> shutterbug_gpu_image {
    let mut d: shutterbug_gpu_image = sized();
    (d.vk_format, d.vk_layout) = (image.spec.format.as_raw() as u32, image.spec.layout.as_raw() as u32);
    [d.width, d.height] = image.spec.size;
    d.vk_image = image.image.as_raw();
    d
}

fn use_image(engine: Handle, image: &HostImage<'_>) -> Handle {
    let mut memory = null_mut();
    must(unsafe { shutterbug_memory_use_image(engine, &describe(image), &mut memory) }, engine);
    memory
}

/// A picture of the library's that is a GPU image.
fn picture(memory: Handle) -> shutterbug_image {
    let mut i: shutterbug_image = sized();
    (i.width, i.height, i.memory) = (SIZE[0] as u32, SIZE[1] as u32, memory);
    i
}

fn input(format: vk::Format) -> ImageSpec {
    let usage = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
    ImageSpec { size: [32, 24], format, usage, layout: vk::ImageLayout::TRANSFER_SRC_OPTIMAL }
}

const COLORS: [(vk::Format, PixelFormat); 6] = [
    (vk::Format::R8G8B8A8_UNORM, PixelFormat::Rgba8),
    (vk::Format::R8G8B8A8_SRGB, PixelFormat::Rgba8),
    (vk::Format::B8G8R8A8_UNORM, PixelFormat::Bgra8),
    (vk::Format::B8G8R8A8_SRGB, PixelFormat::Bgra8),
    (vk::Format::R16G16B16A16_SFLOAT, PixelFormat::Rgba16f),
    (vk::Format::R32G32B32A32_SFLOAT, PixelFormat::Rgba32f),
];

#[test]
fn every_format_of_colour_and_motion_reads_as_host_memory_does() {
    let Some(host) = host("every_format_of_colour_and_motion_reads_as_host_memory_does") else { return };
    let engine = engine_of(&host);
    let small = Small::new(32, 24);
    for (vk_format, format) in COLORS {
        let mut given = Given::new(format);
        let color = given.image();
        let mut o = small.outside;
        o.color = &color;
        let want = process(engine, &o, SIZE).unwrap();
        let on_gpu = host.image(input(vk_format), &bytes_of(format), false);
        let memory = use_image(engine, &on_gpu);
        let color = picture(memory);
        o.color = &color;
        assert!(process(engine, &o, SIZE).unwrap() == want, "{vk_format:?}: another picture");
        assert!(process(engine, &o, SIZE).unwrap() == want, "{vk_format:?}: another picture the second time");
        // It is left as it was found.
        assert!(
            on_gpu.read(on_gpu.spec.layout, PIXELS * format.bytes()) == bytes_of(format),
            "{vk_format:?}"
        );
        must(shutterbug_memory_destroy(memory), null_mut());
        // Control: another image, another picture.
        let dark = host.image(input(vk_format), &vec![0; PIXELS * format.bytes()], false);
        let memory = use_image(engine, &dark);
        let color = picture(memory);
        o.color = &color;
        assert!(process(engine, &o, SIZE).unwrap() != want, "control: {vk_format:?}");
        must(shutterbug_memory_destroy(memory), null_mut());
    }
    for (vk_format, format) in
        [(vk::Format::R16G16_SFLOAT, PixelFormat::Rg16f), (vk::Format::R32G32_SFLOAT, PixelFormat::Rg32f)]
    {
        let mut given = Given::new(format);
        let motion = given.image();
        let mut o = small.outside;
        o.motions = &motion;
        let want = process(engine, &o, SIZE).unwrap();
        let on_gpu = host.image(input(vk_format), &bytes_of(format), false);
        let memory = use_image(engine, &on_gpu);
        let motion = picture(memory);
        o.motions = &motion;
        assert!(process(engine, &o, SIZE).unwrap() == want, "{vk_format:?}: another picture");
        assert!(process(engine, &small.outside, SIZE).unwrap() != want, "control: {vk_format:?}");
        must(shutterbug_memory_destroy(memory), null_mut());
    }
    finish(engine);
    host.finish();
}

#[test]
fn depth_images_read_as_host_memory_does() {
    let Some(host) = host("depth_images_read_as_host_memory_does") else { return };
    let engine = engine_of(&host);
    let small = Small::new(32, 24);
    let pose = |x| shutterbug_pose { translation_m: [x, 0.0, 0.0], rotation_xyzw: [0.0, 0.0, 0.0, 1.0] };
    let poses = [(0.0, 0.0), (0.04, 0.2)]
        .map(|(time_s, x)| shutterbug_stamped_pose { time_s, world_from_camera: pose(x) });
    let convention: shutterbug_depth_convention = sized();
    let mut given = Given::new(PixelFormat::R32f);
    let depth = given.image();
    let mut o = small.outside;
    (o.motion_count, o.depth, o.depth_convention, o.poses) = (0, &depth, &convention, poses.as_ptr());
    let want = process(engine, &o, SIZE).unwrap();
    for vk_format in [vk::Format::R32_SFLOAT, vk::Format::D32_SFLOAT] {
        let mut spec = input(vk_format);
        spec.layout = vk::ImageLayout::GENERAL;
        let on_gpu = host.image(spec, &bytes_of(PixelFormat::R32f), false);
        let memory = use_image(engine, &on_gpu);
        let depth = picture(memory);
        o.depth = &depth;
        assert!(process(engine, &o, SIZE).unwrap() == want, "{vk_format:?}: another picture");
        must(shutterbug_memory_destroy(memory), null_mut());
    }
    // Control: everything far away does not move.
    let mut far = vec![100f32; PIXELS];
    let depth = image(PixelFormat::R32f, SIZE[0], SIZE[1], bytemuck::cast_slice_mut(&mut far));
    o.depth = &depth;
    assert!(process(engine, &o, SIZE).unwrap() != want, "control");
    finish(engine);
    host.finish();
}

fn rgba(rgb: &[u8]) -> Vec<u8> {
    rgb.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect()
}

/// An image that takes pictures, full of something else.
fn output(host: &Host) -> HostImage<'_> {
    let mut spec = input(vk::Format::R8G8B8A8_UNORM);
    spec.layout = vk::ImageLayout::GENERAL;
    host.image(spec, &vec![7; PIXELS * 4], false)
}

fn timeline(host: &Host) -> vk::Semaphore {
    let mut kind = vk::SemaphoreTypeCreateInfo::default().semaphore_type(vk::SemaphoreType::TIMELINE);
    let info = vk::SemaphoreCreateInfo::default().push_next(&mut kind);
    unsafe { host.device.create_semaphore(&info, None) }.unwrap()
}

fn use_semaphore(engine: Handle, semaphore: vk::Semaphore, kind: u32) -> Handle {
    let mut handle = null_mut();
    must(unsafe { shutterbug_semaphore_use(engine, semaphore.as_raw(), kind, &mut handle) }, engine);
    handle
}

/// Waits until the host's timeline has a value.
fn reached(host: &Host, semaphore: vk::Semaphore, value: u64, limit: Duration) -> bool {
    let (semaphores, values) = ([semaphore], [value]);
    let info = vk::SemaphoreWaitInfo::default().semaphores(&semaphores).values(&values);
    unsafe { host.device.wait_semaphores(&info, limit.as_nanos() as u64) }.is_ok()
}

/// The frame does nothing before its wait's value, and the signal comes behind all its work.
fn between_timelines(
    host: &Host,
    engine: Handle,
    submit: &dyn Fn(Handle, Handle, Handle) -> Handle,
    want: &[u8],
) {
    let (before, after) = (timeline(host), timeline(host));
    let (wait, signal) = (use_semaphore(engine, before, TIMELINE), use_semaphore(engine, after, TIMELINE));
    let on_gpu = output(host);
    let memory = use_image(engine, &on_gpu);
    let frame = submit(wait, signal, memory);
    let start = Instant::now();
    while start.elapsed() < Duration::from_millis(200) {
        let mut ready = 7;
        must(unsafe { shutterbug_frame_poll(frame, &mut ready) }, frame);
        assert_eq!(ready, 0, "it waits for the host");
    }
    assert_eq!(shutterbug_frame_wait(frame, 0.05), status("TIMEOUT"));
    assert!(!reached(host, after, 1, Duration::ZERO), "control: nothing is signalled yet");
    let info = vk::SemaphoreSignalInfo::default().semaphore(before).value(5);
    unsafe { host.device.signal_semaphore(&info) }.unwrap();
    // The host never asks the library: the semaphore tells.
    assert!(reached(host, after, 9, Duration::from_secs(30)), "the frame signals");
    assert!(
        on_gpu.read(vk::ImageLayout::GENERAL, PIXELS * 4) == rgba(want),
        "the picture in the host's image"
    );
    must(shutterbug_frame_wait(frame, -1.0), frame);
    let mut rgb = vec![0; PIXELS * 3];
    let to = image(PixelFormat::Rgb8, SIZE[0], SIZE[1], &mut rgb);
    must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
    assert!(rgb == want);
    must(shutterbug_frame_destroy(frame), null_mut());
    for handle in [wait, signal] {
        must(shutterbug_semaphore_destroy(handle), null_mut());
    }
    must(shutterbug_memory_destroy(memory), null_mut());
    for semaphore in [before, after] {
        unsafe { host.device.destroy_semaphore(semaphore, None) };
    }
}

#[test]
fn frames_wait_for_the_hosts_timeline_and_signal_it() {
    let Some(host) = host("frames_wait_for_the_hosts_timeline_and_signal_it") else { return };
    let engine = engine_of(&host);
    let small = Small::new(32, 24);
    let want = process(engine, &small.outside, SIZE).unwrap();
    assert!(output(&host).read(vk::ImageLayout::GENERAL, PIXELS * 4) != rgba(&want), "control");
    let outside = |wait, signal, memory| {
        let mut o = small.outside;
        (o.wait, o.wait_value, o.signal, o.signal_value, o.picture_memory) = (wait, 5, signal, 9, memory);
        let mut frame = null_mut();
        must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
        frame
    };
    between_timelines(&host, engine, &outside, &want);
    // The same of a scene's frame, by each method.
    finish(engine);
    for method in 1..=4 {
        let mut names = Vec::new();
        let described = host.describe(&mut names);
        let mut o = options(method, 0);
        o.host = &described;
        let engine = create(o).unwrap();
        must(unsafe { shutterbug_engine_load_capture(engine, text("demo/capture").as_ptr()) }, engine);
        must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
        let submit = |wait, signal, memory| {
            let mut r: shutterbug_request = sized();
            (r.time_s, r.wait, r.wait_value, r.signal, r.signal_value) = (10.1, wait, 5, signal, 9);
            r.picture_memory = memory;
            let mut frame = null_mut();
            must(unsafe { shutterbug_engine_submit(engine, &r, &mut frame) }, engine);
            frame
        };
        let frame = submit(null_mut(), null_mut(), null_mut());
        must(shutterbug_frame_wait(frame, -1.0), frame);
        let mut want = vec![0; PIXELS * 3];
        let to = image(PixelFormat::Rgb8, SIZE[0], SIZE[1], &mut want);
        must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
        must(shutterbug_frame_destroy(frame), null_mut());
        between_timelines(&host, engine, &submit, &want);
        finish(engine);
    }
    host.finish();
}

#[test]
fn frames_take_and_give_the_hosts_binary_semaphores() {
    let Some(host) = host("frames_take_and_give_the_hosts_binary_semaphores") else { return };
    let engine = engine_of(&host);
    let small = Small::new(32, 24);
    let want = process(engine, &small.outside, SIZE).unwrap();
    let make = || unsafe { host.device.create_semaphore(&vk::SemaphoreCreateInfo::default(), None) }.unwrap();
    let (before, after) = (make(), make());
    let (wait, signal) = (use_semaphore(engine, before, 0), use_semaphore(engine, after, 0));
    let on_gpu = output(&host);
    let memory = use_image(engine, &on_gpu);
    for _ in 0..3 {
        host.submit(|_| (), &vk::SubmitInfo::default().signal_semaphores(&[before]));
        let mut o = small.outside;
        (o.wait, o.signal, o.picture_memory) = (wait, signal, memory);
        let mut frame = null_mut();
        must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
        // The host's next work waits for the frame on the device, and ends.
        let stages = [vk::PipelineStageFlags::ALL_COMMANDS];
        host.submit(
            |_| (),
            &vk::SubmitInfo::default().wait_semaphores(&[after]).wait_dst_stage_mask(&stages),
        );
        assert!(on_gpu.read(vk::ImageLayout::GENERAL, PIXELS * 4) == rgba(&want));
        must(shutterbug_frame_wait(frame, -1.0), frame);
        must(shutterbug_frame_destroy(frame), null_mut());
    }
    // Destroyed early: a frame keeps what it uses.
    let mut o = small.outside;
    o.picture_memory = memory;
    let mut frame = null_mut();
    must(unsafe { shutterbug_engine_submit_outside(engine, &o, &mut frame) }, engine);
    must(shutterbug_memory_destroy(memory), null_mut());
    must(shutterbug_frame_wait(frame, -1.0), frame);
    must(shutterbug_frame_destroy(frame), null_mut());
    for handle in [wait, signal] {
        must(shutterbug_semaphore_destroy(handle), null_mut());
    }
    finish(engine);
    for semaphore in [before, after] {
        unsafe { host.device.destroy_semaphore(semaphore, None) };
    }
    drop(on_gpu);
    host.finish();
}

#[test]
fn images_go_out_and_in_by_file_descriptor() {
    let test = "images_go_out_and_in_by_file_descriptor";
    let Some(engine) = engine(test, options(2, 1)) else { return };
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    let mut d: shutterbug_gpu_image = sized();
    (d.vk_format, d.width, d.height, d.vk_layout) = (vk::Format::R8G8B8A8_UNORM.as_raw() as u32, 32, 24, 1);
    d.vk_usage = 3;
    let (mut exported, mut fd, mut bytes) = (made_up(9), -7, 5);
    let code = unsafe { shutterbug_memory_export_image_fd(engine, &d, &mut exported, &mut fd, &mut bytes) };
    if code == status("UNSUPPORTED") {
        assert_eq!((exported, fd, bytes), (made_up(9), -7, 5), "outputs are written on success only");
        let says =
            if info(engine).capabilities & 2 == 0 { "VK_KHR_external_memory_fd" } else { "VkFormat 37" };
        assert!(error_of(engine).contains(says), "{}", error_of(engine));
        let code = unsafe { shutterbug_memory_import_image_fd(engine, &d, 0, 1 << 20, &mut exported) };
        assert_eq!(code, status("UNSUPPORTED"));
        eprintln!("SKIPPED the rest of {test}: the device cannot share such images; refused clearly");
        return finish(engine);
    }
    must(code, engine);
    assert!(fd >= 0 && bytes >= (PIXELS * 4) as u64);
    let small_bytes = unsafe { shutterbug_memory_import_image_fd(engine, &d, fd, 64, &mut made_up(9)) };
    assert_eq!(small_bytes, status("LIMIT"), "fewer bytes than the image takes");
    let mut imported = null_mut();
    must(unsafe { shutterbug_memory_import_image_fd(engine, &d, fd, bytes, &mut imported) }, engine);
    // A picture that goes out through one handle comes in as colour through the other.
    let small = Small::new(32, 24);
    let mut o = small.outside;
    o.picture_memory = exported;
    let first = process(engine, &o, SIZE).unwrap();
    let color = picture(imported);
    o = small.outside;
    o.color = &color;
    let second = process(engine, &o, SIZE).unwrap();
    let mut bytes = rgba(&first);
    let given = image(PixelFormat::Rgba8, 32, 24, &mut bytes);
    o.color = &given;
    assert!(process(engine, &o, SIZE).unwrap() == second, "what went out came in");
    assert!(second != first, "control");
    must(shutterbug_memory_destroy(exported), null_mut());
    must(shutterbug_memory_destroy(imported), null_mut());
    from_another_device(test, engine);
    finish(engine);
}

/// An image that another VkDevice made, filled and exported.
fn from_another_device(test: &str, engine: Handle) {
    let Some(host) = host(test) else { return };
    let mut spec = input(vk::Format::R16G16B16A16_SFLOAT);
    spec.layout = vk::ImageLayout::GENERAL;
    let format = PixelFormat::Rgba16f;
    let on_gpu = host.image(spec, &bytes_of(format), true);
    let mut d = describe(&on_gpu);
    (d.vk_image, d.vk_usage) = (0, spec.usage.as_raw());
    let mut memory = null_mut();
    let code =
        unsafe { shutterbug_memory_import_image_fd(engine, &d, on_gpu.export(), on_gpu.bytes, &mut memory) };
    must(code, engine);
    let small = Small::new(32, 24);
    let mut given = Given::new(format);
    let (theirs, ours) = (picture(memory), given.image());
    let mut o = small.outside;
    o.color = &ours;
    let want = process(engine, &o, SIZE).unwrap();
    o.color = &theirs;
    assert!(process(engine, &o, SIZE).unwrap() == want, "another device's image");
    must(shutterbug_memory_destroy(memory), null_mut());
    drop(on_gpu);
    host.finish();
}

#[test]
fn what_cannot_be_is_refused_with_a_sentence() {
    let test = "what_cannot_be_is_refused_with_a_sentence";
    let Some(host) = host(test) else { return };
    let engine = engine_of(&host);
    let on_gpu = output(&host);
    let memory = use_image(engine, &on_gpu);
    let small = Small::new(32, 24);
    let refused = |code: Status, name: &str, says: &str, engine: Handle| {
        assert_eq!(code, status(name), "{}", error_of(engine));
        assert!(error_of(engine).contains(says), "`{}` does not say `{says}`", error_of(engine));
    };
    let making = |name: &str, says: &str, change: &dyn Fn(&mut shutterbug_gpu_image)| {
        let (mut d, mut memory) = (describe(&on_gpu), made_up(9));
        change(&mut d);
        refused(unsafe { shutterbug_memory_use_image(engine, &d, &mut memory) }, name, says, engine);
        assert_eq!(memory, made_up(9));
    };
    making("ARGUMENT", "vk_image is null", &|d| d.vk_image = 0);
    making("ARGUMENT", "vk_layout_after", &|d| d.vk_layout = 0);
    making("ARGUMENT", "vk_layout is 3,", &|d| d.vk_layout = 3);
    making("ARGUMENT", "vk_layout_after is 8,", &|d| d.vk_layout_after = 8);
    making("ARGUMENT", "vk_usage is 0x20", &|d| d.vk_usage |= 0x20);
    making("LIMIT", "a side of 0 px", &|d| d.width = 0);
    making("FORMAT", "vk_format is 1,", &|d| d.vk_format = 1);
    making("STRUCT_SIZE", "struct_size", &|d| d.struct_size += 8);
    let using = |name: &str, says: &str, change: &dyn Fn(&mut shutterbug_image)| {
        let (mut color, mut o) = (picture(memory), small.outside);
        change(&mut color);
        o.color = &color;
        let (code, text) = process(engine, &o, SIZE).unwrap_err();
        assert_eq!(code, status(name), "{text}");
        assert!(text.contains(says), "`{text}` does not say `{says}`");
    };
    using("FORMAT", "holds Rgba8", &|c| c.format = 3);
    using("ARGUMENT", "its GPU image 32x24", &|c| c.width = 31);
    using("ARGUMENT", "memory_offset", &|c| c.memory_offset = 4);
    let mut undefined = describe(&on_gpu);
    (undefined.vk_layout, undefined.vk_layout_after) = (0, 1);
    let mut blank = null_mut();
    must(unsafe { shutterbug_memory_use_image(engine, &undefined, &mut blank) }, engine);
    using("ARGUMENT", "undefined layout", &|c| c.memory = blank);
    // As an output it is fine; an image of floats is not.
    let float_image = host.image(input(vk::Format::R32G32B32A32_SFLOAT), &[0; PIXELS * 16], false);
    let floats = use_image(engine, &float_image);
    let mut o = small.outside;
    o.picture_memory = blank;
    process(engine, &o, SIZE).unwrap();
    o.picture_memory = floats;
    assert_eq!(process(engine, &o, SIZE).unwrap_err().0, status("FORMAT"));
    // Effects of host memory never reach an image.
    let jpeg = "width = 32\nheight = 24\nfx = 16\nfy = 16\ncx = 16\ncy = 12\nframe_period_s = 0.04\n[jpeg]\n\
                quality = 50\n";
    must(unsafe { shutterbug_engine_set_camera_text(engine, text(jpeg).as_ptr()) }, engine);
    o.picture_memory = blank;
    let (code, said) = process(engine, &o, SIZE).unwrap_err();
    assert!(code == status("UNSUPPORTED") && said.contains("`jpeg`"), "{said}");
    o.picture_memory = null_mut();
    process(engine, &o, SIZE).unwrap();
    // The host's objects mean nothing on a device of the engine's own.
    let own = self::engine(test, options(2, 0)).unwrap();
    let code = unsafe { shutterbug_memory_use_image(own, &describe(&on_gpu), &mut made_up(9)) };
    refused(code, "UNSUPPORTED", "a device of its own: images", own);
    let code = unsafe { shutterbug_semaphore_use(own, 16, 0, &mut made_up(9)) };
    refused(code, "UNSUPPORTED", "a device of its own: semaphores", own);
    refused(unsafe { shutterbug_semaphore_use(own, 16, 2, &mut made_up(9)) }, "ARGUMENT", "no kind 2", own);
    refused(unsafe { shutterbug_semaphore_use(own, 0, 0, &mut made_up(9)) }, "ARGUMENT", "null", own);
    let mut d = describe(&on_gpu);
    let code = unsafe { shutterbug_memory_import_image_fd(own, &d, 0, 4096, &mut made_up(9)) };
    refused(code, "ARGUMENT", "shutterbug_memory_use_image only", own);
    (d.vk_image, d.vk_usage) = (0, 4);
    let code = unsafe { shutterbug_memory_import_image_fd(own, &d, 0, 4096, &mut made_up(9)) };
    refused(code, "ARGUMENT", "VK_IMAGE_USAGE_TRANSFER_SRC_BIT", own);
    finish(own);
    for handle in [memory, blank, floats] {
        must(shutterbug_memory_destroy(handle), null_mut());
    }
    finish(engine);
    drop((on_gpu, float_image));
    host.finish();
}
