//! Command line of runner.
fn main() {}
