//! Compiles every shader in `glsl/` (in sorted order) and writes one table of what it found in them: code, workgroup
//! size, bindings, push-constant members. The host never types any of these again. A second table, of
//! `benches/peers/glsl/`, is for benches.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

use spirq::ReflectConfig;
use spirq::constant::ConstantValue;
use spirq::entry_point::EntryPoint;
use spirq::spirv::ExecutionMode;
use spirq::ty::{DescriptorType, StructType, Type};
use spirq::var::Variable;

/// Shaders that benches alone include, to measure against: no part of the library.
const PEERS: &str = "benches/peers/glsl";

fn main() {
    println!("cargo:rerun-if-changed=glsl");
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed={PEERS}");
    name_the_shared_library();
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR"));
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    for (dir, file) in [("glsl", "kernel_table.rs"), (PEERS, "peer_table.rs")] {
        let mut table = String::from("&[\n");
        for path in shaders(Path::new(dir)) {
            table += &entry(&compiler, &path);
        }
        table += "]\n";
        fs::write(out.join(file), table).expect("OUT_DIR is writable");
    }
    fs::write(out.join("pointwise.rs"), format!("&{:?}", pointwise_stems())).expect("OUT_DIR is writable");
}

/// The name by which programs ask for the C library at run time: `cargo cinstall` gives the same. Before 1.0 a minor
/// version may change the ABI and is part of it.
fn name_the_shared_library() {
    let version = |part: &str| env::var(format!("CARGO_PKG_VERSION_{part}")).expect("cargo sets it");
    let abi = match version("MAJOR").as_str() {
        "0" => format!("0.{}", version("MINOR")),
        major => major.to_owned(),
    };
    if env::var("CARGO_CFG_TARGET_OS").is_ok_and(|os| os == "linux") {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libshutterbug.so.{abi}");
        // It keeps a Vulkan instance (src/gpu/instance.rs): unloaded and loaded anew, it would keep one more each time.
        println!("cargo:rustc-cdylib-link-arg=-Wl,-z,nodelete");
    }
}

/// The stems in `effects/list.glsl`, in its order.
fn pointwise_stems() -> Vec<String> {
    let list = fs::read_to_string("glsl/include/effects/list.glsl").expect("the list of pointwise effects");
    let stem = |line: &str| Some(line.strip_prefix("EFFECT(")?.strip_suffix(")")?.to_owned());
    list.lines().filter_map(stem).collect()
}

/// `effects/all.glsl`: every effect of the list with its specialization constant (0 is OUTPUT's), and the function that
/// applies those that are on, one after another.
fn all_effects() -> String {
    let (mut includes, mut calls) = (String::new(), String::new());
    for (i, stem) in pointwise_stems().iter().enumerate() {
        writeln!(includes, "layout(constant_id = {}) const uint VARIANT_{stem} = 0u;", i + 1)
            .expect("strings grow");
        writeln!(includes, "#include \"effects/{stem}.glsl\"").expect("strings grow");
        writeln!(calls, "    if (VARIANT_{stem} != 0u) value = {stem}(value, pixel, {i}u);")
            .expect("strings grow");
    }
    format!("{includes}\nvec3 apply_effects(vec3 value, uvec2 pixel) {{\n{calls}    return value;\n}}\n")
}

/// All stages in `dir` itself; `include/` holds text only.
fn shaders(dir: &Path) -> Vec<PathBuf> {
    let is_stage =
        |p: &PathBuf| p.extension().is_some_and(|e| ["comp", "vert", "frag"].iter().any(|s| e == *s));
    let entries = fs::read_dir(dir).unwrap_or_else(|e| panic!("{}: {e}", dir.display()));
    let mut paths: Vec<_> = entries.map(|e| e.expect("a readable folder").path()).filter(is_stage).collect();
    paths.sort();
    paths
}

/// One row of the table.
fn entry(compiler: &shaderc::Compiler, path: &Path) -> String {
    let file = path.file_name().and_then(|n| n.to_str()).expect("shader names are ASCII");
    // Names survive only without optimisation, so the layout is read from a second, plain compilation.
    let plain = compile(compiler, path, shaderc::OptimizationLevel::Zero);
    let fast = compile(compiler, path, shaderc::OptimizationLevel::Performance);
    let entries = ReflectConfig::new().spv(plain).ref_all_rscs(true).reflect();
    let entries = entries.unwrap_or_else(|e| panic!("{file}: cannot reflect: {e}"));
    let main = entries.first().unwrap_or_else(|| panic!("{file}: no entry point"));
    let mut row = String::new();
    writeln!(row, "Kernel {{ file: {file:?}, local_size: {:?},", local_size(main)).expect("strings grow");
    writeln!(row, "bindings: &[{}],", bindings(file, main)).expect("strings grow");
    writeln!(row, "push_members: &[{}],", push_members(file, main)).expect("strings grow");
    writeln!(row, "words: &{fast:?} }},").expect("strings grow");
    row
}

fn compile(compiler: &shaderc::Compiler, path: &Path, level: shaderc::OptimizationLevel) -> Vec<u32> {
    let source = fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let kind = match path.extension().and_then(|e| e.to_str()) {
        Some("vert") => shaderc::ShaderKind::Vertex,
        Some("frag") => shaderc::ShaderKind::Fragment,
        _ => shaderc::ShaderKind::Compute,
    };
    let mut options = shaderc::CompileOptions::new().expect("shaderc has memory");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_optimization_level(level);
    options.set_warnings_as_errors();
    options.set_include_callback(|name, _, _, _| {
        if name == "effects/all.glsl" {
            return Ok(shaderc::ResolvedInclude { resolved_name: name.to_owned(), content: all_effects() });
        }
        let path = Path::new("glsl/include").join(name);
        let content = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });
    match compiler.compile_into_spirv(&source, kind, &path.display().to_string(), "main", Some(&options)) {
        Ok(artifact) => artifact.as_binary().to_vec(),
        Err(error) => panic!("{error}"),
    }
}

fn local_size(main: &EntryPoint) -> [u32; 3] {
    let mode = main.exec_modes.iter().find(|m| m.exec_mode == ExecutionMode::LocalSize);
    let mut size = [1u32; 3];
    for (to, from) in size.iter_mut().zip(mode.iter().flat_map(|m| &m.operands)) {
        let ConstantValue::U32(value) = from.value else { panic!("a workgroup size is a plain integer") };
        *to = value;
    }
    size
}

fn bindings(file: &str, main: &EntryPoint) -> String {
    let mut rows: Vec<(u32, u32, String)> = Vec::new();
    for var in &main.vars {
        let Variable::Descriptor { name, desc_bind, desc_ty, .. } = var else { continue };
        let kind = match desc_ty {
            DescriptorType::CombinedImageSampler() => "SampledImage",
            DescriptorType::StorageImage(_) => "StorageImage",
            DescriptorType::UniformBuffer() => "UniformBuffer",
            DescriptorType::StorageBuffer(_) => "StorageBuffer",
            DescriptorType::UniformTexelBuffer() => "TexelBuffer",
            other => panic!("{file}: descriptor type {other:?} is not used in this project"),
        };
        let (set, binding) = (desc_bind.set(), desc_bind.bind());
        // A buffer block without an instance name has none of its own: the block's type name stands for it.
        let block = match var.ty() {
            Type::Struct(s) => s.name.clone(),
            _ => None,
        };
        let name = name.clone().filter(|n| !n.is_empty()).or(block).unwrap_or_default();
        let members = element_members(file, var.ty());
        let row = format!(
            "Binding {{ set: {set}, binding: {binding}, kind: BindingKind::{kind}, name: {name:?}, \
             members: &[{members}] }}"
        );
        rows.push((set, binding, row));
    }
    rows.sort();
    rows.into_iter().map(|r| r.2).collect::<Vec<_>>().join(", ")
}

/// Members of the struct that a buffer holds an array of; nothing for other buffers and for images.
fn element_members(file: &str, ty: &Type) -> String {
    let Type::Struct(block) = ty else { return String::new() };
    let [only] = block.members.as_slice() else { return String::new() };
    let Type::Array(array) = &only.ty else { return String::new() };
    let Type::Struct(element) = array.element_ty.as_ref() else { return String::new() };
    members(file, element)
}

fn push_members(file: &str, main: &EntryPoint) -> String {
    let push = main.vars.iter().find_map(|v| match v {
        Variable::PushConstant { ty: Type::Struct(block), .. } => Some(block),
        _ => None,
    });
    push.map_or_else(String::new, |block| members(file, block))
}

fn members(file: &str, block: &StructType) -> String {
    let mut rows = Vec::new();
    for member in &block.members {
        let name = member.name.as_deref().unwrap_or_else(|| panic!("{file}: a member has no name"));
        let offset = member.offset.unwrap_or_else(|| panic!("{file}: {name} has no offset"));
        let bytes = member.ty.nbyte().unwrap_or_else(|| panic!("{file}: {name} has no size"));
        rows.push(format!("Member {{ name: {name:?}, offset: {offset}, bytes: {bytes} }}"));
    }
    rows.join(", ")
}
