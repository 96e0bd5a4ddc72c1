//! Tables for papers and pages: `compare latex` and `compare markdown`.
//!
//! Data flows one way: records → [`Input`] → a [`Kind`] makes each [`Table`] → a writer, [`latex`] or
//! [`markdown`]. A table knows no markup, and a writer knows no record. A new kind of table is a file of its own
//! and a variant of [`Kind`].

mod best;
mod bounces;
mod builds;
mod cell;
mod choice;
pub mod command;
mod input;
mod kind;
pub mod latex;
pub mod markdown;
mod memory;
mod method;
mod resources;
mod roofline;
mod rows;
#[cfg(test)]
mod sample;
mod scene;
mod single_kernel;
mod table;
mod tests_per_ray;
mod traversal_cost;
mod workgroup;

pub use cell::{Cell, Content, Emphasis};
pub use input::{Input, check_reference};
pub use kind::Kind;
pub use table::{Align, Column, Row, Table};

#[cfg(test)]
mod tests;
