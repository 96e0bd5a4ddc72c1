//! Drives the real binary against stand-ins for NVML, for amdgpu's files and for the services on D-Bus.

mod amd;
mod clocks;
mod command;
mod faults;
mod machine;
mod nobody;
mod restore;
mod rights;
mod screen;
