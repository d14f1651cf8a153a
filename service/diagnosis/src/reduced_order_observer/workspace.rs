//! Buffers that all observers of a diagnoser share.

use super::{filter::Filter, observer_pair::PairRoom};
use crate::{
    matrix::Matrix,
    zonotope::{Reducer, Reduction},
};

/// Room for one step of one observer.
#[derive(Clone, Debug)]
pub(super) struct Workspace {
    pub observers: PairRoom,
    /// The diagonal of S.
    pub mask: Vec<f64>,
    pub centre: Vec<f64>,
    /// w' top(H).
    pub image: Vec<f64>,
    /// A_S H and what a gap appends.
    pub product: Matrix,
    /// A_S.
    pub dynamics: Matrix,
    pub reducer: Reducer,
}

impl Workspace {
    /// Room for these observers of n = `states` and p = `outputs`.
    pub fn new<'a>(states: usize, outputs: usize, filters: impl Iterator<Item = &'a Filter>) -> Self {
        let columns = filters.map(Filter::product_capacity).max().unwrap_or(0);
        Self {
            observers: PairRoom::new(states, outputs),
            mask: vec![0.0; outputs],
            centre: vec![0.0; states],
            image: vec![0.0; columns],
            product: Matrix::with_capacity(states, columns),
            dynamics: Matrix::zeros(states, states),
            reducer: Reducer::new(Reduction::Euclidean, states, columns),
        }
    }
}
