//! What hides what comes later: of squares of pixels, how near all of them show something.
//!
//! Greene, Kass and Miller 1993, "Hierarchical Z-buffer visibility", with one level: what is asked
//! for is small, or seen.

/// Of squares of a band's pixels the least inverse depth behind which nothing is seen.
#[derive(Debug, Default)]
pub(super) struct Squares {
    across: usize,
    /// Row by row.
    least: Vec<f32>,
    /// Whether something was drawn since; then it may be more.
    is_old: Vec<bool>,
}

/// Some of a band's pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Block {
    /// From the first to before the last; not empty.
    pub(super) columns: [u32; 2],
    /// The same, from the band's first row on.
    pub(super) rows: [u32; 2],
}

/// Pixels along a side of a square.
const SIDE: usize = 8;

impl Squares {
    /// Of a band in which anything may have been drawn.
    pub(super) fn begin(&mut self, width: usize, rows: usize) {
        self.across = width.div_ceil(SIDE);
        let count = self.across * rows.div_ceil(SIDE);
        self.least.clear();
        self.least.resize(count, 0.0);
        self.is_old.clear();
        self.is_old.resize(count, true);
    }

    /// Something was drawn in a block.
    #[inline(always)]
    pub(super) fn draw(&mut self, block: &Block) {
        let [rows, columns] = squares(block);
        for row in rows[0]..=rows[1] {
            let start = row * self.across;
            self.is_old[start + columns[0]..=start + columns[1]].fill(true);
        }
    }

    /// Whether nothing that lies in a block, no nearer than that inverse depth, would be seen, as far as
    /// squares are known.
    #[inline(always)]
    pub(super) fn hid(&self, block: &Block, inverse_depth: f32) -> bool {
        let [rows, columns] = squares(block);
        for row in rows[0]..=rows[1] {
            let start = row * self.across;
            for least in &self.least[start + columns[0]..=start + columns[1]] {
                if *least <= inverse_depth {
                    return false;
                }
            }
        }
        true
    }

    /// The same, by what the band's pixels show now.
    #[inline(always)]
    pub(super) fn hide(
        &mut self,
        keys: &[u64],
        width: usize,
        block: &Block,
        inverse_depth: f32,
    ) -> bool {
        let [rows, columns] = squares(block);
        for row in rows[0]..=rows[1] {
            for column in columns[0]..=columns[1] {
                let square = row * self.across + column;
                if self.least[square] > inverse_depth {
                    continue;
                }
                if !self.is_old[square] {
                    return false;
                }
                self.is_old[square] = false;
                self.least[square] = least(keys, width, row * SIDE, column * SIDE);
                if self.least[square] <= inverse_depth {
                    return false;
                }
            }
        }
        true
    }
}

/// The rows and the columns of squares that have a block's pixels, the last included.
#[inline(always)]
fn squares(block: &Block) -> [[usize; 2]; 2] {
    [block.rows, block.columns].map(|[from, to]| [from as usize / SIDE, (to - 1) as usize / SIDE])
}

/// Of the square from a row and a column on.
#[inline(always)]
fn least(keys: &[u64], width: usize, row: usize, column: usize) -> f32 {
    let columns = column..(column + SIDE).min(width);
    // The bits of what is not negative have its order, and signed numbers are compared faster.
    let mut least = [i64::MAX; SIDE];
    for keys in keys.chunks_exact(width).skip(row).take(SIDE) {
        let keys = &keys[columns.clone()];
        if let Ok(keys) = <&[u64; SIDE]>::try_from(keys) {
            for k in 0..SIDE {
                least[k] = least[k].min(keys[k] as i64);
            }
        } else {
            for (least, key) in least.iter_mut().zip(keys) {
                *least = (*least).min(*key as i64);
            }
        }
    }
    let least = least.iter().min().copied().unwrap_or(0);
    f32::from_bits((least >> 32) as u32)
}
