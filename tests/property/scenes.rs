//! OBJ scenes made by others (`../shared/data`, read only) and one of our own: each loads as it should or is refused
//! with an error that names file and line.
#![allow(clippy::unwrap_used)]

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::Vec3;
use shutterbug::scene::{Scene, load_obj};

const SCENES: &str = "../shared/data/scenes";
const CAPTURES: &str = "../shared/data/cycles-dev";

/// Whether shared data is there; says by name which test goes without.
fn present(folder: &str, test: &str) -> bool {
    let there = Path::new(folder).is_dir();
    if !there {
        eprintln!("SKIPPED {test}: {folder} is absent");
    }
    there
}

fn load(path: impl AsRef<Path>) -> Result<Scene, String> {
    let path = path.as_ref();
    load_obj(path, path.parent().unwrap()).map_err(|e| e.to_string())
}

/// What should become of a file: triangles, objects, materials, textures; or what the error says behind the file's
/// name.
enum Expected {
    Loads([usize; 4]),
    Refused(&'static str),
}
use Expected::{Loads, Refused};

const NO_TRIANGLE: &str = ": found no triangle";

/// Triangle counts: n - 2 for each face of n corners, less those without area (named where there are any).
const TABLE: &[(&str, Expected)] = &[
    // 2710 faces, 4 without area; 1368 faces, 56 without area (`control_counts` counts both on its own).
    ("building_3dsmax/regr01.obj", Loads([2706, 1, 12, 0])),
    ("spider_milkshape/spider.obj", Loads([1312, 1, 4, 4])),
    ("spot_blender/spot_triangulated.obj", Loads([5856, 1, 1, 0])),
    ("quirks/assimp/box_UTF16BE.obj", Loads([12, 1, 1, 0])),
    // One face runs around the same quad many times.
    ("quirks/assimp/box_longline.obj", Loads([478, 1, 1, 0])),
    ("quirks/assimp/box_mat_with_spaces.obj", Loads([12, 1, 1, 0])),
    ("quirks/assimp/box_without_lineending.obj", Loads([12, 1, 1, 0])),
    ("quirks/assimp/concave_polygon.obj", Loads([64, 1, 1, 0])),
    ("quirks/assimp/cube_mtllib_after_g.obj", Loads([12, 1, 1, 0])),
    ("quirks/assimp/cube_usemtl.obj", Loads([12, 1, 3, 0])),
    ("quirks/assimp/cube_with_vertexcolors.obj", Loads([12, 1, 1, 0])),
    ("quirks/assimp/empty_mat.obj", Loads([256, 1, 1, 0])),
    ("quirks/assimp/mtl_different_folder.obj", Loads([12, 1, 1, 0])),
    ("quirks/assimp/multiple_spaces.obj", Loads([1, 1, 1, 0])),
    ("quirks/assimp/number_formats.obj", Refused(":11: found `v 1e+2 2.e+1 3.1+e2`; expected three numbers")),
    ("quirks/assimp/point_cloud.obj", Refused(NO_TRIANGLE)),
    ("quirks/assimp/regr_3429812.obj", Loads([4, 1, 1, 0])),
    ("quirks/assimp/space_in_material_name.obj", Loads([64, 1, 1, 0])),
    ("quirks/assimp/testline.obj", Refused(NO_TRIANGLE)),
    ("quirks/assimp/testmixed.obj", Loads([12, 1, 1, 0])),
    ("quirks/assimp/testpoints.obj", Refused(NO_TRIANGLE)),
    ("quirks/tinyobj/catmark_torus_creases0.obj", Refused(":62: found normal index 1 in")),
    ("quirks/tinyobj/colorspace-issue-184.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/cornell_box.obj", Loads([36, 9, 4, 0])),
    ("quirks/tinyobj/cornell_box_multimaterial.obj", Loads([36, 9, 4, 0])),
    ("quirks/tinyobj/cube-vertex-w-component.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/cube-vertexcol.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/cube.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/invalid-face-definition.obj", Refused(NO_TRIANGLE)),
    ("quirks/tinyobj/invalid-relative-texture-index.obj", Refused(":2: found vertex index 1 in")),
    ("quirks/tinyobj/invalid-relative-vertex-index.obj", Refused(":1: found vertex index -4 in")),
    ("quirks/tinyobj/issue-138.obj", Loads([12, 1, 2, 0])),
    ("quirks/tinyobj/issue-140-zero-face-idx.obj", Refused(":16: found vertex index 0 in")),
    ("quirks/tinyobj/issue-161-inconsistent-f.obj", Loads([12, 1, 1, 0])),
    ("quirks/tinyobj/issue-162-smoothing-group.obj", Loads([12, 1, 2, 0])),
    ("quirks/tinyobj/issue-235-usemtl-then-o.obj", Loads([2, 2, 2, 0])),
    ("quirks/tinyobj/issue-244-mtl-searchpaths.obj", Loads([2, 2, 2, 0])),
    ("quirks/tinyobj/issue-246-usemtl-whitespace.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/issue-248-texres-texopt.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/issue-295-trianguation-failure.obj", Loads([28, 1, 1, 0])),
    // Two corners coincide: one triangle without area.
    ("quirks/tinyobj/issue-319-002.obj", Loads([13, 1, 1, 0])),
    ("quirks/tinyobj/issue-319-003.obj", Loads([8, 1, 1, 0])),
    ("quirks/tinyobj/issue-330.obj", Loads([3, 1, 1, 0])),
    ("quirks/tinyobj/issue-356-leading-spaces-newmtl.obj", Refused(NO_TRIANGLE)),
    ("quirks/tinyobj/issue-92.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/issue-95-2.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/issue-95.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/leading-decimal-dot-issue-201.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/leading-zero-in-exponent-notation-issue-210.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/line-prim.obj", Refused(NO_TRIANGLE)),
    ("quirks/tinyobj/map-bump.obj", Loads([400, 1, 2, 0])),
    ("quirks/tinyobj/missing_material_file.obj", Loads([36, 9, 4, 0])),
    ("quirks/tinyobj/mtl filename with whitespace issue46.obj", Loads([12, 1, 1, 0])),
    ("quirks/tinyobj/mtllib-multiple-files-issue-112.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/no_material.obj", Loads([36, 9, 1, 0])),
    ("quirks/tinyobj/norm-texopt.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/pbr-mat-ext.obj", Loads([2, 1, 1, 0])),
    ("quirks/tinyobj/points-prim.obj", Refused(NO_TRIANGLE)),
    ("quirks/tinyobj/refl.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/skin-weight.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/smoothing-group-two-squares.obj", Refused(":21: found normal index 1 in")),
    ("quirks/tinyobj/smoothing-normal.obj", Loads([6, 1, 1, 0])),
    ("quirks/tinyobj/test-nan.obj", Refused(":27: found a face with vertex 1, which line 12 gives as NaN")),
    ("quirks/tinyobj/texture-filename-with-whitespace.obj", Loads([12, 1, 3, 0])),
    ("quirks/tinyobj/texture-options-issue-85.obj", Loads([1, 1, 1, 0])),
    ("quirks/tinyobj/tr-and-d-issue-43.obj", Loads([400, 1, 2, 0])),
    ("quirks/tinyobj/usemtl-issue-104.obj", Loads([6, 1, 1, 0])),
    ("quirks/tinyobj/usemtl-issue-68.obj", Loads([400, 1, 2, 0])),
];

fn obj_files(folder: &Path, found: &mut BTreeSet<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            obj_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "obj") {
            found.insert(path);
        }
    }
}

#[test]
fn every_scene_made_by_others_loads_or_is_refused_clearly() {
    if !present(SCENES, "every_scene_made_by_others_loads_or_is_refused_clearly") {
        return;
    }
    let mut files = BTreeSet::new();
    obj_files(Path::new(SCENES), &mut files);
    let listed: BTreeSet<PathBuf> = TABLE.iter().map(|(name, _)| Path::new(SCENES).join(name)).collect();
    assert_eq!(files, listed, "the table must name each file");
    for (name, expected) in TABLE {
        let path = Path::new(SCENES).join(name);
        match (load(&path), expected) {
            (Ok(scene), Loads(counts)) => {
                let found = [
                    scene.triangle_count(),
                    scene.objects.len(),
                    scene.materials.len(),
                    scene.textures.len(),
                ];
                assert_eq!(found, *counts, "{name}: triangles, objects, materials, textures");
            }
            (Err(message), Refused(text)) => {
                let beginning = format!("{}{text}", path.display());
                assert!(message.starts_with(&beginning), "{name}: {message}");
            }
            (Ok(scene), Refused(_)) => panic!("{name} loaded, {} triangles", scene.triangle_count()),
            (Err(message), Loads(_)) => panic!("{name} was refused: {message}"),
        }
    }
}

/// Faces of an OBJ file of triangles: all, and those in which two edges are parallel. Reads nothing but plain `v` and
/// `f`.
fn control_counts(path: &Path) -> (usize, usize) {
    let text = String::from_utf8_lossy(&fs::read(path).unwrap()).into_owned();
    let mut points: Vec<glam::DVec3> = Vec::new();
    let (mut all, mut empty) = (0, 0);
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        if words.first() == Some(&"v") {
            let [x, y, z] = [1, 2, 3].map(|i| f64::from(words[i].parse::<f32>().unwrap()));
            points.push(glam::DVec3::new(x, y, z));
        } else if words.first() == Some(&"f") {
            assert_eq!(words.len(), 4, "{line}");
            let [a, b, c] =
                [1, 2, 3].map(|i| points[words[i].split('/').next().unwrap().parse::<usize>().unwrap() - 1]);
            all += 1;
            empty += usize::from((b - a).cross(c - a) == glam::DVec3::ZERO);
        }
    }
    (all, empty)
}

#[test]
fn triangle_counts_agree_with_an_independent_count() {
    if !present(SCENES, "triangle_counts_agree_with_an_independent_count") {
        return;
    }
    for (name, faces) in [("spider_milkshape/spider.obj", 1368), ("building_3dsmax/regr01.obj", 2710)] {
        let path = Path::new(SCENES).join(name);
        let (all, empty) = control_counts(&path);
        assert_eq!(all, faces, "{name}");
        assert_eq!(load(&path).unwrap().triangle_count(), all - empty, "{name}");
        // Control: half the file gives another count.
        let dir = tempfile::tempdir().unwrap();
        let half = dir.path().join("half.obj");
        let bytes = fs::read(&path).unwrap();
        let cut = bytes.len() * 9 / 10;
        let line_end = cut + bytes[cut..].iter().position(|b| *b == b'\n').unwrap();
        fs::write(&half, &bytes[..line_end]).unwrap();
        assert!(load(&half).unwrap().triangle_count() < all - empty);
    }
}

#[test]
fn the_spider_finds_its_textures_behind_backslashes() {
    if !present(SCENES, "the_spider_finds_its_textures_behind_backslashes") {
        return;
    }
    let folder = Path::new(SCENES).join("spider_milkshape");
    let scene = load(folder.join("spider.obj")).unwrap();
    let expected = [
        ("HLeibTex", "SpiderTex.jpg"),
        ("BeinTex", "drkwood2.jpg"),
        ("Skin", "wal67ar_small.jpg"),
        ("Augentex", "engineflare1.jpg"),
    ];
    for (material, file) in expected {
        let material = scene.materials.iter().find(|m| m.name == material).unwrap();
        let texture = &scene.textures[material.texture.unwrap()];
        assert_eq!(texture.path, folder.join(file));
        let same = |path: &Path| {
            let direct = image::open(path).unwrap().into_rgba8();
            direct.dimensions() == (texture.width, texture.height) && direct.into_raw() == texture.rgba
        };
        assert!(same(&folder.join(file)), "{file}");
        assert!(!same(&folder.join("wal69ar_small.jpg")), "control: another picture differs");
    }
    assert!(scene.materials.iter().all(|m| m.ns == 1.0), "`Ns 0` is 1");
}

#[test]
fn captures_have_as_many_triangles_and_objects_as_lines() {
    if !present(CAPTURES, "captures_have_as_many_triangles_and_objects_as_lines") {
        return;
    }
    for n in 0..10 {
        let path = Path::new(CAPTURES).join(format!("d0{n}/scene.obj"));
        let scene = load(&path).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        let lines = |start: &str| text.lines().filter(|l| l.starts_with(start)).count();
        assert_eq!((scene.triangle_count(), scene.objects.len()), (lines("f "), lines("o ")), "d0{n}");
        let textured = [4, 8, 9].contains(&n);
        assert_eq!(scene.textures.len(), if textured { 4 } else { 0 }, "d0{n}");
        assert_eq!(scene.draws.len(), if textured { 5 } else { 1 }, "d0{n}");
        // Control: a file that ends early has fewer.
        let dir = tempfile::tempdir().unwrap();
        let early = dir.path().join("scene.obj");
        fs::write(&early, text.lines().take(text.lines().count() - 1).collect::<Vec<_>>().join("\n"))
            .unwrap();
        assert_eq!(load(&early).unwrap().triangle_count(), scene.triangle_count() - 1);
    }
}

/// Corners of all triangles in drawing order: positions, and texture coordinates and normals where the file has them.
fn soup(scene: &Scene) -> Vec<([f32; 3], [f32; 2], [f32; 3])> {
    let vertex = |i: &u32| scene.vertices[*i as usize];
    scene.indices.iter().map(vertex).map(|v| (v.position_m, v.uv, v.normal)).collect()
}

#[test]
fn a_plain_file_reads_as_tobj_alone_reads_it() {
    if !present(SCENES, "a_plain_file_reads_as_tobj_alone_reads_it") {
        return;
    }
    let path = Path::new(SCENES).join("spot_blender/spot_triangulated.obj");
    let (models, _) = tobj::load_obj(&path, &tobj::GPU_LOAD_OPTIONS).unwrap();
    let mesh = &models[0].mesh;
    let ours = soup(&load(&path).unwrap());
    assert_eq!((models.len(), mesh.indices.len()), (1, ours.len()));
    let mut shifted = 0;
    for (index, (position, uv, normal)) in mesh.indices.iter().map(|i| *i as usize).zip(ours) {
        assert_eq!(mesh.positions[3 * index..][..3], position);
        assert_eq!(mesh.texcoords[2 * index..][..2], uv);
        let theirs = Vec3::from_slice(&mesh.normals[3 * index..]);
        assert!(theirs.distance(normal.into()) < 1e-3, "file normals have four digits");
        let other = (index + 1) % (mesh.positions.len() / 3);
        shifted += usize::from(mesh.positions[3 * other..][..3] != position);
    }
    assert!(shifted > 10_000, "control: the neighbours' positions differ, {shifted}");
}

#[test]
fn our_own_shapes_come_out_whole() {
    let scene = load("tests/data/obj/shapes.obj").unwrap();
    let names: Vec<&str> = scene.objects.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["floor", "letter L", "roof"]);
    assert!(scene.objects.iter().all(|o| o.trajectory.is_none()));
    let materials: Vec<_> =
        scene.materials.iter().map(|m| (m.name.as_str(), m.kd, m.ks, m.ns, m.texture)).collect();
    assert_eq!(
        materials,
        [
            ("checked", [0.5; 3], [0.1; 3], 20.0, Some(0)),
            ("plain red", [0.8, 0.1, 0.05], [0.0; 3], 1.0, None),
            ("checked again", [1.0; 3], [0.0; 3], 1.0, Some(0)),
        ]
    );
    let texture = &scene.textures[0];
    assert_eq!((scene.textures.len(), texture.width, texture.height), (1, 3, 2));
    assert_eq!(texture.rgba[..8], [255, 0, 0, 255, 0, 255, 0, 255], "top row first");
    // The L (area 3) stands first, without a texture; then floor (4 + 4) and roof (2 slopes and a gable of area 1).
    let area = |object: &str| -> f32 {
        let triangles =
            scene.indices.chunks(3).map(|t| [t[0], t[1], t[2]].map(|i| scene.vertices[i as usize]));
        let of_object = triangles.filter(|t| scene.objects[t[0].object as usize].name == object);
        let points = of_object.map(|t| t.map(|v| Vec3::from(v.position_m)));
        points.map(|[a, b, c]| (b - a).cross(c - a).length() / 2.0).sum()
    };
    let expected = [("letter L", 3.0), ("floor", 8.0), ("roof", 4.0 * 2.0_f32.sqrt() + 1.0)];
    for (object, expected) in expected {
        assert!((area(object) - expected).abs() < 1e-5, "{object}: {}", area(object));
    }
    let runs: Vec<_> = scene.draws.iter().map(|d| (d.first_index, d.index_count, d.texture)).collect();
    // By texture, and what is matt ("checked again") before what shines ("checked").
    assert_eq!(runs, [(0, 12, None), (12, 15, Some(0)), (27, 12, Some(0))]);
}

#[test]
fn smoothing_groups_bend_normals_and_only_theirs() {
    let scene = load("tests/data/obj/shapes.obj").unwrap();
    let at = |x: f32, z: f32, object: u32| -> Vec<Vec3> {
        let found = scene
            .vertices
            .iter()
            .filter(|v| v.object == object && v.position_m[0] == x && v.position_m[2] == z);
        found.map(|v| v.normal.into()).collect()
    };
    // On the ridge the equal slopes average to straight up or down; the gable (`s off`) keeps its own normal, along y.
    let ridge = at(1.0, 4.0, 2);
    assert_eq!(ridge.iter().filter(|n| n.abs().distance(Vec3::Z) < 1e-6).count(), 2, "{ridge:?}");
    assert_eq!(ridge.iter().filter(|n| n.abs().distance(Vec3::Y) < 1e-6).count(), 1, "{ridge:?}");
    // At the eaves only one slope meets.
    let eaves = at(0.0, 3.0, 2);
    assert_eq!(eaves.iter().filter(|n| (n.z.abs() - 0.5_f32.sqrt()).abs() < 1e-6).count(), 2, "{eaves:?}");
    // Control: without groups no normal on the ridge is straight.
    let dir = tempfile::tempdir().unwrap();
    let flat = dir.path().join("flat.obj");
    fs::write(&flat, fs::read_to_string("tests/data/obj/shapes.obj").unwrap().replace("s 1\n", "")).unwrap();
    let scene = load(&flat).unwrap();
    let ridge = scene.vertices.iter().filter(|v| v.position_m[0] == 1.0 && v.position_m[2] == 4.0);
    assert!(ridge.map(|v| Vec3::from(v.normal)).all(|n| n.abs().distance(Vec3::Z) > 0.1));
}
