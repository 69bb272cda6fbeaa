//! The order in which points are inserted: a biased random one, along a Hilbert curve within
//! each round (Amenta, Choi and Rote 2003, "Incremental constructions con BRIO").

use super::super::lattice::{BITS, Site};

/// Rounds below this size are not worth splitting.
const FIRST_ROUND: usize = 64;
/// Bits an axis that the curve tells apart; three axes fit a `u64`.
const CURVE_BITS: u32 = 20;

/// The sites' indices in the order of insertion: the same for the same number and places.
pub(super) fn insertion_order(sites: &[Site]) -> Vec<u32> {
    let rounds = (sites.len() / FIRST_ROUND).max(1).ilog2();
    let mut keyed: Vec<(u32, u64, u32)> = sites
        .iter()
        .zip(0..)
        .map(|(site, index)| {
            // The last round takes half the points, the one before a quarter, …
            let round = rounds - scramble(index).trailing_ones().min(rounds);
            (round, hilbert(*site), index)
        })
        .collect();
    keyed.sort_unstable();
    keyed.into_iter().map(|(_, _, index)| index).collect()
}

/// Bits that look random (the finaliser of MurmurHash3).
fn scramble(index: u32) -> u32 {
    let mut h = index.wrapping_add(0x9e37_79b9);
    h = (h ^ (h >> 16)).wrapping_mul(0x85eb_ca6b);
    h = (h ^ (h >> 13)).wrapping_mul(0xc2b2_ae35);
    h ^ (h >> 16)
}

/// How far along the Hilbert curve a place lies (Skilling 2004, "Programming the Hilbert
/// curve").
pub(in super::super) fn hilbert(site: Site) -> u64 {
    let mut x = site.map(|c| (c >> (BITS - CURVE_BITS)) as u32);
    let top = 1u32 << (CURVE_BITS - 1);
    // 1. Undo the excess rotations.
    let mut q = top;
    while q > 1 {
        let below = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= below;
            } else {
                let swap = (x[0] ^ x[i]) & below;
                x[0] ^= swap;
                x[i] ^= swap;
            }
        }
        q >>= 1;
    }
    // 2. Gray code.
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    q = top;
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    // 3. Interleave the bits, the first axis highest.
    let mut key = 0;
    for bit in (0..CURVE_BITS).rev() {
        for axis in x {
            key = key << 1 | u64::from((axis ^ t) >> bit & 1);
        }
    }
    key
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_neighbouring_cells_one_after_the_other() {
        let shift = BITS - CURVE_BITS;
        let mut cells = Vec::new();
        for x in 0..8 {
            for y in 0..8 {
                for z in 0..8 {
                    cells.push([x, y, z]);
                }
            }
        }
        cells.sort_by_key(|cell| hilbert(cell.map(|c| c << shift)));
        for pair in cells.windows(2) {
            let steps: i32 = (0..3).map(|i| (pair[0][i] - pair[1][i]).abs()).sum();
            assert_eq!(steps, 1, "{pair:?}");
        }
    }

    #[test]
    fn every_site_comes_once() {
        let sites: Vec<Site> = (0..1000).map(|i| [i * 7 % 31, i * 13 % 57, i]).collect();
        let mut order = insertion_order(&sites);
        order.sort_unstable();
        assert!(order.into_iter().eq(0..1000));
    }
}
