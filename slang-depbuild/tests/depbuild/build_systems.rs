//! What `--help` shows for make and CMake, for real.

use crate::support::{Tree, has};
use std::fs;
use std::path::Path;
use std::process::Command;

/// One of the examples of `--help`: the indented lines below its heading.
fn example(heading: &str) -> String {
    let help = Command::new(env!("CARGO_BIN_EXE_slang-depbuild")).arg("--help").output().unwrap();
    let help = String::from_utf8(help.stdout).unwrap();
    let lines = help.lines().skip_while(|line| *line != heading).skip(1);
    let lines = lines.map_while(|line| line.strip_prefix("  ")).filter(|line| !line.starts_with("Needs "));
    lines.map(|line| format!("{line}\n")).collect()
}

/// The tree that the examples are about.
fn tree() -> Option<Tree> {
    let tree = Tree::called("a tree")?;
    fs::rename(tree.path("kernel.slang"), tree.path("closest.slang")).unwrap();
    Some(tree)
}

fn with_us_on_path(program: &str, folder: &Path) -> Command {
    let ours = Path::new(env!("CARGO_BIN_EXE_slang-depbuild")).parent().unwrap().to_owned();
    let path = std::env::var_os("PATH").unwrap_or_default();
    let path = std::env::join_paths([ours].into_iter().chain(std::env::split_paths(&path))).unwrap();
    let mut command = Command::new(program);
    command.current_dir(folder).env("PATH", path).env_remove("MAKEFLAGS");
    command
}

/// Builds, and says how often slang-depbuild ran.
fn runs(command: &mut Command) -> usize {
    let output = command.output().unwrap();
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    text.lines().filter(|line| line.contains("slang-depbuild -q")).count()
}

/// Touches one source after the other, and counts what is built.
fn check(tree: &Tree, mut build: impl FnMut() -> usize, wide8: usize) {
    for source in ["closest.slang", "shared/node.slang", "shared/deep/er.slang", "scale.h"] {
        tree.touch(source);
        assert_eq!(build(), 1 + wide8, "{source} was touched");
        assert_eq!(build(), 0, "{source} was touched before");
    }
    tree.touch("wide4.slang");
    assert_eq!(build(), 1, "one module was touched");
    tree.touch("unrelated.slang");
    tree.touch("deep4.slang");
    assert_eq!(build(), 0, "others were touched");
}

#[test]
fn make() {
    let Some(tree) = tree() else { return };
    if !has("make") {
        return;
    }
    tree.write("Makefile", &example("make"));
    let build = || runs(&mut with_us_on_path("make", &tree.root));
    assert_eq!(build(), 2);
    check(&tree, build, 1);
    // An include that goes away, and with it what named it.
    fs::remove_file(tree.path("scale.h")).unwrap();
    tree.replace("closest.slang", "#include \"scale.h\"", "#define SCALE 3");
    assert_eq!(build(), 2);
}

#[test]
fn cmake() {
    let Some(tree) = tree() else { return };
    if !has("cmake") {
        return;
    }
    let lists = format!("cmake_minimum_required(VERSION 3.20)\nproject(example NONE)\n{}", example("CMake"));
    tree.write("CMakeLists.txt", &lists);
    for (generator, program) in [("Unix Makefiles", "make"), ("Ninja", "ninja")] {
        if has(program) {
            let configured = with_us_on_path("cmake", &tree.root)
                .args(["-S", ".", "-B", program, "-G", generator])
                .output()
                .unwrap();
            assert!(configured.status.success(), "{}", String::from_utf8_lossy(&configured.stderr));
            let build = || {
                let mut command = with_us_on_path("cmake", &tree.root);
                runs(command.args(["--build", program, "--verbose"]))
            };
            assert_eq!(build(), 1, "{generator}");
            check(&tree, build, 0);
        }
    }
}

/// Names with characters that mean something to make.
#[test]
fn make_reads_every_name_as_it_was_written() {
    if !has("make") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let names = ["a b", "c:d", "e\\f", "g\\ h", "i#j", "k$l", "m\\:n", "p\\#q", "r\\\\ s"];
    for name in names {
        fs::write(folder.path().join(name), "").unwrap();
    }
    for last in 1..=names.len() {
        let names = &names[..last];
        let dependencies = names.iter().map(|name| name.into()).collect();
        let depfile = slang_depbuild::Depfile { target: "the $ target".into(), dependencies };
        for phony in [false, true] {
            fs::write(folder.path().join("d"), depfile.text(phony).unwrap()).unwrap();
            let makefile = "all: the\\ $$\\ target\n-include d\nthe\\ $$\\ target:\n\t@echo '[$^]'\n";
            fs::write(folder.path().join("Makefile"), makefile).unwrap();
            let output = with_us_on_path("make", folder.path()).output().unwrap();
            let said = String::from_utf8_lossy(&output.stdout).into_owned();
            let expected = format!("[{}]\n", names.join(" "));
            assert_eq!(said, expected, "{}", String::from_utf8_lossy(&output.stderr));
        }
    }
}
