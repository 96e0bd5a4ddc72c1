//! Compiles a Slang kernel together with its specialisation modules by driving `slangc`, and says which files
//! the result was made from.
//!
//! ```no_run
//! use slang_depbuild::{Job, Slangc, compile, up_to_date};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let slangc = Slangc::find()?;
//! let mut job = Job::new("closest.slang", "closest.spv");
//! job.specializations = vec!["wide4.slang".into()];
//! job.depfile = Some("closest.d".into());
//! let sources = match up_to_date(&job.output, "closest.d".as_ref(), &[slangc.path()]) {
//!     Some(sources) => sources,
//!     None => compile(&slangc, &job)?.dependencies,
//! };
//! # Ok(())
//! # }
//! ```
//!
//! `slangc` alone does not do for a build, for three reasons. Its dependency file for a kernel leaves out the
//! sources of the modules that the kernel is specialised with. When it finds `wide4.slang-module` beside
//! `wide4.slang`, it reads that one, however old it is, and does not list the source at all. And older
//! validators and drivers refuse what it says about the source language. So every module is compiled anew in a
//! temporary folder, from a copy of the sources in which there is nothing else ([`compile`]), the module is
//! cleaned ([`spirv::clean`]), and the dependency files are put together ([`Depfile`]).

mod compile;
mod depfile;
mod file;
mod mirror;
mod slangc;
pub mod spirv;

pub use compile::{Compiled, Error, Job, Validation, compile};
pub use depfile::{Depfile, Unwritable, up_to_date};
pub use slangc::{Missing, Slangc};
