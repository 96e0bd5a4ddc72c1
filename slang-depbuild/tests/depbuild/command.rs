#[cfg(unix)]
use crate::support::script;
use crate::support::{Tree, modified};
use slang_depbuild::Depfile;
use std::fs;
use std::process::{Command, Output};

fn program() -> Command {
    Command::new(env!("CARGO_BIN_EXE_slang-depbuild"))
}

fn run(command: &mut Command) -> (Option<i32>, String, String) {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap();
    (status.code(), text(stdout), text(stderr))
}

#[test]
fn the_exit_status_says_who_is_to_blame() {
    let Some(tree) = Tree::new() else { return };
    let line = |options: &[&str]| {
        let mut command = program();
        command.current_dir(&tree.root).args(["kernel.slang", "-I", "shared", "-o", "k.spv"]).args(options);
        run(&mut command)
    };
    let (status, out, err) = line(&["--specialize", "wide4.slang", "--depfile", "k.d"]);
    assert_eq!((status, &out[..], &err[..]), (Some(0), "", ""));
    let depfile = Depfile::read(&tree.path("k.d")).unwrap();
    assert_eq!(depfile.target.to_str(), Some("k.spv"), "as it was called");

    let made = modified(&tree.path("k.spv"));
    let (status, _, err) = line(&[]);
    assert_eq!(status, Some(1));
    assert!(err.contains("unresolved external symbol 'ARITY'"), "{err}");
    assert!(err.contains(&format!("--> {}:3:", tree.path("kernel.slang").display())), "{err}");
    assert_eq!(modified(&tree.path("k.spv")), made);

    assert_eq!(line(&["--bogus"]).0, Some(2));
    let (status, _, err) = line(&["--", "-Ielsewhere"]);
    assert_eq!(status, Some(2));
    assert!(err.starts_with("slang-depbuild: -Ielsewhere: "), "{err}");
}

#[test]
fn warnings_are_passed_on_unless_it_is_quiet() {
    let Some(tree) = Tree::new() else { return };
    tree.replace("kernel.slang", "Node node;", "Node node; float unset; boxes[0] = unset;");
    let mut command = program();
    command.arg(tree.path("kernel.slang")).arg("-I").arg(tree.path("shared")).arg("-s");
    command.arg(tree.path("wide4.slang")).arg("-o").arg(tree.path("k.spv"));
    let (status, _, err) = run(&mut command);
    assert_eq!(status, Some(0), "{err}");
    assert!(err.contains("warning") && err.contains(tree.path("kernel.slang").to_str().unwrap()), "{err}");
    assert_eq!(run(command.arg("-q")), (Some(0), String::new(), String::new()));
    command.args(["--", "-warnings-as-errors", "all"]);
    assert_eq!(run(&mut command).0, Some(1));
}

#[test]
fn it_says_where_slangc_is_and_what_was_read() {
    let Some(tree) = Tree::new() else { return };
    let mut command = program();
    command.arg(tree.path("kernel.slang")).arg("-I").arg(tree.path("shared")).arg("-s");
    command.arg(tree.path("wide4.slang")).arg("-o").arg(tree.path("k.spv")).arg("-v");
    let (status, _, err) = run(&mut command);
    assert_eq!(status, Some(0), "{err}");
    assert!(err.contains(tree.slangc.path().to_str().unwrap()), "{err}");
    assert!(err.contains(tree.path("shared/node.slang").to_str().unwrap()), "{err}");
}

#[test]
fn no_validator_is_said_in_a_word() {
    let Some(tree) = Tree::new() else { return };
    if tree.slangc.path().with_file_name("spirv-val").exists() {
        eprintln!("skipped: this slangc brings its own spirv-val");
        return;
    }
    let mut command = program();
    command.arg(tree.path("kernel.slang")).arg("-I").arg(tree.path("shared")).arg("-s");
    command.arg(tree.path("wide4.slang")).arg("-o").arg(tree.path("k.spv"));
    command.arg("--slangc").arg(tree.slangc.path()).env("PATH", "");
    let (status, _, err) = run(&mut command);
    assert_eq!(status, Some(0), "{err}");
    assert!(err.ends_with("k.spv: not validated, there is no spirv-val here\n"), "{err}");
    let (status, _, err) = run(command.arg("-O"));
    assert_eq!(status, Some(1));
    assert!(err.starts_with("slang-depbuild: no spirv-opt, "), "{err}");
}

#[test]
fn without_slangc_it_says_how_to_get_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut command = program();
    command.args(["k.slang", "-o", "k.spv"]).current_dir(&folder).env("PATH", "");
    command.env("HOME", folder.path()).env_remove("XDG_DATA_HOME").env("SLANGC", "");
    let (status, _, err) = run(&mut command);
    assert_eq!(status, Some(1));
    assert!(err.starts_with("slang-depbuild: no slangc: ") && err.contains("scripts/setup"), "{err}");
    assert_eq!(err.lines().count(), 1);
    let (status, _, err) = run(command.env("SLANGC", "/nowhere/slangc"));
    assert_eq!(status, Some(1));
    assert!(err.contains("/nowhere/slangc"), "{err}");
    assert_eq!(fs::read_dir(&folder).unwrap().count(), 0);
}

#[cfg(unix)]
#[test]
fn the_newest_slangc_that_was_set_up_is_used() {
    let folder = tempfile::tempdir().unwrap();
    for version in ["2026.9", "2026.14.1", "2025.24.2"] {
        let text =
            format!("[ \"$1\" = -version ] && echo {version} && exit\necho 'error: not today' >&2; exit 1");
        script(&folder.path().join(format!("broadleaf/slang-{version}/bin/slangc")), &text);
    }
    let kernel = folder.path().join("k.slang");
    fs::write(&kernel, "").unwrap();
    let mut command = program();
    command.arg(kernel).arg("-v").arg("-o").arg(folder.path().join("k.spv"));
    command.env("PATH", "").env("XDG_DATA_HOME", folder.path()).env_remove("SLANGC");
    let (status, _, err) = run(&mut command);
    assert_eq!(status, Some(1));
    assert!(err.contains("slang-2026.14.1/bin/slangc (2026.14.1)"), "{err}");
    assert!(err.ends_with("error: not today\n"), "{err}");
}

#[cfg(unix)]
#[test]
fn a_compiler_that_crashes_is_not_an_error_in_the_source() {
    let folder = tempfile::tempdir().unwrap();
    let slangc = folder.path().join("slangc");
    script(&slangc, "kill -ABRT $$");
    fs::write(folder.path().join("k.slang"), "").unwrap();
    let mut command = program();
    command.args(["k.slang", "-o", "k.spv", "--slangc"]).arg(&slangc).current_dir(&folder);
    let (status, _, err) = run(&mut command);
    assert_eq!(status, Some(1));
    assert!(err.contains("broke down (signal: 6"), "{err}");
    assert!(!folder.path().join("k.spv").exists());
}
