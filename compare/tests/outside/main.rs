//! The program and its library from outside.

mod common;
mod diff;
mod documentation;
mod history;
#[cfg(unix)]
mod hook;
mod input;
mod reference;
mod report;
mod reports;
mod repository;
mod shell;
