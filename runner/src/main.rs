//! Command line of runner.

#[allow(dead_code)] // Until `run` fills in the record's first fields.
mod host;
#[allow(dead_code)] // Until `run` measures a view.
mod telemetry;

fn main() {}
