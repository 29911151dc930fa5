//! Percepts are where they were drawn, agree where nothing moved, and do not where it did.

use shutterbug::plane::Plane;
use shutterbug_diagnose::diagnose::percepts::{PictureOf, compare, find};

/// A bright square and a dark disc on grey, moved, with grain.
fn picture(dx: f32, grain_dn: usize) -> Plane<u8> {
    Plane::from_fn(160, 120, |x, y| {
        let (u, v) = (x as f32 - dx, y as f32);
        let square = (30.0..80.0).contains(&u) && (25.0..75.0).contains(&v);
        let disc = (u - 120.0).hypot(v - 60.0) < 6.0;
        let grain = ((x * 7919 + y * 104_729 + x * y * 31) % 11) * grain_dn / 10;
        [if square { 200 } else { 100 } - if disc { 70 } else { 0 } + grain as u8; 3]
    })
}

fn near(a: [f32; 2], b: [f32; 2], px: f32) -> bool {
    (a[0] - b[0]).hypot(a[1] - b[1]) <= px
}

#[test]
fn corners_lines_and_blobs_are_where_they_were_drawn() {
    let found = find(&picture(0.0, 0));
    for corner in [[30.0, 25.0], [80.0, 25.0], [30.0, 75.0], [80.0, 75.0]] {
        assert!(found.corners.iter().any(|c| near(*c, corner, 4.0)), "{:?}", found.corners);
    }
    assert!(found.corners.len() <= 8, "{:?}", found.corners);
    // Each side of the square: its middle lies on a line of its direction and length.
    for (middle, across) in [([55.0, 25.0], 1), ([55.0, 75.0], 1), ([30.0, 50.0], 0), ([80.0, 50.0], 0)] {
        let side = |l: &&[f32; 4]| {
            let length = (l[2] - l[0]).hypot(l[3] - l[1]);
            let off = (l[across] - middle[across]).abs().max((l[2 + across] - middle[across]).abs());
            off < 1.5 && (length - 50.0).abs() < 8.0
        };
        assert!(found.lines.iter().any(|l| side(&l)), "{middle:?}: {:?}", found.lines);
    }
    let disc = |b: &[f32; 3]| near([b[0], b[1]], [120.5, 60.5], 1.0) && (b[2] - 6.0).abs() < 0.5;
    assert!(found.blobs.iter().any(disc), "{:?}", found.blobs);
    // Nothing is found in nothing.
    assert_eq!(find(&Plane::from_fn(64, 48, |_, _| [90u8; 3])), PictureOf::default());
    assert_eq!(find(&Plane::from_fn(5, 5, |x, _| [40 * x as u8; 3])), PictureOf::default());
}

#[test]
fn what_moved_agrees_less_and_what_moved_far_hardly_at_all() {
    let real = find(&picture(0.0, 0));
    let moved = |dx: f32| compare(&find(&picture(dx, 0)), &real, 3.0);
    let still = moved(0.0);
    for kind in &still {
        assert!(kind.share == 1.0 && kind.offset_px == 0.0 && kind.matched.iter().all(|m| *m), "{kind:?}");
    }
    let [corners, _, blobs] = moved(2.0);
    assert!(corners.share > 0.9 && blobs.share > 0.9, "{corners:?} {blobs:?}");
    assert!(
        (corners.offset_px - 2.0).abs() < 0.2 && (blobs.offset_px - 2.0).abs() < 0.2,
        "{corners:?} {blobs:?}"
    );
    let [corners, lines, blobs] = moved(9.0);
    assert!(corners.share < 0.3 && blobs.share == 0.0, "{corners:?} {blobs:?}");
    // Level edges that moved along themselves are the same lines, upright ones are not.
    assert!((0.2..0.8).contains(&lines.share), "{lines:?}");
}

#[test]
fn noise_makes_percepts_that_do_not_agree() {
    let real = find(&picture(0.0, 0));
    let noisy = find(&picture(0.0, 50));
    let [corners, ..] = compare(&noisy, &real, 2.0);
    assert!(noisy.corners.len() > real.corners.len() && corners.share < 0.8, "{corners:?}");
    assert_eq!(corners.matched.len(), noisy.corners.len());
}
