//! Drives the library and the program with the real slangc. Where there is none, each test says so and passes.

mod build_systems;
mod command;
mod library;
mod support;
