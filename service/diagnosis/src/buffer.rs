//! A list whose room survives a copy.

use std::ops::{Deref, DerefMut};

/// A list that is filled anew at every step: a copy has the room of the original, so that neither allocates.
///
/// A plain [`Vec`] keeps its elements when cloned, but not its room.
#[derive(Debug, Default, PartialEq)]
pub struct Buffer<T>(Vec<T>);

impl<T> Buffer<T> {
    /// An empty list with this room.
    pub fn with_capacity(room: usize) -> Self {
        Self(Vec::with_capacity(room))
    }
}

impl<T: Clone> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        let mut copy = Vec::with_capacity(self.0.capacity());
        copy.extend_from_slice(&self.0);
        Self(copy)
    }
}

impl<T> Deref for Buffer<T> {
    type Target = Vec<T>;

    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T> DerefMut for Buffer<T> {
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.0
    }
}

impl<'a, T> IntoIterator for &'a Buffer<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_copy_has_the_room_of_the_original() {
        let mut original = Buffer::with_capacity(8);
        original.push(1);
        let copy = original.clone();
        assert_eq!(*copy, [1]);
        assert!(copy.capacity() >= 8);
    }
}
