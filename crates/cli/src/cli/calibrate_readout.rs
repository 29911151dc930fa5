//! `shutterbug calibrate readout`.

use serde_json::json;

use super::args_calibrate::CalibrateReadout;
use super::terminal::{print, say};
use super::together::Together;
use shutterbug::camera::ScanOrder;
use shutterbug::capture::CameraFile;
use shutterbug::chain::Value;

use shutterbug::error::{Error, Result, counted, one_line};
use shutterbug::plane::Plane;
use shutterbug_diagnose::calibrate::readout::{FEWEST_LINES, NoReadout, Readout, Stripes, find_stripes};
use shutterbug_diagnose::calibrate::rest::{Rest, rest};

/// Longest readout that is thought possible where no camera says how long its frame takes: ten frames a second.
const LONGEST_READOUT_S: f64 = 0.1;
/// Said of two pictures that have nothing but the stripes in common.
const PERHAPS_MOVED: &str = "  WARNING: besides the stripes, nothing in the pictures shows whether the camera stood \
    still: lines of the scene (blinds, a fence) in front of a camera that moves look the same. Put something with \
    edges into the picture, which tells\n";
/// Most that encoded values of a black bar differ by, and the brightest that one is: black of video, and a compression.
const BAR_SPREAD: f32 = 3.0 / 255.0;
const BAR_DARK: f32 = 20.0 / 255.0;
/// Most other readouts that are named; the report has all.
const MOST_NAMED: usize = 5;

/// Readouts that make the same stripes, and the lamp that would tell them apart.
fn aliases_text(others_s: &[f64], longest_s: f64, lines: usize) -> String {
    if others_s.is_empty() {
        return String::new();
    }
    let named: Vec<String> = others_s.iter().take(MOST_NAMED).map(|s| format!("{:.3}", 1e3 * s)).collect();
    let more = if others_s.len() > MOST_NAMED { ", ..." } else { "" };
    format!(
        "  a lamp that blinks more than once in two lines makes the same stripes: {}{more} ms are possible as well, up \
         to {:.0} ms; this is the shortest. A lamp of less than {:.0} Hz leaves one\n",
        named.join(", "),
        1e3 * longest_s,
        0.5 * lines as f64 / longest_s
    )
}

/// Said of stripes that bend.
fn bent_text(readout: &Readout) -> String {
    let Some(at_ends) = readout.bent_at_ends else { return String::new() };
    format!(
        "  WARNING: the stripes bend: at the ends of the lines they lie {:.2} % {} than in the middle. A sensor's \
         lines are straight behind any lens, so the picture was bent afterwards (its lens was corrected, or it was \
         stabilized), and its lines are not the sensor's. The figures are those of the middle, which hold if it kept \
         its size: give the picture as the sensor delivered it\n",
        100.0 * (1.0 / (1.0 + at_ends) - 1.0).abs(),
        if at_ends < 0.0 { "further apart" } else { "closer" }
    )
}

/// Said of a second wave along the lines.
fn second_text(readout: &Readout, pictures: usize) -> String {
    let Some(second) = &readout.second else { return String::new() };
    let perhaps = match pictures {
        1 => "Another lamp lights the surface, or lines are printed on it",
        _ => "Another lamp lights the surface, or the pictures were not read out alike",
    };
    format!(
        "  WARNING: the lines show other stripes besides, {:.2} lines from one to the next and {:.1} % deep, which are \
         a readout of {:.3} ms if they are this light's. {perhaps}: the figures are those of the deepest stripes, and \
         hold if these are the light's\n",
        second.period_lines,
        100.0 * second.depth,
        1e3 * second.readout_time_s
    )
}

/// A frame takes no longer than its period.
fn check_longest(args: &CalibrateReadout, readout: &Readout, longest_s: f64) -> Result<()> {
    if readout.ci95_s[0] <= longest_s {
        return Ok(());
    }
    let found = format!(
        "stripes that take {:.3} ms from the first line to the last under a light of {} Hz",
        1e3 * readout.readout_time_s,
        args.led_hz
    );
    let whose = match &args.common.camera {
        Some(path) => format!("a frame takes in {} (frame_period_s)", path.display()),
        None => "frames take, if no --camera has another frame_period_s".to_owned(),
    };
    let expected = format!("at most the {:.3} ms that {whose}: is --led-hz right?", 1e3 * longest_s);
    Err(Error::input(&args.photos[0], None, found, expected))
}

/// Whether pictures that are compared show that the camera stood still; an error where it did not.
fn check_rest(args: &CalibrateReadout, photographs: &[Plane<f32>], readout: &Readout) -> Result<bool> {
    let mut at_rest = true;
    for (k, pair) in photographs.chunks_exact(2).enumerate() {
        match rest([&pair[0], &pair[1]], args.common.encoding.into(), readout.lines_are_rows) {
            Rest::Still => {}
            Rest::Unknown => at_rest = false,
            Rest::Moved([x, y]) => {
                let [first, second] = [&args.photos[2 * k], &args.photos[2 * k + 1]];
                let found = format!("the scene of {} moved by {x}, {y} px", first.display());
                let expected = "a camera at rest: stripes of the scene that move are no light's";
                return Err(Error::input(second, None, found, expected));
            }
        }
    }
    Ok(at_rest)
}

/// Pictures in which no stripes could be seen.
fn check_light(args: &CalibrateReadout, photographs: &[Plane<f32>]) -> Result<()> {
    for (path, picture) in args.photos.iter().zip(photographs) {
        let size = [picture.width, picture.height];
        if size.iter().all(|n| *n < FEWEST_LINES) {
            let found = format!("a picture of {}x{} px", size[0], size[1]);
            return Err(Error::input(path, None, found, format!("at least {FEWEST_LINES} lines")));
        }
        for (value, name) in [(0.0, "black"), (1.0, "white")] {
            if picture.data.iter().all(|v| *v == value) {
                let found = format!("nothing but {name}");
                return Err(Error::input(
                    path,
                    None,
                    found,
                    "a surface that the light falls on, not cut off",
                ));
            }
        }
    }
    Ok(())
}

/// Bars beside the picture, as a player or an editor draws them: lines at a side that are of one dark value in all
/// pictures, and no line further in is. They are no lines of the sensor.
fn check_bars(args: &CalibrateReadout, photographs: &[Plane<f32>]) -> Result<()> {
    for (rows, sides) in [(true, ["at the top", "at the bottom"]), (false, ["on the left", "on the right"])] {
        let is_bar = |i: usize| photographs.iter().all(|p| is_of_one_dark_value(p, i, rows));
        let count = photographs.first().map_or(0, |p| if rows { p.height } else { p.width });
        let bars = [
            (0..count).take_while(|i| is_bar(*i)).count(),
            (0..count).rev().take_while(|i| is_bar(*i)).count(),
        ];
        if bars == [0; 2] || (bars[0]..count - bars[1]).any(is_bar) {
            continue;
        }
        let lines = if rows { "rows" } else { "columns" };
        let seen =
            sides.iter().zip(bars).filter(|(_, n)| *n > 0).map(|(side, n)| format!("{n} {lines} {side}"));
        let found = format!("a black bar: {}", seen.collect::<Vec<_>>().join(", "));
        return Err(Error::input(&args.photos[0], None, found, "all lines of the sensor and no others"));
    }
    Ok(())
}

/// Whether all values of a line are one, but for what a compression makes of it, and near black.
fn is_of_one_dark_value(picture: &Plane<f32>, line: usize, is_row: bool) -> bool {
    let across = if is_row { picture.width } else { picture.height };
    let values = (0..across)
        .flat_map(|i| if is_row { picture.pixel(i, line) } else { picture.pixel(line, i) })
        .fold([f32::INFINITY, f32::NEG_INFINITY], |[low, high], v| [low.min(*v), high.max(*v)]);
    values[1] - values[0] <= BAR_SPREAD && values[1] <= BAR_DARK
}

/// What was seen where there are no stripes.
fn no_stripes(found: &Stripes) -> String {
    let [rows, columns] = [0, 1].map(|i| format!("{:.1} of {:.1}", found.strongest[i], found.threshold[i]));
    let why = match found.no_readout {
        Some(NoReadout::NotOneWave) => {
            "something repeats or steps, but it is not one wave over whole lines: lamps of different phases, light on \
             a part of the surface, a picture that was turned or cut, or content. Nothing is known of the shutter: \
             give a picture of an evenly lit surface as the sensor delivered it"
        }
        Some(NoReadout::SameInEach) => {
            "each picture alone has them, at the same places in both: lines that are printed, or the light came to the \
             same phase. Nothing is known of the shutter: take the second picture at another moment"
        }
        Some(NoReadout::NothingRepeats) | None => {
            "a global shutter, an exposure of whole periods of the light, or fewer than three stripes; try another \
             frequency or a shorter exposure"
        }
    };
    format!("no stripes (strongest line of the spectrum along rows {rows}, along columns {columns}): {why}\n")
}

/// Pictures are compared two by two.
fn check_count(args: &CalibrateReadout) -> Result<()> {
    if args.photos.len() > 1 && args.photos.len() % 2 == 1 {
        let found = counted(args.photos.len(), "picture", "pictures");
        let expected = "one, or an even number, which are compared two by two";
        return Err(Error::input(&args.photos[0], None, found, expected));
    }
    Ok(())
}

/// Which line is read first, as the given camera has it where its lines are these, and why it is that one.
fn order_of(camera: Option<&CameraFile>, rows: bool) -> (ScanOrder, &'static str) {
    let given = camera
        .and_then(|c| c.settings.choice("rolling_shutter", "scan_order"))
        .and_then(ScanOrder::from_name);
    match given.filter(|order| order.lines_are_rows() == rows) {
        Some(order) => (order, "as --camera has it"),
        None if rows => (ScanOrder::TopToBottom, "as most sensors do"),
        None => (ScanOrder::LeftToRight, "which may as well be right_to_left"),
    }
}

/// `calibrate readout`.
pub fn readout(args: &CalibrateReadout) -> Result<()> {
    check_count(args)?;
    let out = args.common.open("calibrate readout", &args.photos)?;
    let (mut photographs, mut together) = (Vec::new(), Together::default());
    together.each(&args.photos, |f| photographs.push(f.encoded.clone()))?;
    check_light(args, &photographs)?;
    let found = find_stripes(&photographs, args.common.encoding.into(), args.led_hz);
    let size = together.size.unwrap_or_default();
    let own = args.common.own_camera(size, &args.photos[0])?;
    let longest_s = own.as_ref().map_or(LONGEST_READOUT_S, |camera| camera.frame_period_s);
    let mut at_rest = true;
    if let Some(readout) = &found.readout {
        check_bars(args, &photographs)?;
        check_longest(args, readout, longest_s)?;
        at_rest = check_rest(args, &photographs, readout)?;
    }
    out.start()?;
    let others_s = found.readout.as_ref().map_or_else(Vec::new, |r| r.aliases_s(args.led_hz, longest_s));
    let report = json!({
        "led_hz": args.led_hz, "stripes": found, "other_readouts_s": others_s, "longest_readout_s": longest_s,
    });
    let Some(r) = &found.readout else {
        args.common.write(own, size, &report, &[])?;
        return print(no_stripes(&found));
    };
    let (order, why) = order_of(own.as_ref(), r.lines_are_rows);
    let values = vec![
        ("readout_time_s", Value::Number(r.readout_time_s)),
        ("scan_order", Value::Choice(order.name())),
    ];
    args.common.write(own, size, &report, &[("rolling_shutter", values)])?;
    let (lines, first) =
        if r.lines_are_rows { ("rows", "top or bottom") } else { ("columns", "left or right") };
    let alone = if args.photos.len() == 1 {
        "  one picture does not tell the light's stripes from lines that are printed across all of it: a second one of \
         the same place does\n"
    } else if at_rest {
        ""
    } else {
        PERHAPS_MOVED
    };
    let (bent, second) = (bent_text(r), second_text(r, args.photos.len()));
    let others = aliases_text(&others_s, longest_s, r.lines);
    print(format!(
        "stripes along {lines}, {:.2} lines from one to the next, {:.1} % deep\n  \
         delay from line to line {:.3} us, readout of {} lines {:.3} ms [{:.3}, {:.3}]\n  \
         stripes do not tell whether {first} is read first; camera.toml has {}, {why}\n{second}{bent}{alone}{others}",
        r.period_lines,
        100.0 * r.depth,
        1e6 * r.line_delay_s,
        r.lines,
        1e3 * r.readout_time_s,
        1e3 * r.ci95_s[0],
        1e3 * r.ci95_s[1],
        order.name()
    ))?;
    say(one_line(&format!("{} written", args.common.out.join("camera.toml").display())));
    Ok(())
}
