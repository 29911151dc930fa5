//! Zero copy: the host's memory, memory by file descriptor, semaphores, and the host's own Vulkan device. What the
//! driver cannot do is refused with a sentence; on lavapipe of Mesa 22.3 that is semaphores by file descriptor
//! (SwiftShader has the binary ones).
#![allow(unsafe_code, clippy::unwrap_used, clippy::undocumented_unsafe_blocks)]

use std::ptr::{null, null_mut};

use crate::capi_host::Host;
use crate::capi_support::*;
use shutterbug::capi::*;

const SIZE: [usize; 2] = [32, 24];
const CAN_IMPORT_HOST: u32 = 1;
const CAN_SHARE_MEMORY: u32 = 2;
const CAN_SHARE_SEMAPHORE: u32 = 4;
const CAN_SHARE_TIMELINE: u32 = 8;
const BINARY: u32 = 0;
const TIMELINE: u32 = 1;

fn small_engine(test: &str) -> Option<Handle> {
    let engine = engine(test, options(2, 1))?;
    must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
    Some(engine)
}

#[test]
fn host_memory_is_read_and_written_where_it_is() {
    let test = "host_memory_is_read_and_written_where_it_is";
    let Some(engine) = small_engine(test) else { return };
    let small = Small::new(32, 24);
    let want = process(engine, &small.outside, SIZE).unwrap();
    let alignment = info(engine).host_alignment_bytes as usize;
    let mut memory = made_up(9);
    if info(engine).capabilities & CAN_IMPORT_HOST == 0 {
        let mut byte = 0u8;
        let code =
            unsafe { shutterbug_memory_import_host(engine, (&raw mut byte).cast(), 4096, &mut memory) };
        assert_eq!((code, memory), (status("UNSUPPORTED"), made_up(9)), "{}", error_of(engine));
        assert!(error_of(engine).contains("VK_EXT_external_memory_host"));
        eprintln!("SKIPPED the rest of {test}: the device cannot import host memory; refused clearly");
        return finish(engine);
    }
    let bytes = (32 * 24 * 16usize).next_multiple_of(alignment);
    let layout = std::alloc::Layout::from_size_align(bytes, alignment).unwrap();
    let (pixels, out) = unsafe { (std::alloc::alloc_zeroed(layout), std::alloc::alloc_zeroed(layout)) };
    // Off by one in address and size.
    unsafe {
        let import = |p: *mut u8, bytes: u64, m: &mut Handle| {
            shutterbug_memory_import_host(engine, p.cast(), bytes, m)
        };
        assert_eq!(import(pixels.add(1), bytes as u64, &mut memory), status("LIMIT"));
        assert_eq!(import(pixels, bytes as u64 - 1, &mut memory), status("LIMIT"));
        assert_eq!(import(pixels, 0, &mut memory), status("LIMIT"));
        assert_eq!(import(null_mut(), bytes as u64, &mut memory), status("ARGUMENT"));
        assert_eq!(memory, made_up(9));
        must(import(pixels, bytes as u64, &mut memory), engine);
    }
    let mut out_memory = null_mut();
    must(unsafe { shutterbug_memory_import_host(engine, out.cast(), bytes as u64, &mut out_memory) }, engine);
    let mut color = unsafe { *small.outside.color };
    unsafe { std::ptr::copy_nonoverlapping(color.pixels.cast::<u8>(), pixels, 32 * 24 * 16) };
    (color.pixels, color.capacity_bytes, color.memory) = (null_mut(), 0, memory);
    let mut o = small.outside;
    (o.color, o.picture_memory) = (&color, out_memory);
    assert!(process(engine, &o, SIZE).unwrap() == want, "the same picture without a copy");
    let written = unsafe { std::slice::from_raw_parts(out, 32 * 24 * 4) };
    let rgb: Vec<u8> = written.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
    assert!(rgb == want, "the picture is in the host's memory");
    // Control: it is read at the time of the frame, not of the import.
    unsafe { pixels.cast::<f32>().add(4 * (12 * 32 + 16)).write(40.0) };
    assert!(process(engine, &o, SIZE).unwrap() != want, "control");
    // Beyond its end.
    color.memory_offset = (bytes - 32 * 24 * 16) as u64 + 4;
    o.color = &color;
    assert_eq!(process(engine, &o, SIZE).unwrap_err().0, status("TOO_SMALL"));
    // Of another engine.
    let other = small_engine(test).unwrap();
    color.memory_offset = 0;
    o.color = &color;
    assert_eq!(process(other, &o, SIZE).unwrap_err().0, status("ARGUMENT"));
    finish(other);
    must(shutterbug_memory_destroy(memory), null_mut());
    must(shutterbug_memory_destroy(out_memory), null_mut());
    assert_eq!(shutterbug_memory_destroy(memory), status("HANDLE"));
    finish(engine);
    unsafe {
        std::alloc::dealloc(pixels, layout);
        std::alloc::dealloc(out, layout);
    }
}

#[test]
fn memory_goes_out_and_in_by_file_descriptor() {
    let test = "memory_goes_out_and_in_by_file_descriptor";
    let Some(engine) = small_engine(test) else { return };
    let small = Small::new(32, 24);
    let (mut exported, mut imported, mut fd) = (null_mut(), null_mut(), -7);
    let bytes = 1 << 16;
    let code = unsafe { shutterbug_memory_export_fd(engine, bytes, &mut exported, &mut fd) };
    if info(engine).capabilities & CAN_SHARE_MEMORY == 0 {
        assert_eq!((code, fd), (status("UNSUPPORTED"), -7), "{}", error_of(engine));
        assert!(error_of(engine).contains("VK_KHR_external_memory_fd"));
        eprintln!("SKIPPED the rest of {test}: the device cannot share memory; refused clearly");
        return finish(engine);
    }
    must(code, engine);
    assert!(fd >= 0);
    must(unsafe { shutterbug_memory_import_fd(engine, fd, bytes, &mut imported) }, engine);
    assert_eq!(unsafe { shutterbug_memory_import_fd(engine, -1, bytes, &mut imported) }, status("ARGUMENT"));
    // A file that is smaller than the host says would be SIGBUS on a software driver.
    let file = tempfile::tempfile().unwrap();
    file.set_len(bytes / 2).unwrap();
    let too_small = std::os::fd::AsRawFd::as_raw_fd(&file);
    assert_eq!(
        unsafe { shutterbug_memory_import_fd(engine, too_small, bytes, &mut imported) },
        status("LIMIT")
    );
    assert!(error_of(engine).contains("size of imported memory"), "{}", error_of(engine));
    // A picture written through one handle is a colour read through the other: RGBA8 out, RGBA8 in.
    let mut o = small.outside;
    o.picture_memory = exported;
    let first = process(engine, &o, SIZE).unwrap();
    let mut again = small.outside;
    let mut color: shutterbug_image = sized();
    (color.format, color.width, color.height, color.stride_bytes) = (2, 32, 24, 128);
    color.memory = imported;
    again.color = &color;
    let second = process(engine, &again, SIZE).unwrap();
    let mut rgba: Vec<u8> = first.chunks_exact(3).flat_map(|p| [p[0], p[1], p[2], 255]).collect();
    let mut given = image(shutterbug::plane::PixelFormat::Rgba8, 32, 24, &mut rgba);
    again.color = &given;
    assert!(process(engine, &again, SIZE).unwrap() == second, "what went out came in");
    rgba[4 * (12 * 32 + 10)] ^= 0x80;
    given.pixels = rgba.as_mut_ptr().cast();
    again.color = &given;
    assert!(process(engine, &again, SIZE).unwrap() != second, "control");
    must(shutterbug_memory_destroy(exported), null_mut());
    must(shutterbug_memory_destroy(imported), null_mut());
    finish(engine);
}

#[test]
fn semaphores_go_out_and_in_or_are_refused() {
    let test = "semaphores_go_out_and_in_or_are_refused";
    let Some(engine) = small_engine(test) else { return };
    for (kind, bit) in [(BINARY, CAN_SHARE_SEMAPHORE), (TIMELINE, CAN_SHARE_TIMELINE)] {
        let (mut semaphore, mut fd) = (made_up(5), -7);
        assert_eq!(
            unsafe { shutterbug_semaphore_export_fd(engine, 2, &mut semaphore, &mut fd) },
            status("ARGUMENT")
        );
        let code = unsafe { shutterbug_semaphore_export_fd(engine, kind, &mut semaphore, &mut fd) };
        if info(engine).capabilities & bit == 0 {
            assert_eq!(
                (code, semaphore, fd),
                (status("UNSUPPORTED"), made_up(5), -7),
                "{}",
                error_of(engine)
            );
            assert!(error_of(engine).contains("VK_KHR_external_semaphore_fd"));
            let code = unsafe { shutterbug_semaphore_import_fd(engine, 0, kind, &mut semaphore) };
            assert_eq!(code, status("UNSUPPORTED"));
            eprintln!(
                "SKIPPED kind {kind} of {test}: the device cannot share such semaphores; refused clearly"
            );
            continue;
        }
        must(code, engine);
        let mut imported = null_mut();
        must(unsafe { shutterbug_semaphore_import_fd(engine, fd, kind, &mut imported) }, engine);
        one_signals_the_next_waits(engine, semaphore, imported);
        must(shutterbug_semaphore_destroy(semaphore), null_mut());
        must(shutterbug_semaphore_destroy(imported), null_mut());
    }
    finish(engine);
}

/// One frame signals through one handle, the next one waits through the other: without the signal it would time out.
fn one_signals_the_next_waits(engine: Handle, semaphore: Handle, imported: Handle) {
    let (mut first, mut second) = (Small::new(32, 24), Small::new(32, 24));
    let want = process(engine, &first.outside, SIZE).unwrap();
    for value in 1..4 {
        (first.outside.signal, first.outside.signal_value) = (semaphore, 10 * value);
        (second.outside.wait, second.outside.wait_value) = (imported, 10 * value);
        let (mut a, mut b) = (null_mut(), null_mut());
        must(unsafe { shutterbug_engine_submit_outside(engine, &first.outside, &mut a) }, engine);
        must(unsafe { shutterbug_engine_submit_outside(engine, &second.outside, &mut b) }, engine);
        for frame in [a, b] {
            must(shutterbug_frame_wait(frame, 60.0), frame);
            let mut rgb = vec![0; want.len()];
            let to = image(shutterbug::plane::PixelFormat::Rgb8, 32, 24, &mut rgb);
            must(unsafe { shutterbug_frame_read(frame, 1, &to) }, frame);
            assert!(rgb == want);
            must(shutterbug_frame_destroy(frame), frame);
        }
    }
}

#[test]
fn the_hosts_own_device_is_used_and_left_alone() {
    let test = "the_hosts_own_device_is_used_and_left_alone";
    let Some(own) = small_engine(test) else { return };
    let small = Small::new(32, 24);
    let want = process(own, &small.outside, SIZE).unwrap();
    finish(own);
    let host = Host::new(&[]).expect("there is a device");
    let mut names = Vec::new();
    let described = host.describe(&mut names);
    let mut o = options(2, 0);
    o.host = &described;
    let engines = [create(o).unwrap(), create(o).unwrap()];
    for engine in engines {
        must(unsafe { shutterbug_engine_set_camera(engine, &camera(32, 24)) }, engine);
        // Another device may round differently; lavapipe is alone on most machines that run this.
        let got = process(engine, &small.outside, SIZE).unwrap();
        let worst = got.iter().zip(&want).map(|(a, b)| a.abs_diff(*b)).max().unwrap();
        assert!(worst <= 1, "{worst} levels from the picture of an own device");
        // The host enabled no extension: nothing is shared, and that is said.
        let mut memory = null_mut();
        assert_eq!(info(engine).capabilities, 0);
        let code = unsafe { shutterbug_memory_import_host(engine, made_up(4096), 4096, &mut memory) };
        assert_eq!(code, status("UNSUPPORTED"));
    }
    assert_eq!(shutterbug_engine_destroy(engines[0]), OK);
    // Wrong descriptions are refused before anything is used.
    let refused = |change: &dyn Fn(&mut shutterbug_host_device)| {
        let mut wrong = described;
        change(&mut wrong);
        let mut o = options(2, 0);
        o.host = &wrong;
        create(o).unwrap_err().0
    };
    assert_eq!(refused(&|h| h.device = null_mut()), status("ARGUMENT"));
    assert_eq!(refused(&|h| h.get_instance_proc_addr = null()), status("ARGUMENT"));
    assert_eq!(refused(&|h| h.extension_count = 1), status("ARGUMENT"));
    assert_eq!(refused(&|h| h.queue_family = 99), status("UNSUPPORTED"));
    assert_eq!(refused(&|h| h.physical_device = made_up(16)), status("NO_DEVICE"));
    assert_eq!(refused(&|h| h.struct_size -= 1), status("STRUCT_SIZE"));
    assert_eq!(shutterbug_engine_destroy(engines[1]), OK);
    host.finish();
}

/// What is no memory: a driver that reads from a pipe would wait for ever.
#[test]
fn pipes_sockets_and_closed_descriptors_are_no_memory() {
    use std::os::fd::AsRawFd as _;
    let test = "pipes_sockets_and_closed_descriptors_are_no_memory";
    let Some(engine) = small_engine(test) else { return };
    let (reader, _writer) = std::io::pipe().unwrap();
    let (socket, _other) = std::os::unix::net::UnixStream::pair().unwrap();
    let folder = std::fs::File::open("/").unwrap();
    for (fd, says) in [
        (reader.as_raw_fd(), "is a pipe"),
        (socket.as_raw_fd(), "a socket"),
        (folder.as_raw_fd(), "a folder"),
        (-1, "-1"),
        (1 << 20, "Bad file descriptor"),
    ] {
        let mut made = made_up(9);
        let code = unsafe { shutterbug_memory_import_fd(engine, fd, 4096, &mut made) };
        assert_eq!((code, made), (status("ARGUMENT"), made_up(9)), "{fd}: {}", error_of(engine));
        assert!(error_of(engine).contains(says), "{}", error_of(engine));
        let code = unsafe { shutterbug_semaphore_import_fd(engine, fd, BINARY, &mut made) };
        assert_eq!(code, status("ARGUMENT"), "{}", error_of(engine));
    }
    // A sentence with what stands in the host's input stays one line of text.
    let code = unsafe { shutterbug_engine_load_scene(engine, text("/no\n\u{1b}[31m").as_ptr()) };
    assert_ne!(code, OK);
    assert!(error_of(engine).contains("\\n\\u{1b}[31m"), "{}", error_of(engine));
    finish(engine);
}
