//! Memory that frames leave to those after them: what the system does for new pages of a picture's size takes longer
//! than all that is written to them.

use std::ops::{Deref, DerefMut};
use std::sync::{Mutex, PoisonError};

/// Numbers of a picture's pixels, row by row.
#[derive(Debug, Default)]
pub struct PixelNumbers {
    numbers: Vec<u32>,
    /// Whether others like them will be asked for: then their memory is used again when they are dropped.
    is_asked_for: bool,
}

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
        Self {
            numbers: numbers.unwrap_or_else(|| vec![0; count]),
            is_asked_for: true,
        }
    }
}

impl Clone for PixelNumbers {
    fn clone(&self) -> Self {
        self.numbers.clone().into()
    }
}

impl PartialEq for PixelNumbers {
    fn eq(&self, other: &Self) -> bool {
        self.numbers == other.numbers
    }
}

impl From<Vec<u32>> for PixelNumbers {
    fn from(numbers: Vec<u32>) -> Self {
        Self {
            numbers,
            is_asked_for: false,
        }
    }
}

impl Deref for PixelNumbers {
    type Target = [u32];

    fn deref(&self) -> &[u32] {
        &self.numbers
    }
}

impl DerefMut for PixelNumbers {
    fn deref_mut(&mut self) -> &mut [u32] {
        &mut self.numbers
    }
}

impl Drop for PixelNumbers {
    fn drop(&mut self) {
        let numbers = std::mem::take(&mut self.numbers);
        if !self.is_asked_for || numbers.len() < LEAST {
            return;
        }
        let mut spare = SPARE.lock().unwrap_or_else(PoisonError::into_inner);
        if spare.len() < MOST {
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

    #[test]
    fn what_nobody_asks_for_again_is_not_kept() {
        let count = LEAST + 31;
        let numbers = PixelNumbers::from(vec![7; count]);
        let copy = numbers.clone();
        drop((numbers, copy));
        // New memory is zero.
        let asked = [PixelNumbers::of_any(count), PixelNumbers::of_any(count)];
        assert!(asked.iter().all(|asked| asked.iter().all(|n| *n == 0)));
    }
}
