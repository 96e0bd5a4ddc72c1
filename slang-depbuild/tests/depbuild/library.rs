use crate::support::{Tree, has, modified, opcodes};
use slang_depbuild::{Depfile, Error, Job, Validation, up_to_date};
use std::fs;
use std::path::PathBuf;
use std::process::Command;

#[test]
fn specialisation_changes_the_code() {
    let Some(tree) = Tree::new() else { return };
    let [wide4, wide8, deep4] =
        ["wide4.slang", "wide8.slang", "deep4.slang"].map(|s| tree.spirv(&tree.job(s)));
    assert_ne!(wide4, wide8, "a constant makes a difference");
    assert_ne!(wide4, deep4, "a type makes a difference");
    assert_eq!(wide4, tree.spirv(&tree.job("wide4.slang")), "the same sources make the same module");
}

#[test]
fn macros_and_capabilities_reach_the_compiler() {
    let Some(tree) = Tree::new() else { return };
    tree.write("scale.h", "#ifdef HEADER\n#include HEADER\n#else\n#define SCALE 3\n#endif\n");
    let plain = tree.spirv(&tree.job("wide4.slang"));
    tree.write("other.h", "#define SCALE 7\n");
    let mut job = tree.job("wide4.slang");
    job.macros = vec!["HEADER=\"other.h\"".into()];
    job.capabilities = vec!["SPV_KHR_maximal_reconvergence".into()];
    assert_ne!(tree.spirv(&job), plain);
    let compiled = tree.compile(&job).unwrap();
    assert!(compiled.dependencies.contains(&tree.path("other.h")), "found through a macro");
}

#[test]
fn every_source_is_listed_once_and_nothing_else() {
    let Some(tree) = Tree::new() else { return };
    let job = tree.job("deep4.slang");
    let compiled = tree.compile(&job).unwrap();
    let sources = ["kernel.slang", "deep4.slang", "scale.h", "shared/deep/er.slang", "shared/node.slang"];
    assert_eq!(compiled.dependencies, sources.map(|file| tree.path(file)));
    let depfile = Depfile::read(job.depfile.as_ref().unwrap()).unwrap();
    assert_eq!(depfile, Depfile { target: job.output.clone(), dependencies: compiled.dependencies });
    assert_eq!(
        fs::read_dir(tree.path("out")).unwrap().count(),
        2,
        "nothing but the output and its dependencies"
    );
    let modules = Command::new("find").arg(&tree.root).args(["-name", "*.slang-module"]).output().unwrap();
    assert!(modules.stdout.is_empty(), "no module in the source tree");
}

#[test]
fn touching_a_source_rebuilds_and_touching_another_does_not() {
    let Some(tree) = Tree::new() else { return };
    let job = tree.job("deep4.slang");
    assert!(tree.rebuild(&job));
    assert!(!tree.rebuild(&job));
    for source in ["kernel.slang", "deep4.slang", "shared/node.slang", "shared/deep/er.slang", "scale.h"] {
        tree.touch(source);
        assert!(tree.rebuild(&job), "{source} was touched");
        assert!(!tree.rebuild(&job), "{source} was touched before");
    }
    for other in ["unrelated.slang", "wide4.slang"] {
        tree.touch(other);
        assert!(!tree.rebuild(&job), "{other} was touched");
    }
    tree.replace("shared/deep/er.slang", "return 5", "return 6");
    let before = fs::read(&job.output).unwrap();
    assert!(tree.rebuild(&job));
    assert_ne!(fs::read(&job.output).unwrap(), before);
}

#[test]
fn nothing_is_up_to_date_without_its_files() {
    let Some(tree) = Tree::new() else { return };
    let job = tree.job("wide4.slang");
    let compiled = tree.compile(&job).unwrap();
    let depfile = job.depfile.as_ref().unwrap();
    assert_eq!(up_to_date(&job.output, depfile, &[tree.slangc.path()]), Some(compiled.dependencies));
    assert_eq!(up_to_date(&job.output, depfile, &[&tree.path("nothing")]), None, "a tool that is gone");
    tree.write("new tool", "");
    tree.touch("new tool");
    assert_eq!(up_to_date(&job.output, depfile, &[&tree.path("new tool")]), None, "a tool that is new");
    fs::rename(tree.path("scale.h"), tree.path("gone.h")).unwrap();
    assert_eq!(up_to_date(&job.output, depfile, &[]), None, "a source that is gone");
    fs::rename(tree.path("gone.h"), tree.path("scale.h")).unwrap();
    fs::write(depfile, "half a fi").unwrap();
    assert_eq!(up_to_date(&job.output, depfile, &[]), None, "a damaged dependency file");
}

#[test]
fn a_source_that_changes_while_it_is_compiled_is_newer() {
    let Some(tree) = Tree::new() else { return };
    let job = tree.job("wide4.slang");
    let before = std::time::SystemTime::now();
    tree.compile(&job).unwrap();
    let took = before.elapsed().unwrap();
    assert!(modified(&job.output) < before + took / 2, "it bears the time of the beginning");
}

#[test]
fn a_stale_module_is_not_used() {
    let Some(tree) = Tree::new() else { return };
    let sources = ["deep4.slang", "shared/node.slang", "shared/deep/er.slang"];
    for source in sources {
        tree.leave_module(source);
    }
    tree.replace("shared/deep/er.slang", "return 5", "return 55");
    tree.replace("deep4.slang", "ARITY = 4", "ARITY = 44");
    let job = tree.job("deep4.slang");
    let compiled = tree.compile(&job).unwrap();
    let beside_stale_ones = fs::read(&job.output).unwrap();
    for source in sources {
        fs::remove_file(tree.path(source).with_extension("slang-module")).unwrap();
    }
    assert_eq!(beside_stale_ones, tree.spirv(&job));
    for source in sources {
        assert!(compiled.dependencies.contains(&tree.path(source)), "{source} is listed");
        tree.write(source.replace("slang", "slang-module").as_str(), "RIFF garbage");
    }
    assert_eq!(beside_stale_ones, tree.spirv(&job));
}

#[test]
fn absolute_paths_lead_to_no_stale_module_either() {
    let Some(tree) = Tree::new() else { return };
    let er = tree.path("shared/deep/er");
    tree.replace("shared/node.slang", "\"deep/er\"", &format!("{er:?}"));
    let mut job = tree.job("deep4.slang");
    job.macros = vec![format!("SCALE_H={:?}", tree.path("scale.h"))];
    tree.replace("kernel.slang", "\"scale.h\"", "SCALE_H");
    let fresh = tree.spirv(&job);
    tree.leave_module("shared/deep/er.slang");
    tree.replace("shared/deep/er.slang", "return 5", "return 55");
    let compiled = tree.compile(&job).unwrap();
    assert_ne!(fs::read(&job.output).unwrap(), fresh);
    for source in ["scale.h", "shared/deep/er.slang"] {
        assert!(compiled.dependencies.contains(&tree.path(source)), "{source} is listed");
    }
}

/// Shows that the tests above test something: this is why the sources are copied.
#[test]
fn slangc_alone_would_use_it() {
    let Some(tree) = Tree::new() else { return };
    tree.write(
        "user.slang",
        "import \"shared/deep/er\";\nRWStructuredBuffer<float> a;\n\
        [shader(\"compute\")] [numthreads(1, 1, 1)] void main() { a[0] = deep(); }\n",
    );
    tree.leave_module("shared/deep/er.slang");
    let alone = |value: &str| {
        tree.write(
            "shared/deep/er.slang",
            &format!("module er;\npublic float deep() {{ return {value}; }}\n"),
        );
        let mut command = Command::new(tree.slangc.path());
        command.arg(tree.path("user.slang")).args(["-target", "spirv", "-entry", "main", "-O0", "-o"]);
        assert!(command.arg(tree.path("user.spv")).status().unwrap().success());
        fs::read(tree.path("user.spv")).unwrap()
    };
    if alone("5") != alone("6") {
        eprintln!("this slangc looks at sources first; the copies are not needed for it");
    }
    let ours = |value: &str| {
        tree.write(
            "shared/deep/er.slang",
            &format!("module er;\npublic float deep() {{ return {value}; }}\n"),
        );
        tree.spirv(&Job::new(tree.path("user.slang"), tree.path("user.spv")))
    };
    assert_ne!(ours("5"), ours("6"));
}

#[test]
fn an_error_leaves_the_old_output_and_names_the_real_file() {
    let Some(tree) = Tree::new() else { return };
    let job = tree.job("wide4.slang");
    let old = tree.spirv(&job);
    let (made, depfile) = (modified(&job.output), fs::read(job.depfile.as_ref().unwrap()).unwrap());
    for (file, from, to, line) in [
        ("kernel.slang", "node.area()", "node.aria()", 7),
        ("wide4.slang", "return 2", "return two", 4),
        ("shared/deep/er.slang", "return 5", "return five", 2),
    ] {
        tree.replace(file, from, to);
        let Err(Error::Rejected(messages)) = tree.compile(&job) else { panic!("{file} is wrong") };
        let place = format!("{}:{line}:", tree.path(file).display());
        assert!(messages.contains(&format!("--> {place}")), "{messages}\nnames {place}");
        assert!(!messages.contains("slang-depbuild-"), "{messages}");
        tree.replace(file, to, from);
        assert_eq!((fs::read(&job.output).unwrap(), modified(&job.output)), (old.clone(), made));
        assert_eq!(fs::read(job.depfile.as_ref().unwrap()).unwrap(), depfile);
    }
    fs::remove_file(tree.path("scale.h")).unwrap();
    let Err(Error::Rejected(messages)) = tree.compile(&job) else { panic!("a header is missing") };
    assert!(messages.contains("scale.h"), "{messages}");
    fs::remove_file(tree.path("kernel.slang")).unwrap();
    let error = tree.compile(&job).unwrap_err();
    assert!(matches!(&error, Error::Io { path, .. } if *path == job.kernel), "{error}");
}

#[test]
fn names_may_have_spaces_and_worse() {
    let Some(tree) = Tree::called("a tree: 1$ #2 über") else { return };
    fs::rename(tree.path("wide4.slang"), tree.path("wide 4$#.slang")).unwrap();
    let mut job = tree.job("wide 4$#.slang");
    job.output = tree.path("out/a kernel.spv");
    let compiled = tree.compile(&job).unwrap();
    assert!(compiled.dependencies.contains(&tree.path("wide 4$#.slang")));
    assert!(compiled.dependencies.contains(&tree.path("shared/node.slang")), "{compiled:?}");
    assert_eq!(Depfile::read(job.depfile.as_ref().unwrap()).unwrap().dependencies, compiled.dependencies);
}

#[test]
fn the_result_is_clean_and_valid() {
    let Some(tree) = Tree::new() else { return };
    let mut job = tree.job("wide4.slang");
    // OpSource…, OpName, OpMemberName, OpString, OpLine; OpNoLine, OpModuleProcessed.
    let describing =
        |spirv: &[u8]| opcodes(spirv).iter().filter(|op| matches!(op, 2..=8 | 317 | 330)).count();
    let compiled = tree.compile(&job).unwrap();
    let plain = fs::read(&job.output).unwrap();
    assert_eq!(describing(&plain), 0);
    let expected = if has("spirv-val") { Validation::Passed } else { Validation::NoValidator };
    assert_eq!(compiled.validation, expected);

    job.arguments = vec!["-g2".into()];
    let debug = tree.spirv(&job);
    assert_eq!(describing(&debug), 0);
    assert!(!debug.windows(11).any(|bytes| bytes == b"NonSemantic"));
    job.keep_names = true;
    let named = tree.spirv(&job);
    assert!(opcodes(&named).contains(&5) && !opcodes(&named).contains(&3));
    job.arguments.clear();
    job.validate = false;
    assert_eq!(tree.compile(&job).unwrap().validation, Validation::NotAsked);

    if has("spirv-opt") {
        job = tree.job("wide4.slang");
        job.optimize = true;
        assert!(tree.spirv(&job).len() < plain.len());
    }
}

#[test]
fn an_invalid_result_is_not_written() {
    let Some(tree) = Tree::new() else { return };
    if !has("spirv-val") {
        return;
    }
    let mut job = tree.job("wide4.slang");
    // SPIR-V 1.5 is too new for it.
    job.target_env = "vulkan1.0".into();
    let error = tree.compile(&job).unwrap_err();
    assert!(matches!(error, Error::Invalid { .. }), "{error}");
    assert!(!job.output.exists());
}

#[cfg(unix)]
#[test]
fn a_source_may_be_a_link() {
    let Some(tree) = Tree::new() else { return };
    fs::rename(tree.path("shared/node.slang"), tree.path("node elsewhere.slang")).unwrap();
    std::os::unix::fs::symlink("../node elsewhere.slang", tree.path("shared/node.slang")).unwrap();
    let compiled = tree.compile(&tree.job("wide4.slang"));
    let dependencies: Vec<PathBuf> = compiled.unwrap_or_else(|error| panic!("{error}")).dependencies;
    assert!(dependencies.contains(&tree.path("node elsewhere.slang")), "{dependencies:?}");
}
