//! Compiles every shader under `src/` (`*.comp`, and `*.rgen` and the like) to SPIR-V and writes the module `shaders`, one `Shader` each.
//!
//! `src/ploc/nearest.comp` becomes `shaders::PLOC_NEAREST`; one that `src/permutations.rs` lists becomes
//! several, and a function that picks among them, such as `shaders::layout_encode(layout)`. The compiler's own dependency file tells
//! cargo which includes a shader was made from, so touching one rebuilds what uses it and no more.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::Command,
};

#[path = "src/permutations.rs"]
mod permutations;
use permutations::{ARITIES, IN_SLANG, KINDS, Layout, PER_ARITY, PER_LAYOUT};
use slang_depbuild::{Depfile, Job, Slangc, compile, up_to_date};

const TARGET: &str = "vulkan1.2";

fn main() {
    let root = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").expect("cargo sets it"));
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    println!("cargo::rerun-if-changed=src");
    println!("cargo::rerun-if-changed=shaders");
    println!("cargo::rerun-if-env-changed=PATH");

    let mut sources = Vec::new();
    find(&root.join("src"), &mut sources);
    sources.sort();

    let compiler = Compiler::find();
    let slangc = find_slangc();
    let (mut module, mut all) = (String::new(), Vec::new());
    let mut failed = false;
    for source in &sources {
        let stem = source
            .strip_prefix(root.join("src"))
            .expect("found below it")
            .with_extension("")
            .to_string_lossy()
            .replace('\\', "/");
        for permutation in permutations(&stem) {
            let name = format!("{stem}{}", permutation.suffix);
            let file = name.replace('/', "_");
            let spirv = out.join(&file).with_extension("spv");
            match compiler.compile(source, &permutation.macros, &root, &spirv) {
                Ok(dependencies) => {
                    for dependency in dependencies {
                        println!("cargo::rerun-if-changed={}", dependency.display());
                    }
                }
                Err(log) => {
                    failed = true;
                    for line in log.lines() {
                        println!("cargo::error={name}: {line}");
                    }
                }
            }
            let symbol = file.to_uppercase();
            let kind = source.extension().unwrap_or_default().display();
            module += &format!(
                "/// Compiled from `src/{stem}.{kind}`.\npub static {symbol}: Shader = Shader {{ name: {name:?}, spirv: include_bytes!({spirv:?}) }};\n",
            );
            all.push(format!("&{symbol}"));
        }
        module += &choice(&stem);
        if IN_SLANG.contains(&stem.as_str()) {
            match slang(&stem, slangc.as_ref().ok(), &root, &out) {
                Ok((text, symbols)) => {
                    module += &text;
                    all.extend(symbols);
                }
                Err(log) => {
                    failed = true;
                    for line in log.lines() {
                        println!("cargo::error={line}");
                    }
                }
            }
        }
    }
    module += &format!(
        "/// Why this build has no kernels in Slang; nothing where it has them.\npub const SLANG_MISSING: Option<&str> = {:?};\n",
        slangc.err()
    );
    module +=
        &format!("/// Every shader of this build.\npub static ALL: &[&Shader] = &[{}];\n", all.join(", "));
    fs::write(out.join("shaders.rs"), module).expect("OUT_DIR is writable");
    if failed {
        std::process::exit(1);
    }
}

/// The Slang compiler, or why there is none.
fn find_slangc() -> Result<Slangc, String> {
    for variable in ["SLANGC", "XDG_DATA_HOME"] {
        println!("cargo::rerun-if-env-changed={variable}");
    }
    let found = Slangc::find().map_err(|missing| missing.to_string());
    match &found {
        Ok(slangc) => println!("cargo::rerun-if-changed={}", slangc.path().display()),
        Err(missing) => println!("cargo::warning=the Slang variants are left out: {missing}"),
    }
    found
}

/// Compiles `stem.slang` for each layout, and writes the function that picks one and the names of all.
fn slang(
    stem: &str,
    slangc: Option<&Slangc>,
    root: &Path,
    out: &Path,
) -> Result<(String, Vec<String>), String> {
    let (mut module, mut arms, mut symbols) = (String::new(), String::new(), Vec::new());
    let function = format!("{}_slang", stem.replace('/', "_"));
    for layout in Layout::ALL {
        let Some(slangc) = slangc else { break };
        let Some((folder, node)) = layout.slang() else { continue };
        let file = format!("{function}_{}", layout.symbol());
        // Link-time specialisation: this module says which type the kernel's `extern` one is.
        let specialization = out.join(&file).with_extension("slang");
        let text = format!(
            "import layout.node;\nimport layout.{folder}.node;\nexport struct Node : INode = {node};\n"
        );
        if fs::read_to_string(&specialization).ok().as_ref() != Some(&text) {
            fs::write(&specialization, text).map_err(|e| format!("{}: {e}", specialization.display()))?;
        }
        let spirv = out.join(&file).with_extension("spv");
        let depfile = spirv.with_extension("d");
        let job = Job {
            specializations: vec![specialization],
            include_folders: vec![root.join("src"), root.join("shaders")],
            capabilities: [
                "spvGroupNonUniformBallot",
                "spvGroupNonUniformVote",
                "spvGroupNonUniformArithmetic",
            ]
            .map(String::from)
            .to_vec(),
            // Workgroups are sized when a pipeline is made, for which Slang takes LocalSizeId.
            target_env: "vulkan1.3".into(),
            // Lanes without a ray have nothing to initialize.
            arguments: ["-fvk-use-scalar-layout", "-warnings-disable", "41020,41035"]
                .map(Into::into)
                .to_vec(),
            depfile: Some(depfile.clone()),
            ..Job::new(root.join("src").join(stem).with_extension("slang"), &spirv)
        };
        let dependencies = match up_to_date(&spirv, &depfile, &[slangc.path()]) {
            Some(dependencies) => dependencies,
            None => compile(slangc, &job).map_err(|error| error.to_string())?.dependencies,
        };
        for dependency in dependencies.iter().filter(|file| !file.starts_with(out)) {
            println!("cargo::rerun-if-changed={}", dependency.display());
        }
        let (symbol, name) = (file.to_uppercase(), format!("{stem}/{}/slang", layout.symbol()));
        module += &format!(
            "/// Compiled from `src/{stem}.slang`.\npub static {symbol}: Shader = Shader {{ name: {name:?}, spirv: include_bytes!({spirv:?}) }};\n",
        );
        arms += &format!("        Layout::{layout:?} => Some(&{symbol}),\n");
        symbols.push(format!("&{symbol}"));
    }
    arms += "        _ => None,\n";
    module += &format!(
        "/// `src/{stem}.slang` for a layout, if this build has it.\npub fn {function}(layout: Layout) -> Option<&'static Shader> {{\n    match layout {{\n{arms}    }}\n}}\n"
    );
    Ok((module, symbols))
}

/// One way of compiling a source.
struct Permutation {
    /// What is added to the source's name.
    suffix: String,
    /// `NAME=VALUE`.
    macros: Vec<String>,
}

fn permutations(stem: &str) -> Vec<Permutation> {
    if PER_LAYOUT.contains(&stem) {
        let of = |layout: &Layout| Permutation {
            suffix: format!("/{}", layout.symbol()),
            macros: vec![format!("{}=1", layout.family()), format!("ARITY={}", layout.arity())],
        };
        Layout::ALL.iter().map(of).collect()
    } else if PER_ARITY.contains(&stem) {
        let of = |arity: &usize| Permutation {
            suffix: format!("/{arity}"),
            macros: vec![format!("ARITY={arity}")],
        };
        ARITIES.iter().map(of).collect()
    } else {
        vec![Permutation { suffix: String::new(), macros: Vec::new() }]
    }
}

/// The function that picks a permutation, for a source that has several.
fn choice(stem: &str) -> String {
    let function = stem.replace('/', "_");
    let symbol = function.to_uppercase();
    if PER_LAYOUT.contains(&stem) {
        let arms: String = Layout::ALL
            .iter()
            .map(|l| format!("        Layout::{l:?} => &{symbol}_{},\n", l.symbol().to_uppercase()))
            .collect();
        format!(
            "/// `src/{stem}.comp` for a layout.\npub fn {function}(layout: Layout) -> &'static Shader {{\n    match layout {{\n{arms}    }}\n}}\n"
        )
    } else if PER_ARITY.contains(&stem) {
        let arms: String = ARITIES.iter().map(|a| format!("        {a} => &{symbol}_{a},\n")).collect();
        format!(
            "/// `src/{stem}.comp` for an arity.\n///\n/// # Panics\n/// There is none of that arity.\npub fn {function}(arity: usize) -> &'static Shader {{\n    match arity {{\n{arms}        _ => panic!(\"no kernels of arity {{arity}}\"),\n    }}\n}}\n"
        )
    } else {
        String::new()
    }
}

fn find(folder: &Path, sources: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("the source tree is readable").flatten() {
        let path = entry.path();
        if path.is_dir() {
            find(&path, sources);
        } else if path.extension().is_some_and(|e| KINDS.iter().any(|kind| e == *kind)) {
            sources.push(path);
        }
    }
}

/// The two compilers that distributions package; their SPIR-V differs little.
enum Compiler {
    Glslc,
    Glslang,
}

impl Compiler {
    fn find() -> Self {
        let runs = |tool| Command::new(tool).arg("--version").output().is_ok_and(|o| o.status.success());
        if runs("glslc") {
            Self::Glslc
        } else if runs("glslangValidator") {
            Self::Glslang
        } else {
            println!(
                "cargo::error=no GLSL compiler: neither glslc nor glslangValidator is on PATH; run scripts/setup, or install glslc, glslang-tools or the Vulkan SDK"
            );
            std::process::exit(1);
        }
    }

    /// The files that the result depends on, or the compiler's messages.
    fn compile(
        &self,
        source: &Path,
        macros: &[String],
        root: &Path,
        spirv: &Path,
    ) -> Result<Vec<PathBuf>, String> {
        let depfile = spirv.with_extension("d");
        // Cargo runs this script for every change under `src/`, and most are not to shaders.
        if let Some(files) = up_to_date(spirv, &depfile, &[]) {
            return Ok(files);
        }
        // Includes are found from the shared folder and, where one stage needs another's, from `src`.
        let folders = [root.join("shaders"), root.join("src")];
        let mut command = match self {
            Self::Glslc => {
                let mut c = Command::new("glslc");
                c.arg(format!("--target-env={TARGET}")).arg("-Werror");
                for folder in &folders {
                    c.arg("-I").arg(folder);
                }
                c.arg("-MD").arg("-MF").arg(&depfile).arg("-o").arg(spirv);
                c
            }
            Self::Glslang => {
                let mut c = Command::new("glslangValidator");
                c.args(["-V", "--quiet", "--target-env", TARGET]);
                for folder in &folders {
                    c.arg(format!("-I{}", folder.display()));
                }
                c.arg("--depfile").arg(&depfile).arg("-o").arg(spirv);
                c
            }
        };
        command.args(macros.iter().map(|m| format!("-D{m}")));
        let output = command.arg(source).output().map_err(|e| e.to_string())?;
        if !output.status.success() {
            return Err(format!(
                "{}{}",
                String::from_utf8_lossy(&output.stdout),
                String::from_utf8_lossy(&output.stderr)
            ));
        }
        let read = Depfile::read(&depfile).map_err(|error| format!("{}: {error}", depfile.display()))?;
        Ok(read.dependencies)
    }
}
