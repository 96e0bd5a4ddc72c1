//! Shaders are built from their sources, all of them, and nothing else.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use tracer::permutations::KINDS;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn below(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            below(&path, extension, found);
        } else if path.extension().is_some_and(|e| e == extension) {
            found.push(path);
        }
    }
}

/// The sources of all shaders.
fn shaders(found: &mut Vec<PathBuf>) {
    for kind in KINDS {
        below(&root().join("src"), kind, found);
    }
}

/// A source and all that it includes, directly or not.
fn included(source: &Path, all: &mut BTreeSet<PathBuf>) {
    if !all.insert(source.to_path_buf()) {
        return;
    }
    for line in fs::read_to_string(source).unwrap().lines() {
        if let Some(name) = line.trim().strip_prefix("#include \"").and_then(|l| l.strip_suffix('"')) {
            // From the shared folder or, where one stage needs another's, from `src`.
            let file = ["shaders", "src"].map(|folder| root().join(folder).join(name));
            let file = file.iter().find(|f| f.exists()).unwrap_or_else(|| panic!("no {name}"));
            included(file, all);
        }
    }
}

#[test]
fn cargo_knows_every_include_of_every_shader() {
    // What the build script told cargo lies beside its output folder.
    let out = Path::new(env!("OUT_DIR"));
    let told = fs::read_to_string(out.with_file_name("output")).unwrap();
    let told: BTreeSet<PathBuf> = told
        .lines()
        .filter_map(|l| l.strip_prefix("cargo::rerun-if-changed="))
        .map(|p| root().join(p))
        .collect();
    let mut sources = Vec::new();
    shaders(&mut sources);
    assert!(!sources.is_empty());
    let mut includes = 0;
    for source in sources {
        let mut needed = BTreeSet::new();
        included(&source, &mut needed);
        includes += needed.len() - 1;
        for file in &needed {
            assert!(told.contains(file), "{} needs {}", source.display(), file.display());
        }
    }
    assert!(includes > 20, "{includes}");
    // A new shader, which nothing includes yet, must be seen too.
    assert!(told.contains(&root().join("src")) && told.contains(&root().join("shaders")));
}

#[test]
fn every_include_is_included() {
    let (mut sources, mut used, mut there) = (Vec::new(), BTreeSet::new(), Vec::new());
    shaders(&mut sources);
    sources.iter().for_each(|s| included(s, &mut used));
    below(&root().join("shaders"), "glsl", &mut there);
    below(&root().join("src"), "glsl", &mut there);
    for file in there {
        assert!(used.contains(&file), "no shader includes {}", file.display());
    }
}

#[test]
fn no_compiled_shader_is_committed() {
    let list = Command::new("git").args(["ls-files"]).current_dir(root().join("../..")).output();
    match list {
        Ok(list) if list.status.success() => {
            let files = String::from_utf8(list.stdout).unwrap();
            let compiled: Vec<_> = files.lines().filter(|f| f.ends_with(".spv")).collect();
            assert!(compiled.is_empty(), "{compiled:?}");
        }
        _ => println!("SKIPPED: not a git checkout"),
    }
}

/// The exchanges of the network for so many children in `order.glsl`, as the preprocessor leaves them.
fn exchanges(arity: usize) -> Vec<(usize, usize)> {
    let source = include_str!("../src/traverse/order.glsl");
    let body = &source[source.find("void order(").expect("the function")..];
    let (mut found, mut taken, mut active) = (Vec::new(), false, true);
    for line in body.lines().map(str::trim) {
        let condition = line.strip_prefix("#if ").or_else(|| line.strip_prefix("#elif "));
        if let Some(condition) = condition {
            active = condition == format!("ARITY == {arity}");
            taken |= active;
        } else if line == "#else" {
            active = !taken;
        } else if line == "#endif" {
            break;
        } else if active {
            for pair in line.split("EXCHANGE(").skip(1) {
                let (pair, _) = pair.split_once(')').expect("a closing bracket");
                let (i, j) = pair.split_once(", ").expect("two indices");
                found.push((i.parse().unwrap(), j.parse().unwrap()));
            }
        }
    }
    found
}

#[test]
fn sorting_networks_sort_with_the_fewest_exchanges() {
    for (arity, fewest) in [(2, 1), (4, 5), (6, 12), (8, 19)] {
        let network = exchanges(arity);
        assert_eq!(network.len(), fewest, "{arity} children");
        assert!(network.iter().all(|&(i, j)| i < j && j < arity), "{arity} children: {network:?}");
        // A network that sorts all sequences of zeros and ones sorts everything (Knuth 5.3.4, theorem Z).
        for bits in 0..1u32 << arity {
            let mut values: Vec<u32> = (0..arity).map(|i| bits >> i & 1).collect();
            for &(i, j) in &network {
                if values[j] < values[i] {
                    values.swap(i, j);
                }
            }
            assert!(values.is_sorted(), "{arity} children: {bits:b} becomes {values:?}");
        }
    }
}
