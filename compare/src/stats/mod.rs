//! What a change is worth: how sure the ratio of two rates is, and whether chance explains it.
//!
//! A [`Cell`] is one figure of one point on two sides, old and new. A figure is a sum over [`Group`]s, such as the
//! views, of the mean (or median) of the group's values: the rate of a point is the mean over its views of the mean
//! over a view's samples. Everything here keeps to three rules:
//!
//! - **Views are chosen, not drawn.** What is resampled are samples within a view; a change that holds for these
//!   views is all that is claimed.
//! - **Samples of a run need not be independent.** A clock that sinks for a while pulls neighbours along, so
//!   neighbours that resemble each other are joined before anything is computed ([`blocks`]). What no statistic can
//!   see is what sets one run apart from the next as a whole, because there is one run on each side: where things
//!   lie in memory, the room's temperature. That is what the practical threshold of a verdict is for.
//! - **Few samples claim little.** The test is exact under exchange of samples whatever their number: with three
//!   samples of a single view on each side its smallest p is 1/10, so nothing can become significant. The interval
//!   is widened as Student's t is against the normal distribution, and there is none of fewer than two samples.

pub mod blocks;
mod cell;
mod deck;
mod holm;
mod interval;
mod permutation;
mod power;
mod random;

pub use cell::{Cell, Group, Middle, least_p, ways};
pub use holm::holm;
pub use interval::{Interval, LEVEL, intervals, intervals_of_joined, intervals_of_samples};
pub use permutation::{PValues, p_values, permutations};
pub use power::{Goal, samples};
pub use random::Random;

#[cfg(test)]
mod scipy;
#[cfg(test)]
mod simulation;
