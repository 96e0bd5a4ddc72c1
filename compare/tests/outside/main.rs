//! The program and its library from outside.

mod common;
mod diff;
mod documentation;
mod input;
mod reference;
mod reports;
mod shell;
