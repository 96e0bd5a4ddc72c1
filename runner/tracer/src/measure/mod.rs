//! What can be said in numbers about trees and runs.

pub mod tree;
