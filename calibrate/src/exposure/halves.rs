//! Points split into two halves that lie in different places.

use glam::DVec3;

/// Points are cut in two this often: 2⁶ blocks.
const CUTS: u32 = 6;

/// Which half each point is in. The points are cut at their median across their longest
/// extent again and again; blocks go to the halves as the squares of a chessboard, so that
/// each half is everywhere and no point has its neighbours in the other.
pub(super) fn halves(points: &[DVec3]) -> Vec<bool> {
    let mut half = vec![false; points.len()];
    let mut order: Vec<usize> = (0..points.len()).collect();
    cut(points, &mut order, CUTS, false, &mut half);
    half
}

fn cut(points: &[DVec3], block: &mut [usize], cuts: u32, side: bool, half: &mut [bool]) {
    if cuts == 0 || block.len() < 2 {
        for &i in &*block {
            half[i] = side;
        }
        return;
    }
    let low = block.iter().fold(DVec3::MAX, |m, &i| m.min(points[i]));
    let high = block.iter().fold(DVec3::MIN, |m, &i| m.max(points[i]));
    let extent = (high - low).to_array();
    let axis = (0..3).fold(0, |a, b| if extent[b] > extent[a] { b } else { a });
    let by_place = |a: &usize, b: &usize| {
        let (p, q) = (points[*a].to_array(), points[*b].to_array());
        p[axis].total_cmp(&q[axis]).then(a.cmp(b))
    };
    block.sort_unstable_by(by_place);
    let (first, second) = block.split_at_mut(block.len() / 2);
    cut(points, first, cuts - 1, side, half);
    cut(points, second, cuts - 1, !side, half);
}
