//! Memory that frames leave to those after them: what the system does for new pages of a picture's size takes longer
//! than all that is written to them.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Numbers of a picture's pixels, row by row. Their memory is used again when they are dropped.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct PixelNumbers(Vec<u32>);

/// What is left, at most so many: frames that are prepared on several threads come and go together.
static SPARE: Mutex<Vec<Vec<u32>>> = Mutex::new(Vec::new());
const MOST: usize = 16;

/// Smaller ones come from memory that the process has.
const LEAST: usize = 1 << 16;

impl PixelNumbers {
    /// So many, of any value.
    pub(crate) fn of_any(count: usize) -> Self {
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        // Those of other sizes are of pictures that are no longer made.
        spare.retain(|numbers| numbers.len() == count);
        let numbers = spare.pop();
        drop(spare);
        Self(numbers.unwrap_or_else(|| vec![0; count]))
    }
}

impl From<Vec<u32>> for PixelNumbers {
    fn from(numbers: Vec<u32>) -> Self {
        Self(numbers)
    }
}

impl Deref for PixelNumbers {
    type Target = [u32];

    fn deref(&self) -> &[u32] {
        &self.0
    }
}

impl DerefMut for PixelNumbers {
    fn deref_mut(&mut self) -> &mut [u32] {
        &mut self.0
    }
}

impl Drop for PixelNumbers {
    fn drop(&mut self) {
        let numbers = std::mem::take(&mut self.0);
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        if numbers.len() >= LEAST && spare.len() < MOST {
            spare.push(numbers);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_are_as_many_as_were_asked_for() {
        for count in [LEAST + 7, LEAST, 3, LEAST + 7, 0] {
            let mut numbers = PixelNumbers::of_any(count);
            assert_eq!(numbers.len(), count);
            numbers.fill(5);
            assert_eq!(numbers.clone(), vec![5; count].into());
        }
    }
}
