//! No circle between the files of a crate: a reader can begin with the file that names no other and go up from there.
//!
//! A file names another by a path (`super::`, `crate::`, or a module that it declares) that leads into it, directly or
//! through `pub use`. A file may always name what the `mod.rs` of its own folders declares: these hold a folder's
//! types.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use super::layering::{code_only, files, words};

/// Sources of the crates, by the name that other crates use.
const CRATES: [(&str, &str); 3] = [
    ("shutterbug", "src"),
    ("shutterbug_diagnose", "crates/diagnose/src"),
    ("shutterbug_cli", "crates/cli/src"),
];

/// The layers of a diagnosis: each may name those before it.
const LAYERS: [&str; 9] =
    ["report", "evidence", "expect", "fit", "judge", "search", "tell", "gyro", "unpaired"];

type Module = Vec<String>;

/// One crate's files by module, without their tests.
struct Sources {
    name: &'static str,
    code: BTreeMap<Module, String>,
    /// What a module gives on: by module and name, the path behind it.
    given_on: BTreeMap<(Module, String), Vec<String>>,
}

/// The code without `#[cfg(test)]` items that have a body.
fn without_tests(code: &str) -> String {
    let mut rest = code;
    let mut kept = String::new();
    while let Some(at) = rest.find("#[cfg(test)]") {
        let (before, item) = rest.split_at(at);
        kept.push_str(before);
        let end = item.find(['{', ';']).unwrap_or(item.len() - 1);
        let mut depth = 0;
        let close = item[end..].char_indices().find_map(|(i, c)| {
            depth += i32::from(c == '{') - i32::from(c == '}');
            (depth == 0).then_some(end + i + 1)
        });
        rest = &item[close.unwrap_or(item.len())..];
    }
    kept + rest
}

/// `a::{b, c::{self, d as e}}` as paths and the name under which each is known.
fn spread(tree: &str, before: &[String], found: &mut Vec<(Vec<String>, String)>) {
    let tree = tree.trim();
    if let Some(group) = tree.strip_prefix('{').and_then(|t| t.strip_suffix('}')) {
        let (mut depth, mut start) = (0, 0);
        for (i, c) in group.char_indices().chain([(group.len(), ',')]) {
            depth += i32::from(c == '{') - i32::from(c == '}');
            if c == ',' && depth == 0 {
                spread(&group[start..i], before, found);
                start = i + 1;
            }
        }
    } else if let Some((head, tail)) = tree.split_once("::") {
        spread(tail, &[before, &[head.trim().to_owned()]].concat(), found);
    } else if !tree.is_empty() {
        let (name, known_as) = tree.split_once(" as ").unwrap_or((tree, tree));
        let (name, known_as) = (name.trim().to_owned(), known_as.trim().to_owned());
        let known_as = if known_as == "self" { before.last().cloned().unwrap_or_default() } else { known_as };
        found.push(([before, &[name]].concat(), known_as));
    }
}

/// Paths that stand in the code: `(path, name, whether it is given on)`.
fn paths(code: &str, name: &str) -> Vec<(Vec<String>, String, bool)> {
    let mut all = Vec::new();
    let mut rest = String::from(code);
    let uses: Vec<(usize, usize)> =
        words(code, "use").filter_map(|at| Some((at, at + code[at..].find(';')?))).collect();
    for (from, to) in uses {
        let line = code[..from].rfind(['\n', ';', '}', '{']).map_or(0, |i| i + 1);
        let mut found = Vec::new();
        spread(&code[from + 3..to], &[], &mut found);
        let is_given = code[line..from].trim_start().starts_with("pub");
        all.extend(found.into_iter().map(|(path, known_as)| (path, known_as, is_given)));
        rest.replace_range(from..to, &" ".repeat(to - from));
    }
    let word = |c: char| c.is_ascii_alphanumeric() || c == '_' || c == ':';
    for path in rest.split(|c| !word(c)).filter(|p| p.contains("::")) {
        let path: Vec<String> = path.split("::").map(str::to_owned).collect();
        let begins = ["crate", "super", "self", name].contains(&path[0].as_str());
        if begins || path[0].starts_with(|c: char| c.is_ascii_lowercase()) {
            all.push((path, String::new(), false));
        }
    }
    all
}

impl Sources {
    fn new(name: &'static str, texts: impl Iterator<Item = (Module, String)>) -> Self {
        let code: BTreeMap<Module, String> = texts.map(|(m, t)| (m, without_tests(&code_only(&t)))).collect();
        let mut given_on = BTreeMap::new();
        for (module, text) in &code {
            for (path, known_as, _) in paths(text, name) {
                given_on.insert((module.clone(), known_as), path);
            }
        }
        Self { name, code, given_on }
    }

    /// The file that a path leads into, from a module.
    fn target(&self, from: &Module, path: &[String], followed: usize) -> Option<Module> {
        let (mut at, mut rest) = match path[0].as_str() {
            "crate" => (Vec::new(), &path[1..]),
            "self" => (from.clone(), &path[1..]),
            "super" => {
                let supers = path.iter().take_while(|p| *p == "super").count();
                (from[..from.len().checked_sub(supers)?].to_vec(), &path[supers..])
            }
            root if root == self.name => (Vec::new(), &path[1..]),
            child => {
                let below = [from.as_slice(), &[child.to_owned()]].concat();
                (self.code.contains_key(&below).then(|| from.clone())?, path)
            }
        };
        while let Some(next) = rest.first().map(|p| [at.as_slice(), std::slice::from_ref(p)].concat())
            && self.code.contains_key(&next)
        {
            (at, rest) = (next, &rest[1..]);
        }
        let behind = rest.first().and_then(|name| self.given_on.get(&(at.clone(), name.clone())));
        let further = behind.filter(|p| followed < 8 && p.as_slice() != path);
        further.and_then(|path| self.target(&at, path, followed + 1)).or(Some(at))
    }

    /// Which files each file names.
    fn edges(&self) -> BTreeMap<&Module, BTreeSet<Module>> {
        let edges = self.code.iter().map(|(module, text)| {
            let named = paths(text, self.name).into_iter().filter(|(_, _, given)| !given);
            let targets = named.filter_map(|(path, ..)| self.target(module, &path, 0));
            (module, targets.filter(|t| !module.starts_with(t) && self.code.contains_key(t)).collect())
        });
        edges.collect()
    }

    /// Files that lead back to themselves, by what can be reached from where.
    fn circles(&self) -> Vec<BTreeSet<Module>> {
        let edges = self.edges();
        let reached = |from: &Module| {
            let (mut seen, mut next) = (BTreeSet::new(), vec![from.clone()]);
            while let Some(at) = next.pop() {
                for to in &edges[&at] {
                    if seen.insert(to.clone()) {
                        next.push(to.clone());
                    }
                }
            }
            seen
        };
        let all: BTreeMap<&Module, BTreeSet<Module>> = edges.keys().map(|m| (*m, reached(m))).collect();
        let mut circles: Vec<BTreeSet<Module>> = Vec::new();
        for (module, reach) in &all {
            let circle: BTreeSet<Module> =
                reach.iter().filter(|m| all[m].contains(*module)).cloned().collect();
            if circle.len() > 1 && !circles.contains(&circle) {
                circles.push(circle);
            }
        }
        circles
    }
}

/// The module of a file below a crate's sources.
fn module_of(relative: &Path) -> Module {
    let mut parts: Module =
        relative.with_extension("").iter().map(|p| p.to_string_lossy().into_owned()).collect();
    if parts.last().is_some_and(|p| ["mod", "lib", "main"].contains(&p.as_str())) {
        parts.pop();
    }
    parts
}

/// The sources of one crate.
fn sources_of((name, folder): (&'static str, &str)) -> Sources {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join(folder);
    let mut found = Vec::new();
    files(&folder, &mut found);
    let texts = found.iter().filter_map(|path| {
        let module = module_of(path.strip_prefix(&folder).ok()?);
        let tests = module.iter().any(|p| p == "tests");
        (!tests).then(|| (module, fs::read_to_string(path).expect("a source file")))
    });
    Sources::new(name, texts)
}

/// Files of a diagnosis that name a layer behind their own, or stand in none.
fn out_of_order(sources: &Sources) -> Vec<String> {
    let layer = |m: &Module| match &m[..] {
        [first, layer, ..] if first == "diagnose" => Some(LAYERS.iter().position(|r| r == layer)),
        _ => None,
    };
    let mut wrong = Vec::new();
    for (from, named) in sources.edges() {
        let Some(own) = layer(from) else { continue };
        for to in named.iter().filter(|to| layer(to).is_some_and(|there| own.is_none() || there > own)) {
            wrong.push(format!("{} names {}", from.join("/"), to.join("/")));
        }
    }
    wrong
}

#[test]
fn layers_of_a_diagnosis_name_only_those_before_them() {
    let sources = sources_of(CRATES[1]);
    assert_eq!(out_of_order(&sources), Vec::<String>::new());
    let folders = sources.code.keys().filter(|m| m.len() == 2 && m[0] == "diagnose").count();
    assert_eq!(folders, LAYERS.len(), "each layer has a line in LAYERS");
    // Controls: the other way round, and a layer that the list does not have.
    let planted = |from: &str, uses: &str| {
        let texts = [("diagnose/mod.rs", ""), ("diagnose/judge/mod.rs", "struct A;"), (from, uses)];
        let texts = texts.map(|(file, text)| (module_of(Path::new(file)), text.to_owned()));
        out_of_order(&Sources::new("shutterbug_diagnose", texts.into_iter())).len()
    };
    assert_eq!(planted("diagnose/fit/mod.rs", "use crate::diagnose::judge::A;"), 1);
    assert_eq!(planted("diagnose/attic/mod.rs", "use super::judge::A;"), 1);
    assert_eq!(planted("diagnose/search/mod.rs", "use super::judge::A;"), 0);
}

#[test]
fn files_go_in_no_circle() {
    let mut wrong = Vec::new();
    for (name, folder) in CRATES {
        let sources = sources_of((name, folder));
        let edges: usize = sources.edges().values().map(BTreeSet::len).sum();
        assert!(edges > sources.code.len(), "only {edges} paths in {name}: they are not read");
        for circle in sources.circles() {
            let names: Vec<String> = circle.iter().map(|m| format!("{folder}/{}", m.join("/"))).collect();
            wrong.push(names.join(", "));
        }
    }
    assert!(wrong.is_empty(), "files that name each other in a circle:\n{}", wrong.join("\n"));
}

/// Controls: circles are found through braces, `pub use` and paths in the code; what only looks like one is not.
#[test]
fn planted_circles_are_found() {
    let circles = |texts: &[(&str, &str)]| {
        let texts = texts.iter().map(|(file, text)| (module_of(Path::new(file)), (*text).to_owned()));
        Sources::new("shutterbug", texts).circles().len()
    };
    let root = ("lib.rs", "mod a; mod b; pub mod c;");
    for (b, found) in [
        ("use super::a::A;", 1),
        ("use crate::{c::C, a::{self, B as D}};", 1),
        ("fn f() { crate::a::g() }", 1),
        ("use shutterbug::c::Again;", 1),
        ("use super::c::C;", 0),
        ("// use super::a::A;", 0),
        ("const S: &str = \"crate::a::A\";", 0),
        ("#[cfg(test)]\nmod tests { use crate::a::A; }", 0),
        ("pub use super::a::A;", 0),
    ] {
        let c = ("c/mod.rs", "mod d; pub use d::C; pub use crate::a::Again; fn f() { d::g() }");
        let d = ("c/d.rs", "use super::Own; struct C;");
        assert_eq!(circles(&[root, ("a.rs", "use super::b::f;"), ("b.rs", b), c, d]), found, "{b}");
    }
}
