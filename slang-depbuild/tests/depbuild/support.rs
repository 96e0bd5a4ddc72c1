//! A small tree of sources to compile.

use slang_depbuild::{Compiled, Error, Job, Slangc, compile, up_to_date};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, SystemTime};
use tempfile::TempDir;

/// The compiler, or a line that says what is skipped.
pub fn slangc() -> Option<Slangc> {
    match Slangc::find() {
        Ok(slangc) => Some(slangc),
        Err(missing) => {
            let test = std::thread::current().name().unwrap_or("a test").to_owned();
            eprintln!("skipped: {test}: {missing}");
            None
        }
    }
}

/// Is there such a program? If not, says what is skipped.
pub fn has(program: &str) -> bool {
    let runs = Command::new(program).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    let runs = runs.is_ok_and(|status| status.success());
    if !runs {
        eprintln!("skipped: there is no {program} here");
    }
    runs
}

const SOURCES: &[(&str, &str)] = &[
    (
        "kernel.slang",
        "#include \"scale.h\"\nimport node;\nextern static const int ARITY;\nextern struct Node : INode;\n\
         [[vk::binding(0)]] RWStructuredBuffer<float> boxes;\n[shader(\"compute\")] [numthreads(64, 1, 1)]\n\
         void main(uint3 id : SV_DispatchThreadID) { Node node; boxes[id.x] = node.area() * ARITY * SCALE; }\n",
    ),
    ("scale.h", "#define SCALE 3\n"),
    (
        "shared/node.slang",
        "module node;\nimport \"deep/er\";\npublic interface INode { __init(); float area(); }\n",
    ),
    ("shared/deep/er.slang", "module er;\npublic float deep() { return 5; }\n"),
    (
        "wide4.slang",
        "import node;\nexport static const int ARITY = 4;\nexport struct Node : INode = Flat;\n\
      public struct Flat : INode { public __init() {} public float area() { return 2; } }\n",
    ),
    (
        "wide8.slang",
        "import node;\nexport static const int ARITY = 8;\nexport struct Node : INode = Flat;\n\
      public struct Flat : INode { public __init() {} public float area() { return 2; } }\n",
    ),
    (
        "deep4.slang",
        "import node;\nimport \"shared/deep/er\";\nexport static const int ARITY = 4;\n\
      export struct Node : INode = Deep;\n\
      public struct Deep : INode { public __init() {} public float area() { return deep(); } }\n",
    ),
    ("unrelated.slang", "this is no source\n"),
];

/// The sources in a folder of their own.
pub struct Tree {
    _folder: TempDir,
    pub root: PathBuf,
    pub slangc: Slangc,
}

impl Tree {
    pub fn new() -> Option<Self> {
        Self::called("tree")
    }

    pub fn called(name: &str) -> Option<Self> {
        let slangc = slangc()?;
        let folder = tempfile::tempdir().unwrap();
        let root = fs::canonicalize(folder.path()).unwrap().join(name);
        let tree = Self { _folder: folder, root, slangc };
        for (file, text) in SOURCES {
            tree.write(file, text);
        }
        Some(tree)
    }

    pub fn path(&self, file: &str) -> PathBuf {
        self.root.join(file)
    }

    pub fn write(&self, file: &str, text: &str) {
        let path = self.path(file);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    }

    pub fn replace(&self, file: &str, from: &str, to: &str) {
        let text = fs::read_to_string(self.path(file)).unwrap();
        assert!(text.contains(from), "{file} has no {from}");
        self.write(file, &text.replace(from, to));
    }

    /// The kernel with one of the specialisations.
    pub fn job(&self, specialization: &str) -> Job {
        let mut job = Job::new(self.path("kernel.slang"), self.path("out/kernel.spv"));
        job.specializations = vec![self.path(specialization)];
        job.include_folders = vec![self.path("shared")];
        job.depfile = Some(self.path("out/kernel.d"));
        job
    }

    pub fn compile(&self, job: &Job) -> Result<Compiled, Error> {
        compile(&self.slangc, job)
    }

    /// The SPIR-V of a job.
    pub fn spirv(&self, job: &Job) -> Vec<u8> {
        self.compile(job).unwrap_or_else(|error| panic!("{error}"));
        fs::read(&job.output).unwrap()
    }

    /// Compiles what is not up to date, and says whether that was so.
    pub fn rebuild(&self, job: &Job) -> bool {
        let depfile = job.depfile.as_ref().unwrap();
        let stale = up_to_date(&job.output, depfile, &[self.slangc.path()]).is_none();
        if stale {
            self.compile(job).unwrap_or_else(|error| panic!("{error}"));
        }
        stale
    }

    /// Makes a file newer than all that was made before.
    pub fn touch(&self, file: &str) {
        // Clocks of file systems tick some hundred times a second.
        std::thread::sleep(Duration::from_millis(20));
        let file = fs::File::options().append(true).open(self.path(file)).unwrap();
        file.set_modified(SystemTime::now()).unwrap();
    }

    /// Makes a module of a source and leaves it beside it, as other builds do.
    pub fn leave_module(&self, file: &str) {
        let source = self.path(file);
        let status = Command::new(self.slangc.path())
            .arg(&source)
            .arg("-I")
            .arg(self.path("shared"))
            .arg("-o")
            .arg(source.with_extension("slang-module"))
            .status();
        assert!(status.unwrap().success());
    }
}

/// Makes a program of a script. A child writes it: if this process did, another test's child could hold it open
/// for writing at the moment when it is to be run.
#[cfg(unix)]
pub fn script(path: &Path, text: &str) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    let write = "printf '#!/bin/sh\\n%s\\n' \"$2\" >\"$1\" && chmod 755 \"$1\"";
    let status = Command::new("sh").args(["-c", write, "sh"]).arg(path).arg(text).status();
    assert!(status.unwrap().success());
}

pub fn modified(path: &Path) -> SystemTime {
    fs::metadata(path).unwrap().modified().unwrap()
}

/// The opcodes of a module.
pub fn opcodes(spirv: &[u8]) -> Vec<u16> {
    let words: Vec<u32> = spirv.chunks_exact(4).map(|w| u32::from_le_bytes(w.try_into().unwrap())).collect();
    let (mut at, mut found) = (5, Vec::new());
    while at < words.len() {
        found.push((words[at] & 0xffff) as u16);
        at += (words[at] >> 16) as usize;
    }
    found
}
