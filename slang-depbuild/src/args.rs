//! The command line.

use clap::Parser;
use slang_depbuild::Job;
use std::ffi::OsString;
use std::path::PathBuf;

/// Compiles a Slang kernel together with the modules that specialise it to SPIR-V, and writes a dependency file
/// that lists every source it was made from.
///
/// Each module is compiled anew from its source in a temporary folder, so a stale .slang-module beside a source is
/// never used. The SPIR-V loses what says only where it came from, and is validated. The output is whole or the old
/// one, whatever happens.
#[derive(Debug, Parser)]
#[command(
    version,
    override_usage = "slang-depbuild [OPTIONS] KERNEL.slang -o OUT.spv [-- SLANGC'S…]",
    after_long_help = MORE,
    after_help = "--help tells more: exit status, where slangc is looked for, examples for make and CMake."
)]
pub struct Cli {
    /// The source that has the entry point
    #[arg(value_name = "KERNEL.slang")]
    kernel: PathBuf,
    /// Where to write the SPIR-V; its folder is made if there is none
    #[arg(short, long, value_name = "OUT.spv")]
    output: PathBuf,
    /// Where to write the dependencies, in make's format
    #[arg(long, value_name = "OUT.d")]
    depfile: Option<PathBuf>,
    /// Add an empty rule for each dependency, so that make does not insist on a source that is gone
    #[arg(long, requires = "depfile")]
    phony: bool,
    /// A source with values for the kernel's extern constants and types; may be given several times
    #[arg(short, long, value_name = "MODULE.slang", help_heading = "Sources")]
    specialize: Vec<PathBuf>,
    /// Where to look for imports and includes, after the folder of the source that names them
    #[arg(short = 'I', long = "include", value_name = "FOLDER", help_heading = "Sources")]
    include: Vec<PathBuf>,
    /// Define a macro for all sources
    #[arg(short = 'D', long = "define", value_name = "NAME[=VALUE]", help_heading = "Sources")]
    define: Vec<String>,
    /// The function to begin with
    #[arg(long, value_name = "NAME", default_value = "main", help_heading = "Target")]
    entry: String,
    /// Slang's profile
    #[arg(long, value_name = "PROFILE", default_value = "spirv_1_5", help_heading = "Target")]
    profile: String,
    /// What the SPIR-V tools hold the result against
    #[arg(long, value_name = "ENVIRONMENT", default_value = "vulkan1.2", help_heading = "Target")]
    target_env: String,
    /// What the kernel may use beyond the profile; may be given several times
    #[arg(long, value_name = "NAME", help_heading = "Target")]
    capability: Vec<String>,
    /// Optimize with spirv-opt -O
    #[arg(short = 'O', long, help_heading = "Result")]
    optimize: bool,
    /// Leave names in the SPIR-V
    #[arg(long, help_heading = "Result")]
    keep_names: bool,
    /// Do not validate with spirv-val
    #[arg(long, help_heading = "Result")]
    no_validate: bool,
    /// The compiler
    #[arg(long, value_name = "PATH")]
    pub slangc: Option<PathBuf>,
    /// Say nothing but why something failed
    #[arg(short, long, conflicts_with = "verbose")]
    pub quiet: bool,
    /// Say which compiler is used and which sources were read
    #[arg(short, long)]
    pub verbose: bool,
    /// More for slangc, where it compiles the kernel
    #[arg(last = true, value_name = "SLANGC'S")]
    arguments: Vec<OsString>,
}

const MORE: &str = r#"Exit status
  0  done
  1  not done: an error in a source, an invalid result, a file that cannot be written, no slangc.
     The old output and the old dependency file are as they were
  2  a wrong option

slangc
  is the one that --slangc or the environment's SLANGC names; else the one on PATH; else the newest
  that scripts/setup has put into $XDG_DATA_HOME/broadleaf (~/.local/share/broadleaf). It is run
  with -O0, because not every slangc has an optimizer; -O runs spirv-opt on the result, and a slangc
  that has one takes -- -O2. What follows -- is for the kernel; of that, the modules too get what is
  about warnings (-W…, -warnings-…), -std and -matrix-layout-…. spirv-val and spirv-opt are looked
  for on PATH, and beside slangc.

Specialisation
  In the kernel:
    extern static const int ARITY;
    extern struct Node : INode;
  In wide4.slang:
    export static const int ARITY = 4;
    export struct Node : INode = WideNode<4>;
  slang-depbuild kernel.slang --specialize wide4.slang -o kernel.spv

make
  KERNELS := closest-wide4.spv closest-wide8.spv
  all: $(KERNELS)
  closest-%.spv: closest.slang %.slang
  	slang-depbuild -q $< --specialize $*.slang -I shared \
  	    -o $@ --depfile $@.d --phony
  -include $(KERNELS:=.d)

CMake
  add_custom_command(
    OUTPUT closest-wide4.spv
    COMMAND slang-depbuild -q "${CMAKE_CURRENT_SOURCE_DIR}/closest.slang"
            --specialize "${CMAKE_CURRENT_SOURCE_DIR}/wide4.slang"
            -I "${CMAKE_CURRENT_SOURCE_DIR}/shared"
            -o closest-wide4.spv --depfile closest-wide4.d
    DEPENDS closest.slang wide4.slang
    DEPFILE closest-wide4.d
    VERBATIM)
  add_custom_target(kernels ALL DEPENDS closest-wide4.spv)
  Needs CMake 3.20 (3.21 for Visual Studio and Xcode).

Rust
  A build script depends on the library, slang_depbuild, with default-features = false."#;

impl Cli {
    pub fn job(self) -> Job {
        let mut job = Job::new(self.kernel, self.output);
        job.specializations = self.specialize;
        job.include_folders = self.include;
        job.macros = self.define;
        job.entry = self.entry;
        job.profile = self.profile;
        job.target_env = self.target_env;
        job.capabilities = self.capability;
        job.optimize = self.optimize;
        job.validate = !self.no_validate;
        job.keep_names = self.keep_names;
        job.arguments = self.arguments;
        job.depfile = self.depfile;
        job.phony = self.phony;
        job
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definition_is_sound() {
        Cli::command().debug_assert();
    }

    #[test]
    fn options_reach_the_job() {
        let line = "slang-depbuild k.slang -s a.slang --specialize b.slang -Iinc -DX=1 -O --no-validate -o k.spv -- -g2";
        let job = Cli::try_parse_from(line.split(' ')).unwrap().job();
        assert_eq!(job.specializations, [PathBuf::from("a.slang"), "b.slang".into()]);
        assert_eq!((&job.include_folders[..], &job.macros[..]), (&["inc".into()][..], &["X=1".into()][..]));
        assert!(job.optimize && !job.validate && !job.keep_names);
        assert_eq!(
            (&job.entry[..], &job.profile[..], &job.target_env[..]),
            ("main", "spirv_1_5", "vulkan1.2")
        );
        assert_eq!(job.arguments, ["-g2"]);
    }
}
