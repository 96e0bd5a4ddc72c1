//! From a kernel and its specialisation modules to a SPIR-V module.

use crate::depfile::{Depfile, Unwritable};
use crate::file::Pending;
use crate::mirror::Mirror;
use crate::slangc::Slangc;
use crate::spirv;
use std::collections::{BTreeSet, HashSet};
use std::ffi::OsString;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::time::SystemTime;
use tempfile::TempDir;

/// What is to be compiled, and how.
#[derive(Clone, Debug)]
pub struct Job {
    /// The source that has the entry point.
    pub kernel: PathBuf,
    /// Sources with the `export`s for the kernel's `extern` constants and types.
    pub specializations: Vec<PathBuf>,
    /// Where imports and includes are looked for, after the folder of the source that names them.
    pub include_folders: Vec<PathBuf>,
    /// `NAME` or `NAME=VALUE`, for all sources.
    pub macros: Vec<String>,
    /// The function to begin with.
    pub entry: String,
    /// Slang's profile.
    pub profile: String,
    /// What the SPIR-V tools are to hold the module against.
    pub target_env: String,
    /// What the kernel may use beyond the profile.
    pub capabilities: Vec<String>,
    /// Run `spirv-opt -O` on the result.
    pub optimize: bool,
    /// Hold the result against the rules of the target environment, with `scalarBlockLayout`.
    pub validate: bool,
    /// Leave names in the result.
    pub keep_names: bool,
    /// More for `slangc`, where it compiles the kernel. Those on warnings, the standard and the layout of
    /// matrices it is given for the modules, too.
    pub arguments: Vec<OsString>,
    /// Where the SPIR-V goes.
    pub output: PathBuf,
    /// Where the dependencies go.
    pub depfile: Option<PathBuf>,
    /// Add an empty rule for each dependency, so that make does not insist on one that is gone.
    pub phony: bool,
}

impl Job {
    /// A kernel alone, for Vulkan 1.2, to be validated and not optimized.
    pub fn new(kernel: impl Into<PathBuf>, output: impl Into<PathBuf>) -> Self {
        Self {
            kernel: kernel.into(),
            specializations: Vec::new(),
            include_folders: Vec::new(),
            macros: Vec::new(),
            entry: "main".into(),
            profile: "spirv_1_5".into(),
            target_env: "vulkan1.2".into(),
            capabilities: Vec::new(),
            optimize: false,
            validate: true,
            keep_names: false,
            arguments: Vec::new(),
            output: output.into(),
            depfile: None,
            phony: false,
        }
    }
}

/// What became of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compiled {
    /// Every source that was read: the kernel, its specialisation modules as they were given, and the others
    /// in alphabetical order. The paths are absolute.
    pub dependencies: Vec<PathBuf>,
    /// The compiler's warnings, or nothing.
    pub messages: String,
    /// Whether the result keeps to the rules.
    pub validation: Validation,
}

/// What is known of the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Validation {
    /// It is valid.
    Passed,
    /// It was not to be validated.
    NotAsked,
    /// There is no `spirv-val`.
    NoValidator,
}

/// Why there is no result. The output of an earlier run is as it was.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The job makes no sense.
    #[error("{0}")]
    Usage(String),
    /// The compiler does not like a source.
    #[error("{0}")]
    Rejected(String),
    /// The compiler, or another tool, ended as none should.
    #[error("{} broke down ({status}){}", program.display(), after_line(messages))]
    Crashed {
        /// Which.
        program: PathBuf,
        /// How it ended.
        status: std::process::ExitStatus,
        /// What it said.
        messages: String,
    },
    /// What the compiler wrote is no SPIR-V.
    #[error("{}: {damage}", kernel.display())]
    Damaged {
        /// From which kernel.
        kernel: PathBuf,
        /// What is wrong.
        damage: spirv::Damaged,
    },
    /// The result breaks the rules of the target environment.
    #[error("{}: the SPIR-V is not valid for {target_env}{}", kernel.display(), after_line(messages))]
    Invalid {
        /// From which kernel.
        kernel: PathBuf,
        /// Whose rules.
        target_env: String,
        /// What the validator said.
        messages: String,
    },
    /// There is no optimizer.
    #[error(
        "no spirv-opt, which optimizing needs: install spirv-tools or the Vulkan SDK, or do not optimize"
    )]
    NoOptimizer,
    /// A name cannot be in a dependency file.
    #[error(transparent)]
    Unwritable(#[from] Unwritable),
    /// A file cannot be read or written, or a program cannot be run.
    #[error("{}: {why}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// Why not.
        why: io::Error,
    },
}

fn after_line(messages: &str) -> String {
    if messages.is_empty() { String::new() } else { format!(":\n{}", messages.trim_end()) }
}

/// Compiles a kernel, and writes its SPIR-V and its dependency file, each whole or not at all.
///
/// The files bear the time at which the sources were read, so one that is changed meanwhile is newer.
///
/// # Errors
/// There is no result; [`Error`] says why.
pub fn compile(slangc: &Slangc, job: &Job) -> Result<Compiled, Error> {
    check(job)?;
    let started = SystemTime::now();
    let folder =
        tempfile::Builder::new().prefix("slang-depbuild-").tempdir().map_err(at(&std::env::temp_dir()))?;
    let build = Build::new(slangc, job, &folder)?;

    let mut modules = Vec::new();
    for specialization in &build.specializations {
        modules.push(build.module(specialization)?);
    }
    let kernel = build.kernel(&modules)?;
    let messages: String = modules.iter().chain([&kernel]).map(|made| &made.messages[..]).collect();

    let module = fs::read(&kernel.output).map_err(at(&kernel.output))?;
    let damaged = |damage| Error::Damaged { kernel: job.kernel.clone(), damage };
    let mut module = spirv::clean(&module, job.keep_names).map_err(damaged)?;
    if job.optimize {
        module = build.optimized(&module)?;
    }
    let validation = if job.validate { build.validate(&module)? } else { Validation::NotAsked };

    let sources: Vec<&Source> = [&build.kernel].into_iter().chain(&build.specializations).collect();
    let read = modules.into_iter().chain([kernel]).flat_map(|made| made.read).collect();
    let dependencies = in_order(sources.into_iter().map(|source| source.path.clone()), read);
    write(job, &module, &dependencies, started)?;
    Ok(Compiled { dependencies, messages, validation })
}

/// What slangc would misunderstand without a word, or what would lead it back to the source tree.
fn check(job: &Job) -> Result<(), Error> {
    // By the names of their files slangc tells modules apart.
    let mut stems = HashSet::new();
    for specialization in &job.specializations {
        if !stems.insert(specialization.file_stem()) {
            let name = specialization.display();
            return Err(Error::Usage(format!(
                "{name}: another specialisation module has that name, and slangc would use one of them only"
            )));
        }
    }
    for argument in &job.arguments {
        let text = argument.to_string_lossy();
        let ours = ["-I", "-o", "-r", "-depfile", "-target", "-entry", "-profile"];
        if ours.iter().any(|name| *name == text) || text.starts_with("-I") {
            return Err(Error::Usage(format!(
                "{text}: slang-depbuild itself has to know that; give it before the --, as in --help"
            )));
        }
    }
    Ok(())
}

fn write(job: &Job, module: &[u8], dependencies: &[PathBuf], started: SystemTime) -> Result<(), Error> {
    let output = Pending::new(&job.output, module).map_err(at(&job.output))?;
    let depfile = match &job.depfile {
        None => None,
        Some(path) => {
            let depfile = Depfile { target: job.output.clone(), dependencies: dependencies.to_vec() };
            Some((path, Pending::new(path, &depfile.text(job.phony)?).map_err(at(path))?))
        }
    };
    output.commit(started).map_err(at(&job.output))?;
    if let Some((path, depfile)) = depfile {
        depfile.commit(started).map_err(at(path))?;
    }
    Ok(())
}

/// First the given ones, then the others by name, and none twice.
fn in_order(first: impl Iterator<Item = PathBuf>, others: BTreeSet<PathBuf>) -> Vec<PathBuf> {
    let mut seen = HashSet::new();
    first.chain(others).filter(|path| seen.insert(path.clone())).collect()
}

fn at(path: &Path) -> impl FnOnce(io::Error) -> Error + use<> {
    let path = path.to_owned();
    |why| Error::Io { path, why }
}

/// A source that was named, and its copy in the mirror.
struct Source {
    path: PathBuf,
    copy: PathBuf,
}

/// What a run of the compiler has made, and from what.
struct Made {
    output: PathBuf,
    read: BTreeSet<PathBuf>,
    messages: String,
}

/// One compilation in its temporary folder.
struct Build<'a> {
    slangc: &'a Slangc,
    job: &'a Job,
    folder: PathBuf,
    mirror: Mirror,
    kernel: Source,
    specializations: Vec<Source>,
    include_folders: Vec<PathBuf>,
}

impl<'a> Build<'a> {
    fn new(slangc: &'a Slangc, job: &'a Job, folder: &TempDir) -> Result<Self, Error> {
        let folder = fs::canonicalize(folder).map_err(at(folder.path()))?;
        let sources = folder.join("sources");
        let mut mirror = Mirror::new(sources.clone());
        let mut source = |given: &PathBuf| {
            let (path, copy) = mirror.add_source(given).map_err(at(given))?;
            Ok(Source { path, copy })
        };
        let kernel = source(&job.kernel)?;
        let specializations = job.specializations.iter().map(source).collect::<Result<_, Error>>()?;
        let mut include_folders = Vec::new();
        for given in &job.include_folders {
            include_folders.push(mirror.add_folder(given).map_err(at(given))?);
        }
        for text in &job.macros {
            mirror.add_words(text.as_bytes());
        }
        for text in &job.arguments {
            mirror.add_words(text.as_encoded_bytes());
        }
        mirror.complete().map_err(at(&sources))?;
        Ok(Self { slangc, job, folder, mirror, kernel, specializations, include_folders })
    }

    fn module(&self, specialization: &Source) -> Result<Made, Error> {
        let name = specialization.path.with_extension("slang-module");
        let output = self.folder.join(name.file_name().expect("it was found in a folder"));
        let mut command = self.command();
        command.arg(&specialization.copy).args(for_modules(&self.job.arguments));
        self.make(command, output)
    }

    fn kernel(&self, modules: &[Made]) -> Result<Made, Error> {
        let mut command = self.command();
        command.arg(&self.kernel.copy);
        for module in modules {
            command.arg("-r").arg(&module.output);
        }
        command.args(["-target", "spirv", "-profile", &self.job.profile, "-entry", &self.job.entry]);
        // Not every slangc has an optimizer; the kernel's own arguments can ask for it.
        command.arg("-O0").args(&self.job.arguments);
        self.make(command, self.folder.join("kernel.spv"))
    }

    /// What all sources are compiled with.
    fn command(&self) -> Command {
        let mut command = Command::new(self.slangc.path());
        for folder in &self.include_folders {
            command.arg("-I").arg(folder);
        }
        for text in &self.job.macros {
            let text = self.mirror.redirected(text.as_bytes());
            command.arg(format!("-D{}", String::from_utf8_lossy(&text)));
        }
        for capability in &self.job.capabilities {
            command.args(["-capability", capability]);
        }
        command
    }

    fn make(&self, mut command: Command, output: PathBuf) -> Result<Made, Error> {
        let depfile = output.with_extension("d");
        command.arg("-depfile").arg(&depfile).arg("-o").arg(&output);
        let ended = command.output().map_err(at(self.slangc.path()))?;
        let messages = self.mirror.with_originals(&said(&ended));
        // It ends with a signal, and on Windows with a huge number, where it crashes.
        if !ended.status.success() && !ended.status.code().is_some_and(|code| (1..=255).contains(&code)) {
            let program = self.slangc.path().to_owned();
            return Err(Error::Crashed { program, status: ended.status, messages });
        }
        if !ended.status.success() || !output.is_file() {
            return Err(Error::Rejected(if messages.is_empty() {
                format!("{}: {}", self.slangc.path().display(), ended.status)
            } else {
                messages
            }));
        }
        let listed = Depfile::read(&depfile).map_err(at(&depfile))?.dependencies;
        let read = listed.into_iter().filter_map(|path| self.original(path)).collect();
        Ok(Made { output, read, messages })
    }

    /// The file that the compiler lists, unless it is one of those that were made here.
    fn original(&self, listed: PathBuf) -> Option<PathBuf> {
        match self.mirror.original(&listed) {
            Some(original) => Some(original.clone()),
            None if listed.starts_with(&self.folder) => None,
            None => Some(listed),
        }
    }

    fn optimized(&self, module: &[u8]) -> Result<Vec<u8>, Error> {
        let program = self.slangc.companion("spirv-opt").ok_or(Error::NoOptimizer)?;
        let (before, after) = (self.folder.join("cleaned.spv"), self.folder.join("optimized.spv"));
        fs::write(&before, module).map_err(at(&before))?;
        let target = format!("--target-env={}", self.job.target_env);
        let ended = Command::new(&program).arg("-O").arg(target).arg(&before).arg("-o").arg(&after).output();
        let ended = ended.map_err(at(&program))?;
        if !ended.status.success() {
            return Err(Error::Crashed { program, status: ended.status, messages: said(&ended) });
        }
        fs::read(&after).map_err(at(&after))
    }

    fn validate(&self, module: &[u8]) -> Result<Validation, Error> {
        let Some(program) = self.slangc.companion("spirv-val") else { return Ok(Validation::NoValidator) };
        let path = self.folder.join("result.spv");
        fs::write(&path, module).map_err(at(&path))?;
        let target = &self.job.target_env;
        let ended = Command::new(&program)
            .args(["--target-env", target, "--scalar-block-layout"])
            .arg(&path)
            .output();
        let ended = ended.map_err(at(&program))?;
        if ended.status.success() {
            Ok(Validation::Passed)
        } else {
            let kernel = self.job.kernel.clone();
            Err(Error::Invalid { kernel, target_env: target.clone(), messages: said(&ended) })
        }
    }
}

fn said(ended: &Output) -> String {
    let text = |bytes| String::from_utf8_lossy(bytes).into_owned();
    text(&ended.stdout) + &text(&ended.stderr)
}

/// Of the arguments for the kernel, those that concern any source. The others are about a target, which a
/// module has not got: slangc refuses them there, or writes something else.
fn for_modules(arguments: &[OsString]) -> Vec<&OsString> {
    let mut kept = Vec::new();
    let mut rest = arguments.iter();
    while let Some(argument) = rest.next() {
        let text = argument.to_string_lossy();
        if text.starts_with("-W") || text.starts_with("-matrix-layout-") {
            kept.push(argument);
        } else if ["-warnings-as-errors", "-warnings-disable", "-std"].iter().any(|name| *name == text) {
            kept.push(argument);
            kept.extend(rest.next());
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modules_get_what_is_about_sources() {
        let given = ["-O2", "-Wno-1", "-fp-mode", "fast", "-warnings-as-errors", "all", "-stage", "compute"];
        let given = given.map(OsString::from);
        assert_eq!(for_modules(&given), ["-Wno-1", "-warnings-as-errors", "all"]);
    }

    #[test]
    fn what_slangc_would_misunderstand_is_refused() {
        let mut job = Job::new("k.slang", "k.spv");
        job.specializations = vec!["a/wide4.slang".into(), "b/wide4.slang".into()];
        assert!(matches!(check(&job), Err(Error::Usage(why)) if why.starts_with("b/wide4.slang: another")));
        job.specializations.pop();
        assert!(check(&job).is_ok());
        for argument in ["-Iinclude", "-I", "-depfile", "-r"] {
            job.arguments = vec![argument.into()];
            assert!(matches!(check(&job), Err(Error::Usage(why)) if why.starts_with(argument)));
        }
    }
}
