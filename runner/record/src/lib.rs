//! The benchmark record.
