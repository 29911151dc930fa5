//! `report.html`: one file, offline, valid, small enough, and nothing in it runs that a stranger wrote.

mod report_support;

use std::path::Path;

use report_support::{SIZE, sample};
use scraper::{Html, Selector};
use shutterbug::diagnose::{Report, Verdict};
use shutterbug::report::{PAGE_FILE, render_html, write_html};

const HOSTILE: &str = "</script><script>alert(1)</script><img src=x onerror='alert(2)'>\"{{ 7*7 }}&amp;";

fn count(page: &Html, selector: &str) -> usize {
    page.select(&Selector::parse(selector).expect("a selector")).count()
}

/// The page with its pictures' bytes taken out: what a person wrote.
fn without_pictures(html: &str) -> String {
    html.split('"').filter(|part| !part.starts_with("data:image/")).collect::<Vec<_>>().join("\"")
}

fn page_of(report: &Report, folder: &Path) -> (String, Html) {
    let html = render_html(report, folder).unwrap_or_else(|e| panic!("{e}"));
    let page = Html::parse_document(&html);
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
    let page = Html::parse_document(&html);
    assert!(page.errors.is_empty(), "{:?}", page.errors);
    // Control: the parser does object to what is wrong.
    assert!(!Html::parse_document(&html.replace("</main>", "</man>")).errors.is_empty());
    for link in ["http:", "https:", "//cdn", "<link", "@import", "url(h", "file:"] {
        assert!(!without_pictures(&html).contains(link), "{link}");
    }
    let sources = Selector::parse("[src], [href]").expect("a selector");
    for element in page.select(&sources) {
        let to = element.value().attr("src").or(element.value().attr("href")).unwrap_or_default();
        assert!(to.starts_with("data:image/"), "{}", &to[..to.len().min(60)]);
    }
    assert_eq!(count(&page, "img"), 9, "three pictures, two differences, four maps");
    assert_eq!(count(&page, "img:not([alt])"), 0);
    assert_eq!(count(&page, "#where svg"), 10, "one chart a profile");
    assert_eq!(count(&page, "#waterfall rect"), 5);
    for text in
        ["98.3 %", "0.020135", "0.0199 to 0.0203", "top_to_bottom", "two exposures", "[rolling_shutter]"]
    {
        assert!(html.contains(text), "{text} is missing");
    }
    let json =
        page.select(&Selector::parse("#data").expect("a selector")).next().expect("there").inner_html();
    let frames: Vec<serde_json::Value> = serde_json::from_str(&json).expect("JSON");
    assert_eq!(frames.len(), 20);
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
    assert!(page.errors.is_empty(), "{:?}", page.errors);
    for selector in ["script", "img", "[onerror]", "section", "tr", "figure"] {
        assert_eq!(count(&page, selector), count(&plain_page, selector), "{selector}");
    }
    assert!(!html.contains("alert(1)</script>") && !html.contains(">49"), "a name was run");
    // The name is on the page in full, as text.
    let cell = Selector::parse("#input td").expect("a selector");
    assert!(page.select(&cell).any(|c| c.text().collect::<String>() == format!("captures/{HOSTILE}")));
    let data = Selector::parse("#data").expect("a selector");
    let json = page.select(&data).next().expect("there").inner_html();
    let frames: Vec<serde_json::Value> = serde_json::from_str(&json).expect("JSON");
    assert!(frames[0]["about"].as_str().expect("text").starts_with(HOSTILE));
    // Control: without escaping the same name adds elements.
    let broken = plain.replace("desk</td>", &format!("{HOSTILE}</td>"));
    assert_ne!(count(&Html::parse_document(&broken), "script"), count(&plain_page, "script"));
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
    report.places = Default::default();
    report.gap.before = f64::NAN;
    let (html, page) = page_of(&report, folder.path());
    assert!(page.errors.is_empty(), "{:?}", page.errors);
    assert_eq!((count(&page, "img"), count(&page, "script")), (0, 0));
    assert!(html.contains("Unknown effect") && !html.contains("NaN"));
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
