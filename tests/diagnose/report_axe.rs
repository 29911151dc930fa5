//! The page in a browser, at desktop and phone width, on light and dark paper: axe-core finds nothing amiss, and
//! nothing is wider than the window. Skipped by name without Chromium, or where `SHUTTERBUG_AXE` does not name
//! axe-core's `axe.min.js` (`npm install axe-core`).

use std::path::Path;
use std::process::Command;

use crate::report_support::sample;
use shutterbug_diagnose::report::render_html;

/// What the page says of itself once axe-core has looked at it.
const LOOK: &str = "axe.run(document, { resultTypes: ['violations'] }).then(r => {
  const nodes = v => v.nodes.map(n => n.target.join(' ')).join(', ');
  const said = { dark: matchMedia('(prefers-color-scheme: dark)').matches, width: innerWidth,
    wide: document.documentElement.scrollWidth > innerWidth, violations: r.violations.map(v => v.id + ': ' + \
    nodes(v)) };
  document.body.textContent = 'SAID' + JSON.stringify(said) + 'SAID';
});";

fn browser() -> Option<&'static str> {
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| Command::new(name).arg("--version").output().is_ok_and(|o| o.status.success()))
}

/// Opens a page in a window of that size and gives what [`LOOK`] said.
fn look(browser: &str, folder: &Path, html: &str, size: &str, dark: bool) -> serde_json::Value {
    let page = folder.join("looked-at.html");
    std::fs::write(&page, html).expect("written");
    let output = Command::new(browser)
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"])
        .args(["--disable-component-update", "--disable-sync", "--virtual-time-budget=30000", "--dump-dom"])
        .arg(format!("--window-size={size}"))
        .arg(format!("--blink-settings=preferredColorScheme={}", if dark { 0 } else { 1 }))
        .arg(format!("--user-data-dir={}", folder.join("browser").display()))
        .arg(format!("file://{}", page.display()))
        .output()
        .expect("the browser runs");
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let said = text.split("SAID").nth(1).unwrap_or_else(|| panic!("the page said nothing: {:.300}", text));
    serde_json::from_str(&said.replace("&gt;", ">").replace("&amp;", "&")).expect("JSON")
}

#[test]
fn axe_finds_nothing_at_desktop_and_phone_width() {
    let test = "axe_finds_nothing_at_desktop_and_phone_width";
    let Some(axe) = std::env::var_os("SHUTTERBUG_AXE") else {
        eprintln!("SKIPPED {test}: SHUTTERBUG_AXE names no axe.min.js");
        return;
    };
    let Some(browser) = browser() else {
        eprintln!("SKIPPED {test}: there is no Chromium");
        return;
    };
    let axe = std::fs::read_to_string(axe).expect("axe-core").replace("</script", "<\\/script");
    let folder = tempfile::tempdir().expect("a folder");
    let html =
        render_html(&sample(folder.path(), 3, "desk"), folder.path()).unwrap_or_else(|e| panic!("{e}"));
    let with = |html: &str| {
        html.replace("</body>", &format!("<script>{axe}</script><script>{LOOK}</script></body>"))
    };
    for size in ["1280,900", "390,844"] {
        for dark in [false, true] {
            let said = look(browser, folder.path(), &with(&html), size, dark);
            eprintln!("{size}, dark {dark}: {said}");
            assert_eq!(said["dark"], dark);
            assert_eq!(said["violations"], serde_json::json!([]), "{size}, dark {dark}");
            assert_eq!(said["wide"], false, "{size}");
        }
    }
    // Control: soft text that is too soft, and a picture without words.
    let soft = html.replace("--soft:#59636e", "--soft:#c9d3de").replace("alt=\"Real frame\"", "");
    let said = look(browser, folder.path(), &with(&soft), "1280,900", false).to_string();
    assert!(said.contains("color-contrast") && said.contains("image-alt"), "{said}");
}
