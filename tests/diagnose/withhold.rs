//! `withhold` with a diagnosis that is played by a script: what it is given, when answers are opened, how it is scored.
#![cfg(unix)]

use std::fs;
use std::os::unix::fs::PermissionsExt as _;
use std::path::Path;

use crate::report_support::page::Page;
use sha2::{Digest as _, Sha256};
use shutterbug_diagnose::diagnose::{Report, Verdict};
use shutterbug_diagnose::withhold::{
    CaseScore, CurveOptions, Kind, ParameterScore, Summary, Tally, WithholdOptions, curves, withhold,
};

/// Cases up to here hold every kind (see `PATTERN` in `withhold/hidden.rs`).
const CASES: usize = 7;

/// A program that notes how it was called and what lies beside the capture, and answers with the same report always.
fn player(folder: &Path, edit: impl Fn(&mut Report)) -> std::path::PathBuf {
    let mut report = crate::report_support::sample(folder, 1, "desk");
    // What is not finite is null in JSON, and no report.
    report.measures.clear();
    edit(&mut report);
    fs::write(folder.join("answer.json"), report.to_json()).expect("written");
    let program = folder.join("player.sh");
    let at = folder.display();
    let script = format!(
        "#!/bin/sh\necho \"CALL $*\" >> {at}/log\nfind \"$2/..\" -type f | sed 's/^/FILE /' >> {at}/log\n\
         mkdir -p \"$4\"\ncp {at}/answer.json \"$4/report.json\"\n"
    );
    fs::write(&program, script).expect("written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("set");
    program
}

fn options(folder: &Path, program: &Path) -> WithholdOptions {
    WithholdOptions {
        falsified: Vec::new(),
        out: folder.join("out"),
        count: CASES,
        seed: 5,
        size_px: [64, 48],
        frames: Some(2),
        recordings: Vec::new(),
        program: program.to_owned(),
        device: None,
        keep_frames: false,
        only: Vec::new(),
        form: shutterbug_diagnose::withhold::Form::Capture,
    }
}

#[test]
fn answers_are_sealed_before_and_on_disk_only_after_the_diagnosis() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = player(folder.path(), |_| ());
    let options = options(folder.path(), &program);
    let mut said = Vec::new();
    let result = withhold(&options, &mut |line| said.push(line.to_owned()), &|| false)
        .unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(result.cases.len(), CASES);
    let seals = fs::read_to_string(options.out.join("seals.txt")).expect("written");
    let log = fs::read_to_string(folder.path().join("log")).expect("written");
    for (case, seal) in seals.lines().enumerate() {
        let answer = fs::read(options.out.join(format!("case-{case:03}/answer.json"))).expect("opened");
        let hash: String = Sha256::digest(&answer).iter().map(|b| format!("{b:02x}")).collect();
        assert!(seal.starts_with(&hash), "case {case}");
        assert!(said.iter().any(|line| line.contains(&hash)), "case {case}: the seal was not printed");
    }
    // Each case's first call is the blind one.
    let calls: Vec<&str> = log.split("CALL ").skip(1).collect();
    let blind = |c: &&&str| {
        c.lines().next().is_some_and(|l| l.ends_with("diagnosis") || l.contains("diagnosis --without"))
    };
    let blind: Vec<_> = calls.iter().filter(blind).collect();
    assert_eq!(blind.len(), CASES);
    for (call, score) in blind.iter().zip(&result.cases) {
        let (line, files) = call.split_once('\n').expect("files follow");
        assert!(!files.contains("answer") && !files.contains("true-camera"), "{files}");
        assert!(files.contains("trajectory.tum") && files.contains("real/000001.png"), "{files}");
        let left_out = score.kind == Kind::LeftOut;
        assert_eq!(line.contains("--without"), left_out, "{line}");
        assert!(!line.contains("--camera"), "{line}");
    }
    // Control: the listing does show answers where they lie. The true camera is scored after opening.
    let opened = calls.iter().find(|c| c.contains("--camera")).expect("a case with hidden effects");
    assert!(opened.contains("answer.json") && opened.contains("true-camera.toml"), "{opened}");
}

#[test]
fn a_run_goes_on_where_it_stopped_and_scores_by_the_answers() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = player(folder.path(), |report| report.effects.truncate(1));
    let mut options = options(folder.path(), &program);
    let stopping = std::cell::Cell::new(0);
    let stop = || {
        stopping.set(stopping.get() + 1);
        stopping.get() > 8
    };
    let error = withhold(&options, &mut |_| (), &stop).expect_err("stopped").to_string();
    assert!(error.contains("interrupted"), "{error}");
    let done =
        |out: &Path| (0..CASES).filter(|c| out.join(format!("case-{c:03}/score.json")).exists()).count();
    let before = done(&options.out);
    assert!((1..CASES).contains(&before), "{before} cases before the stop");
    let result = withhold(&options, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
    let calls = || fs::read_to_string(folder.path().join("log")).expect("written").matches("CALL").count();
    let after = calls();
    let again = withhold(&options, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(calls(), after, "cases that are done are not diagnosed again");
    assert_eq!(serde_json::to_string(&again).expect("data"), serde_json::to_string(&result).expect("data"));
    // The player says "rolling_shutter" always: right just where that is what was hidden, and alone.
    for score in &result.cases {
        let right = score.hidden == ["rolling_shutter"] && score.kind == Kind::Single;
        assert_eq!(score.exact, right, "{score:?}");
        assert_eq!(score.found, ["rolling_shutter"]);
    }
    assert_eq!(result.summary.false_alarms, Tally { right: 1, of: 1 });
    assert_eq!(result.summary.unknown_said, Tally { right: 0, of: 1 });
    let html = fs::read_to_string(options.out.join("withhold.html")).expect("written");
    let page = Page::parse(&html);
    assert!(page.errors().is_empty(), "{:?}", page.errors());
    assert!(!html.contains("http://") && !html.contains("https://"), "the page is one offline file");
    assert_eq!(html.matches("data:image/png").count(), CASES);
    options.seed += 1;
    let error = withhold(&options, &mut |_| (), &|| false).expect_err("another seed").to_string();
    assert!(error.contains("options.json"), "{error}");
}

#[test]
fn some_of_the_cases_are_the_same_as_among_all() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = player(folder.path(), |_| ());
    let whole = WithholdOptions { count: 3, ..options(folder.path(), &program) };
    let some = WithholdOptions { out: folder.path().join("some"), only: vec![2], ..whole.clone() };
    let seals = |options: &WithholdOptions| -> Vec<String> {
        withhold(options, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
        let text = fs::read_to_string(options.out.join("seals.txt")).expect("written");
        text.lines().map(str::to_owned).collect()
    };
    let [whole, some] = [&whole, &some].map(seals);
    assert_eq!((whole.len(), some.len()), (3, 1));
    assert_eq!(some[0], whole[2]);
    assert_ne!(some[0], whole[1], "control");
}

#[test]
fn a_diagnosis_that_fails_is_an_error_and_no_wrong_answer() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = folder.path().join("fails.sh");
    fs::write(&program, "#!/bin/sh\necho 'shutterbug: error: no device' >&2\nexit 1\n").expect("written");
    fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).expect("set");
    let options = WithholdOptions { count: 1, ..options(folder.path(), &program) };
    let error = withhold(&options, &mut |_| (), &|| false).expect_err("failed").to_string();
    assert!(error.contains("no device") && error.contains("exit status: 1"), "{error}");
    assert!(!options.out.join("case-000/score.json").exists(), "the case is not done");
    // With the cause mended the same run goes on.
    let mended = WithholdOptions { program: player(folder.path(), |_| ()), ..options };
    let result = withhold(&mended, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((result.cases.len(), result.summary.failed), (1, 0));
}

#[test]
fn unknown_effect_is_right_where_the_effect_was_left_out() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = player(folder.path(), |report| {
        report.effects.clear();
        report.verdict = Verdict::UnknownEffect;
    });
    let result = withhold(&options(folder.path(), &program), &mut |_| (), &|| false);
    let result = result.unwrap_or_else(|e| panic!("{e}"));
    for score in &result.cases {
        let right = score.kind == Kind::LeftOut;
        assert_eq!(score.first_right, right, "{score:?}");
    }
    assert_eq!(result.summary.unknown_said, Tally { right: 1, of: 1 });
    assert_eq!(result.summary.false_alarms, Tally { right: 0, of: 1 });
}

#[test]
fn curves_count_what_was_named_at_each_strength_and_go_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let program = player(folder.path(), |report| report.effects.truncate(1));
    let options = options(folder.path(), &program);
    let curve = CurveOptions {
        effects: vec!["rolling_shutter".to_owned(), "gamma".to_owned()],
        points: 2,
        repeats: 2,
    };
    let typo = CurveOptions { effects: vec!["gama".to_owned()], ..curve.clone() };
    let error = curves(&options, &typo, &mut |_| (), &|| false).expect_err("no such effect").to_string();
    assert!(error.contains("gama") && error.contains("gamma"), "{error}");
    let stopping = std::cell::Cell::new(0);
    let stop = || {
        stopping.set(stopping.get() + 1);
        stopping.get() > 9
    };
    let error = curves(&options, &curve, &mut |_| (), &stop).expect_err("stopped").to_string();
    assert!(error.contains("interrupted"), "{error}");
    let calls = || fs::read_to_string(folder.path().join("log")).expect("written").matches("CALL").count();
    let before = calls();
    assert!((1..8).contains(&before), "{before} captures before the stop");
    let result = curves(&options, &curve, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
    assert!((8..=9).contains(&calls()), "at most the one that was stopped is diagnosed again: {}", calls());
    let again = curves(&options, &curve, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
    assert!(calls() <= 9 && again.curves == result.curves);
    // The player says "rolling_shutter" always.
    let rates: Vec<_> =
        result.curves.iter().map(|c| (c.effect.as_str(), c.points[0].rate, c.points[1].rate)).collect();
    assert_eq!(rates, [("rolling_shutter", 1.0, 1.0), ("gamma", 0.0, 0.0)]);
    assert!(result.curves.iter().all(|c| c.half_detected.is_none() && c.points.iter().all(|p| p.cases == 2)));
    let html = fs::read_to_string(options.out.join("curves.html")).expect("written");
    let page = Page::parse(&html);
    assert!(page.errors().is_empty(), "{:?}", page.errors());
    assert!(!html.contains("http://") && !html.contains("https://") && html.contains("data:image/png"));
    // More strengths later: what is there stays.
    let more = CurveOptions { effects: vec!["gamma".to_owned()], points: 3, repeats: 1 };
    let wider = curves(&options, &more, &mut |_| (), &|| false).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!((wider.curves[0].points.len(), wider.cases.len()), (3, 3));
    assert!(calls() <= 10);
    // Each blind: no answer lies beside the capture.
    let log = fs::read_to_string(folder.path().join("log")).expect("written");
    assert!(!log.contains("answer") || log.matches("answer.json").count() == 0, "{log}");
}

fn case(kind: Kind, hidden: &[&str], found: &[&str]) -> CaseScore {
    let names = |list: &[&str]| list.iter().map(|s| (*s).to_owned()).collect::<Vec<_>>();
    CaseScore {
        case: 0,
        kind,
        motion: "hand".to_owned(),
        hidden: names(hidden),
        described: Vec::new(),
        falsified: Vec::new(),
        found: names(found),
        verdict: "explained".to_owned(),
        sentence: String::new(),
        first_right: found.first().is_some_and(|f| hidden.contains(f)),
        exact: hidden == found,
        exact_or_alike: hidden == found,
        gap: [3.0, 1.0, 1.0],
        closed: 0.9,
        closed_by_truth: Some(1.0),
        parameters: Vec::new(),
        seconds: 10.0,
    }
}

#[test]
fn the_table_counts_what_it_says() {
    let parameter = |relative_error, covered| ParameterScore {
        name: "defocus.sigma_px".to_owned(),
        truth: 1.0,
        value: 1.0 + relative_error,
        relative_error,
        covered: Some(covered),
        half_width: None,
    };
    let mut cases = vec![
        case(Kind::Single, &["defocus"], &["defocus"]),
        case(Kind::Single, &["defocus"], &["motion_blur", "defocus"]),
        case(Kind::Several, &["defocus", "gamma"], &["gamma"]),
        case(Kind::None, &[], &[]),
    ];
    cases[0].parameters = vec![parameter(0.01, true), parameter(0.03, true), parameter(0.5, false)];
    let s = Summary::of(&cases);
    assert_eq!(s.first_named["single"], Tally { right: 1, of: 2 });
    assert_eq!(s.exact_set["single"], Tally { right: 1, of: 2 });
    assert_eq!(s.exact_set["several"], Tally { right: 0, of: 1 });
    assert_eq!(s.found["defocus"], Tally { right: 2, of: 3 });
    assert_eq!(s.named_wrongly["motion_blur"], 1);
    assert_eq!(s.coverage, Tally { right: 2, of: 3 });
    assert_eq!(s.median_error["defocus.sigma_px"], (0.03, 3));
    assert_eq!(s.false_alarms, Tally { right: 0, of: 1 });
    assert_eq!(s.confusion["defocus"]["motion_blur"], 1);
    assert_eq!(s.found_by_gap["02.0 to 04.0 DN"], Tally { right: 2, of: 2 });
    assert_eq!(s.closed_to_truth_median, Some(0.9));
}
