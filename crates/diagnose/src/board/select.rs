//! Which camera the views ask for: an ideal pinhole first, then lenses of more and more coefficients, then a readout
//! where the board moves. More parameters are taken where they lower the cost by more than chance would (Schwarz,
//! Annals of Statistics 6, 1978).

use std::path::Path;

use glam::{DMat3, DVec2};

use super::bundle::{Bundle, Camera, PARAMETERS, Point};
use super::homography::{focal_lengths, homography, pose};
use super::motion::BoardPath;
use super::one_camera::OneCamera;
use super::target::{Target, View};
use shutterbug::camera::{Pose, Trajectory};
use shutterbug::error::{Error, Result, counted};

/// Fewest views: each gives two equations for what is unknown of a camera, four with lens and centre.
pub const LEAST_VIEWS: usize = 3;
/// Fewest points of a view: four fix a homography, two more are left to tell errors by.
pub const LEAST_POINTS: usize = 6;
/// Places in [`PARAMETERS`].
const PINHOLE: &[usize] = &[0, 1, 2, 3];
const LENSES: [&[usize]; 4] =
    [&[0, 1, 2, 3, 4], &[0, 1, 2, 3, 4, 5], &[0, 1, 2, 3, 4, 5, 6, 7], &[0, 1, 2, 3, 4, 5, 6, 7, 8]];
const READOUTS: [usize; 2] = [9, 10];
/// Focal lengths to start from beside the closed form's, in picture widths: from a wide action camera to a portrait
/// lens.
const START_FOCALS: [f64; 4] = [0.4, 0.7, 1.2, 2.5];

/// What is known of when the pictures were taken.
#[derive(Clone, Debug, PartialEq)]
pub enum Timing {
    /// Stills: the board rests in each.
    Stills,
    /// Frames that follow each other: when each picture began, s.
    Frames(Vec<f64>),
}

/// A camera and poses that agree with the points.
#[derive(Clone, Debug)]
pub struct BoardFit {
    /// The camera with lens and readout.
    pub camera: Camera,
    /// Half widths of 95 % intervals, by name of the parameters that were free.
    pub half: Vec<(&'static str, f64)>,
    /// Camera from board, by view.
    pub poses: Vec<Pose>,
    /// Root mean square distance of the points, px: of the pinhole alone, and of the camera.
    pub rms_px: [f64; 2],
    /// The same by view.
    pub view_rms_px: Vec<f64>,
    /// What speaks against one camera; nothing of frames that follow each other, which are not judged.
    pub one_camera: Option<OneCamera>,
    /// Of a board that moves: the path as it is written, and the views that it covers.
    pub path: Option<(Trajectory, Vec<usize>)>,
}

/// Fits camera and poses to the views; `frames` is what errors name.
///
/// # Errors
/// Too few views or points; a board that was always parallel to the picture; frames whose times do not increase.
pub fn fit_board(
    target: &Target,
    views: &[View],
    size: [u32; 2],
    timing: &Timing,
    frames: &Path,
) -> Result<BoardFit> {
    check(target, views, frames)?;
    let starts_s = match timing {
        Timing::Stills => None,
        Timing::Frames(all) => Some(views.iter().map(|v| all[v.picture]).collect()),
    };
    let points = |view: &View| {
        view.seen.iter().map(|s| Point { on_board_m: target.point_m(s.point), px: s.px }).collect()
    };
    let points: Vec<Vec<Point>> = views.iter().map(points).collect();
    let Some(mut pinhole) = best_start(&points, size, frames)? else {
        let expected = "some where it is tilted: without, focal length and distance cannot be told apart";
        return Err(Error::input(frames, None, "the board parallel to every picture", expected));
    };
    pinhole.starts_s = starts_s;
    let spread_px = pinhole.spread_px()?;
    pinhole.fit(PINHOLE, spread_px)?;
    let pinhole_rms_px = rms(&pinhole)?;
    let (mut bundle, mut free) = with_lens(&pinhole)?;
    if bundle.starts_s.is_some() {
        (bundle, free) = with_readout(&bundle, &free)?;
    }
    let half = check_known(&bundle, &free, frames)?;
    // Of a sensor that reads from its far end the first line is the last one here.
    let late_s = READOUTS.iter().map(|i| (-bundle.camera.values[*i]).max(0.0)).sum();
    let path =
        bundle.starts_s.as_deref().map(|s| BoardPath::new(s, &bundle.poses)?.written(late_s)).transpose()?;
    Ok(BoardFit {
        camera: bundle.camera,
        half,
        rms_px: [pinhole_rms_px, rms(&bundle)?],
        view_rms_px: bundle.rms_px()?,
        one_camera: OneCamera::judge(&bundle, views)?,
        poses: bundle.poses,
        path,
    })
}

/// Half widths of the parameters' 95 % intervals.
///
/// # Errors
/// A camera that no points agree on: further off than the next point is, or with an interval that reaches down to
/// nothing.
fn check_known(bundle: &Bundle, free: &[usize], frames: &Path) -> Result<Vec<(&'static str, f64)>> {
    let refuse = |found: String| {
        let expected = "points of one board in sharp pictures from several sides";
        Err(Error::input(frames, None, found, expected))
    };
    let off_px = rms(bundle)?;
    let apart_px = next_px(&bundle.points);
    if !(off_px < 0.5 * apart_px) {
        return refuse(format!(
            "points that no camera and board explain: they are off by {off_px:.1} px rms, and the next one lies \
             {apart_px:.1} px away"
        ));
    }
    let places = bundle.places(LEAST_VIEWS)?;
    if places < LEAST_VIEWS {
        return refuse(format!(
            "{} of the board from {}, which differ by no more than what its points are off by ({off_px:.2} px rms)",
            counted(bundle.poses.len(), "picture", "pictures"),
            counted(places, "place", "places")
        ));
    }
    let deviations = bundle.deviations(free, bundle.spread_px()?)?;
    let deviations = deviations.filter(|all| all.iter().all(|d| d.is_finite()));
    let Some(deviations) = deviations else {
        return refuse("views that leave the camera open".to_owned());
    };
    let half: Vec<_> = free.iter().zip(&deviations).map(|(i, d)| (PARAMETERS[*i], 1.96 * d)).collect();
    // A lens or a readout may well be nothing; a focal length or a principal point is not.
    for ((name, half), i) in half.iter().zip(free).filter(|(_, i)| PINHOLE.contains(i)) {
        let value = bundle.camera.values[*i];
        if !(*half < value.abs()) {
            return refuse(format!(
                "views that leave the camera open: {name} {value:.0} +- {half:.0} px (95 %)"
            ));
        }
    }
    Ok(half)
}

/// How far the nearest other point of a view is from a point, px: the middle one of all.
fn next_px(points: &[Vec<Point>]) -> f64 {
    let nearest = |all: &Vec<Point>, p: &Point| {
        let others = all.iter().filter(|o| o.on_board_m != p.on_board_m);
        others.map(|o| (o.px - p.px).length()).fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = points.iter().flat_map(|v| v.iter().map(|p| nearest(v, p))).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 2).copied().unwrap_or(0.0)
}

fn check(target: &Target, views: &[View], frames: &Path) -> Result<()> {
    if views.len() < LEAST_VIEWS {
        let found = format!("the {} in {}", target.describe(), counted(views.len(), "picture", "pictures"));
        return Err(Error::input(frames, None, found, format!("it in at least {LEAST_VIEWS}")));
    }
    Ok(())
}

/// Root mean square distance of all points, px.
fn rms(bundle: &Bundle) -> Result<f64> {
    let all = bundle.residuals()?;
    let squares: f64 = all.iter().flatten().map(|d| d.length_squared()).sum();
    Ok((squares / (0.5 * bundle.residual_count() as f64)).sqrt())
}

/// The pinhole from which the fit with a lens ends lowest: through a wide lens the closed form may be far off.
fn best_start(points: &[Vec<Point>], size: [u32; 2], frames: &Path) -> Result<Option<Bundle>> {
    let flat = |p: &Vec<Point>| {
        let board: Vec<DVec2> = p.iter().map(|p| p.on_board_m.truncate()).collect();
        let px: Vec<DVec2> = p.iter().map(|p| p.px).collect();
        homography(&board, &px)
    };
    let homographies = points.iter().map(flat).collect::<Option<Vec<DMat3>>>();
    let Some(homographies) = homographies else {
        return Err(Error::input(
            frames,
            None,
            "a view whose points lie on a line",
            "points all over the board",
        ));
    };
    let closed = focal_lengths(&homographies, size);
    let others = START_FOCALS.map(|share| [share * f64::from(size[0].max(size[1])); 2]);
    let mut best: Option<(f64, Bundle)> = None;
    for focal_px in closed.into_iter().chain(others) {
        let camera = Camera::pinhole(size, focal_px);
        let k = camera.intrinsics();
        let Some(poses) = homographies.iter().map(|h| pose(h, &k)).collect::<Option<Vec<_>>>() else {
            continue;
        };
        let start = Bundle { camera, poses, points: points.to_vec(), starts_s: None };
        let mut trial = start.clone();
        trial.fit(PINHOLE, start.spread_px()?)?;
        let pinhole = trial.clone();
        trial.fit(LENSES[1], trial.spread_px()?)?;
        let spread_px = trial.spread_px()?;
        let is_camera = trial.fixes(LENSES[1], spread_px)? && spread_px.is_finite();
        if is_camera && best.as_ref().is_none_or(|b| spread_px < b.0) {
            best = Some((spread_px, pinhole));
        }
    }
    Ok(best.map(|b| b.1))
}

/// What candidates are judged by: the smallest spread that one of them leaves, px, and how many residuals count as one
/// there.
struct Judged {
    spread_px: f64,
    alike: f64,
}

impl Judged {
    fn by(bundle: &Bundle) -> Result<Self> {
        Ok(Self { spread_px: bundle.spread_px()?, alike: bundle.alike()? })
    }

    /// Schwarz's criterion, less what does not depend on the parameters.
    fn criterion(&self, bundle: &Bundle, free: usize) -> Result<f64> {
        let count = bundle.residual_count() as f64 / self.alike;
        Ok(bundle.cost(self.spread_px)? / self.alike + free as f64 * count.ln())
    }
}

/// The lens of as many coefficients as the points ask for.
fn with_lens(pinhole: &Bundle) -> Result<(Bundle, Vec<usize>)> {
    let mut tried: Vec<(Bundle, &[usize])> = vec![(pinhole.clone(), PINHOLE)];
    for free in LENSES {
        let mut next = tried[tried.len() - 1].0.clone();
        // What is wrong shrinks as coefficients come in, and with it what counts as a wrong point.
        for _ in 0..3 {
            next.fit(free, next.spread_px()?)?;
        }
        if !next.fixes(free, next.spread_px()?)? {
            break;
        }
        tried.push((next, free));
    }
    // All are judged by the errors that the fullest leaves.
    let judged = Judged::by(&tried[tried.len() - 1].0)?;
    let mut best: Option<(f64, Bundle, &[usize])> = None;
    for (bundle, free) in tried {
        let value = judged.criterion(&bundle, free.len())?;
        if best.as_ref().is_none_or(|b| value < b.0) {
            best = Some((value, bundle, free));
        }
    }
    let (_, bundle, free) = best.expect("the pinhole at least");
    Ok((bundle, free.to_vec()))
}

/// The same with the readout along rows or columns that the points ask for, if any.
fn with_readout(global: &Bundle, free: &[usize]) -> Result<(Bundle, Vec<usize>)> {
    let mut tried = vec![(global.clone(), free.to_vec())];
    for readout in READOUTS {
        let mut next = global.clone();
        let free: Vec<usize> = free.iter().copied().chain([readout]).collect();
        for _ in 0..3 {
            next.fit(&free, next.spread_px()?)?;
        }
        if next.fixes(&free, next.spread_px()?)? {
            tried.push((next, free));
        }
    }
    let mut judged = Judged::by(&tried[0].0)?;
    for (bundle, _) in &tried[1..] {
        let next = Judged::by(bundle)?;
        if next.spread_px < judged.spread_px {
            judged = next;
        }
    }
    let values = tried.iter().map(|(b, free)| judged.criterion(b, free.len())).collect::<Result<Vec<_>>>()?;
    let best = (0..tried.len()).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0);
    Ok(tried.swap_remove(best))
}

#[cfg(test)]
mod tests {
    use glam::{DQuat, DVec3};

    use super::super::target::Seen;
    use super::*;

    const SIZE: [u32; 2] = [640, 480];

    fn dice(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        // About normal: the sum of twelve.
        move || {
            let mut roll = || {
                state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                (state >> 40) as f64 / f64::from(1 << 24)
            };
            (0..12).map(|_| roll()).sum::<f64>() - 6.0
        }
    }

    /// Views of a tilted board whose points are off by `print_px` in all of them and by `own_px` in each, from places
    /// that are the further apart the larger `turn` is.
    fn views(seed: u64, [print_px, own_px]: [f64; 2], turn: f64) -> (Target, Vec<View>) {
        let target = Target::checkerboard([9, 6], [0.03, 0.03]);
        let mut camera = Camera::pinhole(SIZE, [500.0, 500.0]);
        (camera.values[4], camera.values[5]) = (-0.3, 0.1);
        let mut dice = dice(seed);
        let print: Vec<DVec2> = (0..54).map(|_| print_px * DVec2::new(dice(), dice())).collect();
        let view = |picture: usize| {
            let (a, b) = (2.1 * picture as f64, 0.7 * picture as f64);
            let [x, y] = [0.35 + 0.4 * turn * a.sin(), 0.2 + 0.4 * turn * a.cos()];
            let rotation = DQuat::from_euler(glam::EulerRot::XYZ, x, y, turn * b.sin());
            let middle = DVec3::new(0.12, 0.075, 0.0);
            let pose = Pose { rotation, translation_m: DVec3::new(0.0, 0.0, 0.45) - rotation * middle };
            let seen = |i: usize| {
                let point = [i % 9, i / 9];
                let px = camera.project(pose.transform(target.point_m(point))).expect("in front");
                Seen { point, px: px + print[i] + own_px * DVec2::new(dice(), dice()) }
            };
            View { picture, seen: (0..54).map(seen).collect() }
        };
        let views = (0..8).map(view).collect();
        (target, views)
    }

    fn fit((target, views): (Target, Vec<View>)) -> Result<BoardFit> {
        fit_board(&target, &views, SIZE, &Timing::Stills, Path::new("frames"))
    }

    /// What a print is off by is the same in every view: more views do not average it out.
    #[test]
    fn intervals_hold_of_a_board_that_is_off() {
        let mut held = 0;
        for seed in 0..30 {
            let turn = [0.1, 0.3, 1.0][seed as usize % 3];
            let fit = fit(views(seed, [0.3, 0.02], turn)).unwrap();
            let half = fit.half.iter().find(|h| h.0 == "fx").expect("free").1;
            held += usize::from((fit.camera.values[0] - 500.0).abs() < half);
        }
        // Expected of 95 %: 28.5. Fewer than 25 has a chance of 0.4 %.
        assert!(held >= 25, "{held} of 30");
        let half = |errors| fit(views(3, errors, 0.1)).unwrap().half[0].1;
        let [print, own] = [half([0.3, 0.0]), half([0.0, 0.3])];
        assert!(print > 1.5 * own, "control: what each view is off by averages out: {print} {own}");
    }

    #[test]
    fn pictures_from_one_place_are_refused() {
        let mut still = views(1, [0.2, 0.03], 0.0);
        let error = fit(still.clone()).unwrap_err().to_string();
        assert!(error.contains("8 pictures of the board from 1 place"), "{error}");
        // Control: with two other places they are enough.
        still.1.truncate(4);
        still.1.extend(views(1, [0.2, 0.03], 1.0).1.drain(2..5));
        assert!(fit(still).is_ok());
    }
}
