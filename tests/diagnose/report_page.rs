//! `report.html`: one file, offline, valid, small enough, and nothing in it runs that a stranger wrote.

use std::path::Path;

use crate::report_support::page::Page;
use crate::report_support::{SIZE, sample};
use shutterbug_diagnose::diagnose::{Report, Verdict};
use shutterbug_diagnose::report::{PAGE_FILE, render_html, write_html};

const HOSTILE: &str = "</script><script>alert(1)</script><img src=x onerror='alert(2)'>\"{{ 7*7 }}&amp;";

/// The page with its pictures' bytes taken out: what a person wrote.
fn without_pictures(html: &str) -> String {
    html.split('"').filter(|part| !part.starts_with("data:image/")).collect::<Vec<_>>().join("\"")
}

fn page_of(report: &Report, folder: &Path) -> (String, Page) {
    let html = render_html(report, folder).unwrap_or_else(|e| panic!("{e}"));
    let page = Page::parse(&html);
    (html, page)
}

#[test]
fn a_page_of_twenty_frames_is_one_valid_file_without_links() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = sample(folder.path(), 20, "desk");
    std::fs::write(folder.path().join("camera.toml"), "width = 320\n[rolling_shutter]\n").expect("written");
    write_html(&report, folder.path()).unwrap_or_else(|e| panic!("{e}"));
    let html = std::fs::read_to_string(folder.path().join(PAGE_FILE)).expect("written");
    // Pictures of noise hardly compress: 20 frames of 320x240 as they are come to less than 17 MB as PNG in base64.
    assert!(html.len() < 17 << 20, "{} bytes", html.len());
    let page = Page::parse(&html);
    assert!(page.errors().is_empty(), "{:?}", page.errors());
    // Control: the parser does object to what is wrong.
    assert!(!Page::parse(&html.replace("</main>", "</man>")).errors().is_empty());
    for link in ["http:", "https:", "//cdn", "<link", "@import", "url(h", "file:"] {
        assert!(!without_pictures(&html).contains(link), "{link}");
    }
    for element in page.all("[src]").into_iter().chain(page.all("[href]")) {
        let to = element.attribute("src").or(element.attribute("href")).unwrap_or_default();
        assert!(to.starts_with("data:image/"), "{}", &to[..to.len().min(60)]);
    }
    let pictures = "three pictures, two differences, four maps, three with percepts, two of the description";
    assert_eq!(page.count("img"), 14, "{pictures}");
    assert_eq!(page.count("#description svg"), 2, "error of rotation and position over time");
    assert!(page.all("img").iter().all(|i| i.attribute("alt").is_some()));
    assert_eq!(page.count("#where svg"), 10, "one chart a profile");
    assert_eq!(page.count("#waterfall rect"), 5);
    assert_eq!(page.count("#percepts tbody tr"), 3);
    for text in
        ["98.3 %", "0.020135", "0.0199 to 0.0203", "top_to_bottom", "two exposures", "[rolling_shutter]"]
    {
        assert!(html.contains(text), "{text} is missing");
    }
    let json = page.all("#data")[0].text();
    let frames: Vec<serde_json::Value> = serde_json::from_str(&json).expect("JSON");
    assert_eq!(frames.len(), 20);
    assert_eq!(
        frames[0]["percepts"]["simulated"][1],
        "M20.5 30.5h0M5 6L70 80M93.0 50a7 7 0 1 0 14.0 0a7 7 0 1 0 -14.0 0"
    );
    assert_eq!(frames[0]["percepts"]["simulated"][0], "", "none of them agrees");
    let kept = std::env::var_os("KEEP_REPORT_PAGE");
    if let Some(path) = kept {
        std::fs::write(path, html).expect("written");
    }
}

#[test]
fn hostile_names_are_text() {
    let folder = tempfile::tempdir().expect("a folder");
    let (plain, plain_page) = page_of(&sample(folder.path(), 2, "desk"), folder.path());
    let (html, page) = page_of(&sample(folder.path(), 2, HOSTILE), folder.path());
    assert!(page.errors().is_empty(), "{:?}", page.errors());
    for selector in ["script", "img", "[onerror]", "section", "tr", "figure"] {
        assert_eq!(page.count(selector), plain_page.count(selector), "{selector}");
    }
    assert!(!html.contains("alert(1)</script>") && !html.contains(">49"), "a name was run");
    // The name is on the page in full, as text.
    assert!(page.all("#input td").iter().any(|c| c.text() == format!("captures/{HOSTILE}")));
    let json = page.all("#data")[0].text();
    let frames: Vec<serde_json::Value> = serde_json::from_str(&json).expect("JSON");
    assert!(frames[0]["about"].as_str().expect("text").starts_with(HOSTILE));
    // Control: without escaping the same name adds elements.
    let broken = plain.replace("desk</td>", &format!("{HOSTILE}</td>"));
    assert_ne!(Page::parse(&broken).count("script"), plain_page.count("script"));
}

#[test]
fn a_report_with_nothing_in_it_is_a_page_too() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut report = sample(folder.path(), 1, "desk");
    report.verdict = Verdict::UnknownEffect;
    report.frames.clear();
    report.effects.clear();
    report.candidates.clear();
    report.waterfall.clear();
    report.maps = Default::default();
    report.description = Default::default();
    report.places = Default::default();
    report.gap.before = f64::NAN;
    let (html, page) = page_of(&report, folder.path());
    assert!(page.errors().is_empty(), "{:?}", page.errors());
    assert_eq!((page.count("img"), page.count("script")), (0, 0));
    assert!(html.contains("Unknown effect") && !html.contains("NaN"));
}

#[test]
fn effects_that_do_the_same_together_are_named_with_their_parameters() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut report = sample(folder.path(), 1, "desk");
    let one = |name: &str, key: &str, value| (name.to_owned(), [(key.to_owned(), value)].into());
    let gain = one("exposure_gain", "gain", 0.803);
    report.effects[0].same_together = [gain, one("black_level", "offset", 0.0316)].into();
    report.effects[0].footage = "frames with the lens capped".to_owned();
    let (_, page) = page_of(&report, folder.path());
    assert!(page.errors().is_empty(), "{:?}", page.errors());
    let notes: Vec<String> = page.all("#effects p").iter().map(|p| p.text()).collect();
    let said = "from black level (offset 0.0316) with exposure gain (gain 0.803), film: frames with the lens capped.";
    assert!(notes.iter().any(|note| note.contains(said)), "{notes:?}");
    assert!(page.all("#effects small").iter().any(|s| s.text() == "or black level with exposure gain"));
}

#[test]
fn a_gap_below_the_floor_leaves_nothing_unexplained() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut report = sample(folder.path(), 2, "desk");
    assert!(page_of(&report, folder.path()).0.contains(">unexplained</text>"), "control: above the floor");
    report.waterfall.iter_mut().filter(|s| s.name == "unexplained").for_each(|s| s.to = 1.38);
    report.gap.held_out_frames = 1;
    let (html, page) = page_of(&report, folder.path());
    assert!(html.contains(">below the floor</text>") && !html.contains(">unexplained</text>"));
    let kinds: Vec<_> = page.all("#waterfall rect").iter().filter_map(|e| e.attribute("class")).collect();
    assert_eq!(kinds, ["total", "closed", "closed", "below", "total"]);
    assert!(html.contains(">held-out frame</span> that no fit"), "one frame is no frames");
}

#[test]
fn a_report_comes_back_as_it_was_written_with_figures_that_are_not_finite() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut report = sample(folder.path(), 2, "desk");
    report.measures.iter_mut().for_each(|m| m.after = 1.0 / 3.0);
    report.gap.closed_fraction = 0.1 + 0.2;
    let back = Report::from_json(folder.path(), &report.to_json()).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(back, report, "every digit");
    let absent = report.to_json().matches("null").count();
    report.gap.before = f64::NAN;
    report.gap.after_ci95 = [0.5, f64::INFINITY];
    report.measures[1].before = f64::NEG_INFINITY;
    report.places.by_row[3].bias_after = f64::NAN;
    report.frames[1].after = f64::NAN;
    report.bootstrap.closed_fraction = vec![0.1, f64::NAN];
    report.effects[0].gain_ci95 = [f64::NAN; 2];
    report.percepts.kinds[0].matched_floor = f64::NAN;
    let text = report.to_json();
    assert_eq!(text.matches("null").count(), absent + 9, "nine made here");
    let back = Report::from_json(folder.path(), &text).unwrap_or_else(|e| panic!("{e}"));
    assert!(back.gap.before.is_nan() && back.gap.after_ci95[1].is_nan() && back.measures[1].before.is_nan());
    assert!(back.places.by_row[3].bias_after.is_nan() && back.frames[1].after.is_nan());
    assert!(back.bootstrap.closed_fraction[1].is_nan() && back.effects[0].gain_ci95[1].is_nan());
    assert!(back.percepts.kinds[0].matched_floor.is_nan());
    assert_eq!(back.gap.after_ci95[0], 0.5, "its neighbours stay");
    assert_eq!(back.to_json(), text, "and once more");
    let (html, page) = page_of(&back, folder.path());
    assert!(page.errors().is_empty() && !without_pictures(&html).contains("NaN"), "{:?}", page.errors());
    // Control: what is missing, or a word, is no figure.
    for broken in [
        text.replacen("\"floor\":", "\"flour\":", 1),
        text.replacen("\"floor\": 1.2", "\"floor\": \"1.2\"", 1),
    ] {
        let error = Report::from_json(folder.path(), &broken).expect_err("no report").to_string();
        assert!(error.contains("line") || error.contains(':'), "{error}");
    }
}

#[test]
fn a_picture_that_is_missing_is_an_error_that_names_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let report = sample(folder.path(), 2, "desk");
    std::fs::remove_file(folder.path().join("frames/d1.png")).expect("was there");
    let error = write_html(&report, folder.path()).expect_err("a picture is missing").to_string();
    assert!(error.contains("d1.png"), "{error}");
    assert!(!folder.path().join(PAGE_FILE).exists(), "nothing half-written");
}

#[test]
fn long_captures_show_some_frames_and_say_so() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut report = sample(folder.path(), 2, "desk");
    let frame = report.frames[1].clone();
    report.frames = vec![frame; 1000];
    let (html, _) = page_of(&report, folder.path());
    assert!(html.contains("60 of 1000 frames are on this page"));
    assert!(html.contains(&format!("width=\"{}\"", SIZE.0)));
}
