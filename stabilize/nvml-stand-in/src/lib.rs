//! A stand-in for NVIDIA's management library, NVML, for tests.
//!
//! It is a shared library with NVML's own function names. Its GPUs live in a JSON file, a [`State`],
//! whose path is in the environment variable [`STATE_VARIABLE`]: every call reads it, and what the call
//! changes is written back before it returns. So a test says what there is by writing the file, runs a
//! program that loads `libnvidia-ml.so.1`, and reads from the file what the program has left behind,
//! however it ended. [`Fault`]s make chosen calls fail, lag, or lie.
//!
//! ```no_run
//! use nvml_stand_in::{STATE_VARIABLE, State, install};
//! use std::{path::Path, process::Command};
//!
//! let folder = Path::new("/somewhere/temporary");
//! install(folder);
//! let path = folder.join("state.json");
//! let first = State { root_only: false, ..State::example() };
//! first.write(&path).unwrap();
//! Command::new("stabilize")
//!     .args(["--", "true"])
//!     .env("LD_LIBRARY_PATH", folder)
//!     .env(STATE_VARIABLE, &path)
//!     .status()
//!     .unwrap();
//! let last = State::read(&path).unwrap();
//! assert_eq!(last.gpus[0].settings(), first.gpus[0].settings());
//! ```
//!
//! # Where the library is
//!
//! A dependency on this crate is enough. Cargo compiles all crate types of a library at once, and gives
//! shared libraries of path dependencies no hash, so whatever is linked against the rlib finds the
//! shared library of the same build beside it: `target/<profile>/deps/libnvml_stand_in.so`. That holds
//! for a dev-dependency too, with `cargo test -p …` as with `cargo test --workspace`. [`library`] looks
//! there.
//!
//! # What it leaves out
//!
//! The GPUs do no work: without a lock they stay at their idle clocks. A change of the settings stays
//! when the last client leaves, whether persistence mode is on or not. All memory clocks have the same
//! graphics clocks. Names for clocks (`NVML_CLOCK_LIMIT_ID_*`) are refused.

#[expect(non_upper_case_globals, reason = "the names are NVML's")]
mod c;
mod fault;
mod gpu;
mod install;
mod state;

pub use c::FUNCTIONS;
pub use fault::{ErrorCode, Fault, FaultKind};
pub use gpu::{COUNTERS, Gpu, Ramp, Settings};
pub use install::{install, install_without, library};
pub use state::{STATE_VARIABLE, State};
