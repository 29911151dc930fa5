//! A steady stream of frames from outside allocates nothing, whatever they bring.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use crate::gpu_support::device;
use shutterbug::camera::{Intrinsics, Pose, ScanOrder, ShutterTiming, Trajectory};
use shutterbug::engine::{
    FrameRequest, OutsideBodies, OutsideEngine, OutsideFrame, OutsideMotion, OutsidePicture, OutsidePixels,
    PixelSource,
};
use shutterbug::plane::PixelFormat;

const W: usize = 48;
const H: usize = 32;
const K: Intrinsics =
    Intrinsics { width: W as u32, height: H as u32, fx: 40.0, fy: 40.0, cx: 24.0, cy: 16.0 };

fn request(index: u32, exposure_time_s: f64) -> FrameRequest {
    let shutter = ShutterTiming {
        start_s: 0.1 * f64::from(index),
        exposure_time_s,
        readout_time_s: 0.02,
        scan_order: ScanOrder::ALL[index as usize % 4],
        line_count: ScanOrder::ALL[index as usize % 4].line_count(W as u32, H as u32),
    };
    FrameRequest {
        index,
        shutter,
        frame_interval_s: 0.04,
        seed: 0,
        settings: Default::default(),
        static_camera: false,
        planes: false,
        statistics: false,
    }
}

fn path(speed_m_s: f64) -> Trajectory {
    let times_s: Vec<f64> = (0..40).map(|i| 0.05 * f64::from(i)).collect();
    let at = |t: &f64| Pose { translation_m: glam::DVec3::new(speed_m_s * t, 0.0, 0.0), ..Pose::IDENTITY };
    let poses = times_s.iter().map(at).collect();
    Trajectory::new(Path::new("test"), times_s, poses).unwrap().smoothed()
}

/// Frame `index` of a stream: from so many pictures, with a body or without.
fn frame(
    engine: &mut OutsideEngine,
    index: u32,
    exposure_s: f64,
    (pictures, body): (usize, bool),
) -> Vec<u8> {
    let color: Vec<u8> = (0..W * H * 3).map(|i| ((i * 7919) >> 5) as u8).collect();
    let depth: Vec<f32> = (0..W * H).map(|i| 1.0 + (i % 7) as f32).collect();
    let ids: Vec<u8> = (0..W * H).map(|i| u8::from(i % W > 20)).collect();
    let pixels = |format: PixelFormat, bytes| OutsidePixels {
        format,
        bottom_up: false,
        stride_bytes: W * format.bytes(),
        source: PixelSource::Host(bytes),
    };
    let color = pixels(PixelFormat::Rgb8, &color);
    let image = pixels(PixelFormat::R32f, bytemuck::cast_slice(&depth));
    let ids = pixels(PixelFormat::R8u, &ids);
    let request = request(index, exposure_s);
    let at = |k: usize| request.shutter.start_s + 0.008 * k as f64;
    let further = (1..pictures).map(|k| OutsidePicture {
        time_s: at(k),
        color,
        depth: image,
        ids: body.then_some(ids),
    });
    let motion = OutsideMotion::Path {
        image,
        decode: None,
        path: Arc::new(path(1.0)),
        bodies: body.then(|| OutsideBodies { ids, paths: vec![(1, path(-2.0))] }),
        further: further.collect(),
        nearest_m: f64::INFINITY,
        repeat_border: true,
    };
    let color_time_s = at(0);
    let ticket = engine.submit(&OutsideFrame {
        request,
        color,
        encoding: Default::default(),
        color_time_s,
        margin_px: [0, 0],
        motion,
        max_samples: 240,
        delivery: Default::default(),
    });
    engine.collect(ticket.unwrap()).unwrap().picture.data
}

#[test]
fn a_steady_stream_allocates_nothing() {
    let Some(watched) = device("a_steady_stream_allocates_nothing") else { return };
    for kind in [(1, false), (1, true), (3, false), (5, true)] {
        for exposure_s in [0.0, 0.004] {
            let before = watched.0.allocation_count();
            let mut engine = OutsideEngine::new(&watched.0, K, 2, Duration::from_secs(60)).unwrap();
            // Every slot meets its first frame.
            (0..2).for_each(|i| drop(frame(&mut engine, i, exposure_s, kind)));
            let made = watched.0.allocation_count();
            assert!(made - before > 10, "control: the counter counts");
            let pictures: Vec<_> = (2..8).map(|i| frame(&mut engine, i, exposure_s, kind)).collect();
            assert_eq!(watched.0.allocation_count(), made, "{kind:?}, exposure {exposure_s}");
            assert!(pictures[0] != pictures[1], "control: frames differ");
            // Another number of pictures needs other images.
            frame(&mut engine, 2, exposure_s, (kind.0 + 1, kind.1));
            assert!(watched.0.allocation_count() > made, "control: {kind:?}");
        }
    }
}
