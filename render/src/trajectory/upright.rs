//! Photos as they stand upright: as most of a capture do, where some were taken with the camera turned.

use calibrate::{View, outer};
use glam::{DMat3, DQuat, DVec3};
use std::f64::consts::FRAC_PI_2;

/// A photo's camera, turned about its optical axis by as many quarters as make it stand as most photos do.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Upright {
    /// `camera_from_world`: the photo's own, where it stands so.
    pub rotation: DQuat,
    /// Whether it was turned by an odd number of quarters: it is as wide as the photo is high.
    pub sides_exchanged: bool,
}

impl Upright {
    /// Its upward axis (−y of its frame), in the world.
    pub fn up(&self) -> DVec3 {
        self.rotation.conjugate() * DVec3::NEG_Y
    }
}

/// A capture's photos as they stand upright.
#[derive(Clone, Debug, PartialEq)]
pub struct Standing {
    /// By index.
    pub photos: Vec<Upright>,
    /// Up in the world, of unit length: the vertical that most photos share, across what is level in them, or
    /// where they share none the mean of their ups; `None` where those all but cancel.
    pub up: Option<DVec3>,
    /// Where nearly all share a vertical that most of them do not stand along, by how many quarters, clockwise, most would
    /// have to be turned to stand: those of a camera on its side that goes around something, for one. 0 else.
    pub lying: u8,
}

/// The tangent of 30°: a photo that leans by more from all four ways of turning it is not turned.
const MOST_LEAN: f64 = 0.577;
/// The sine of the angle to the vertical, some 15°, within which a photo looks straight up or down: which way it
/// stands tells nothing, and it is not turned.
const STEEP: f64 = 0.25;
/// How much more it counts that a direction is the vertical of a photo, however that was turned, than that
/// it is turned as most are.
const CLEAR: f64 = 3.0;
/// Where photos that stand look so many ways, those that look straight down count with them. It is 0 of what looks
/// along one line and 1/2 of what looks all around; this of an arc of some 105°. Of level photos ahead and
/// aside those ahead would else be taken to look down, and those aside to be turned.
const MANY_WAYS: f64 = 0.35;
/// How much photos' ups count for the vertical, compared with what lies level in them: of photos that look down
/// at something the ups lean towards it, all of them where they were not taken from all around.
const UPS: f64 = 0.01;
/// The mean of ups is as long at least, if they tell which way is up.
const AGREED: f64 = 0.3;
/// The cosine of an angle, some 20°, within which two guesses are one.
const SAME_GUESS: f64 = 0.94;
/// So many guesses are followed.
const MOST_GUESSES: usize = 64;
/// So many of all photos share a vertical that they are said to lie along.
const NEARLY_ALL: f64 = 0.9;
/// Two directions that photos' mean gaze differs from by so much less, as cosines, are told apart by it.
const DOWNWARD: f64 = 0.05;

/// A photo as its camera says that it is shown.
struct Shown {
    /// `camera_from_world`.
    rotation: DQuat,
    center: DVec3,
}

impl Shown {
    fn right(&self) -> DVec3 {
        self.rotation.conjugate() * DVec3::X
    }

    fn up(&self) -> DVec3 {
        self.rotation.conjugate() * DVec3::NEG_Y
    }

    fn forward(&self) -> DVec3 {
        self.rotation.conjugate() * DVec3::Z
    }
}

/// All photos of a capture as they stand upright, by index; of each by how many quarters, clockwise, its camera says
/// that it is turned when it is shown ([`SourceView::quarters`](crate::SourceView::quarters)).
///
/// Of photos that are turned so most decide which way is up. Where they stand alike no other turn is made, whichever way they do; nor
/// where no way is that of half of them, as from above, heading in all directions. Whether the world's
/// axes are turned, and in which order photos come, makes no difference; but of two halves that nothing else tells
/// apart, that of the photo in the middle stands, or of the first of two there. Beside photos from all around that
/// share a vertical those that look straight down change nothing, however many they are.
pub fn upright(photos: &[(&View, u8)]) -> Standing {
    let show = |(view, turn): &(&View, u8)| Shown {
        rotation: turned(view.camera_from_world.rotation, *turn),
        center: view.center(),
    };
    let shown: Vec<Shown> = photos.iter().map(show).collect();
    let best = best_vote(&shown);
    let vertical = best.as_ref().filter(|vote| vote.is_shared(shown.len()));
    let vertical = vertical.map(|vote| vote.up);
    let stand = |(shown, (_, own)): (&Shown, &(&View, u8))| {
        let turn = vertical.and_then(|up| quarters(shown.rotation, up));
        let turn = turn.unwrap_or(0);
        Upright {
            rotation: turned(shown.rotation, turn),
            sides_exchanged: !(own + turn).is_multiple_of(2),
        }
    };
    let photos: Vec<Upright> = shown.iter().zip(photos).map(stand).collect();
    let mean = || {
        let ups = photos.iter().map(Upright::up).sum::<DVec3>();
        ups / photos.len().max(1) as f64
    };
    let up = vertical
        .or_else(|| Some(mean()).filter(|mean| mean.length() > AGREED))
        .and_then(DVec3::try_normalize);
    let lying = best.as_ref().and_then(|vote| vote.lying(shown.len()));
    let lying = lying.unwrap_or(0);
    Standing { photos, up, lying }
}

/// By how many quarters a camera is turned about its optical axis to stand upright; `None` where that
/// is not clear.
fn quarters(rotation: DQuat, up: DVec3) -> Option<u8> {
    let up_in_camera = rotation * up;
    let (above, aside) = (-up_in_camera.y, up_in_camera.x);
    if is_steep(up_in_camera) {
        None
    } else if aside.abs() <= MOST_LEAN * above.abs() {
        Some(if above > 0.0 { 0 } else { 2 })
    } else if above.abs() <= MOST_LEAN * aside.abs() {
        Some(if aside > 0.0 { 3 } else { 1 })
    } else {
        None
    }
}

/// Whether a photo with up there in its camera's frame looks straight up or down.
fn is_steep(up_in_camera: DVec3) -> bool {
    up_in_camera.x.hypot(up_in_camera.y) < STEEP
}

fn looks_down(rotation: DQuat, up: DVec3) -> bool {
    let up_in_camera = rotation * up;
    is_steep(up_in_camera) && up_in_camera.z < 0.0
}

/// The sum of r rᵀ over right axes of photos.
fn squares(rights: impl Iterator<Item = DVec3>) -> DMat3 {
    rights.fold(DMat3::ZERO, |sum, r| sum + outer(r))
}

/// A camera turned about its optical axis, from x towards y.
pub(super) fn turned(rotation: DQuat, quarters: u8) -> DQuat {
    match quarters {
        0 => rotation,
        _ => DQuat::from_rotation_z(f64::from(quarters) * FRAC_PI_2) * rotation,
    }
}

/// How photos stand if a direction is the vertical.
struct Vote {
    up: DVec3,
    /// How many are upright once turned by so many quarters.
    by_quarters: [usize; 4],
    /// How many look straight down; none where those that stand do not look [`MANY_WAYS`].
    down: usize,
}

impl Vote {
    fn new(rotations: &[DQuat], up: DVec3) -> Self {
        let mut by_quarters = [0; 4];
        let mut rights = Vec::with_capacity(rotations.len());
        for &rotation in rotations {
            if let Some(turn) = quarters(rotation, up) {
                by_quarters[usize::from(turn)] += 1;
                rights.push(turned(rotation, turn).conjugate() * DVec3::X);
            }
        }
        // One less what its eigenvalues' squares sum to: of unit length, the axes have 1 in all.
        let count = rights.len() as f64;
        let shares = squares(rights.into_iter())
            .to_cols_array()
            .map(|x| x / count);
        let ways = 1.0 - shares.iter().map(|x| x * x).sum::<f64>();
        let down = rotations.iter().filter(|q| looks_down(**q, up)).count();
        Self {
            up,
            by_quarters,
            // Not a number without any that stand.
            down: if ways >= MANY_WAYS { down } else { 0 },
        }
    }

    /// How many photos stand clearly one way or another.
    fn clear(&self) -> usize {
        self.by_quarters.iter().sum()
    }

    /// How many it is the vertical of.
    fn explained(&self) -> usize {
        self.clear() + self.down
    }

    fn most(&self) -> usize {
        self.by_quarters.iter().fold(0, |most, n| most.max(*n))
    }

    /// How much it says of the photos. Of those that look down as large a part is taken to stand as most do
    /// as of the others.
    fn score(&self) -> f64 {
        let explained = self.explained() as f64;
        CLEAR * explained + explained * self.most() as f64 / self.clear().max(1) as f64
    }

    /// Whether as many stand upright as any other way.
    fn is_upright(&self) -> bool {
        self.by_quarters[0] == self.most()
    }

    /// Whether half of so many photos or more have this vertical, upwards as half of them or more are.
    fn is_shared(&self, photos: usize) -> bool {
        self.is_upright()
            && 2 * self.by_quarters[0] >= self.clear()
            && 2 * self.explained() >= photos
    }

    /// By how many quarters most of so many photos would have to be turned to stand, if they lie; see [`Standing::lying`].
    fn lying(&self, photos: usize) -> Option<u8> {
        let is_clear = self.clear() as f64 >= NEARLY_ALL * photos as f64;
        let is_most = |turn: &u8| {
            let alike = self.by_quarters[usize::from(*turn)];
            alike == self.most() && 2 * alike >= self.clear()
        };
        if !is_clear || self.is_upright() {
            return None;
        }
        (1..4).find(is_most)
    }

    /// Whether it says more of the photos than another; of two that say as much photos look down, not
    /// up, in the better.
    fn is_better(&self, other: &Self, ahead: DVec3) -> bool {
        let score = |vote: &Self| (vote.score(), vote.is_upright());
        score(self) > score(other)
            || score(self) == score(other) && ahead.dot(self.up) < ahead.dot(other.up) - DOWNWARD
    }
}

/// How photos stand along the direction that says most of them; `None` without any direction.
fn best_vote(photos: &[Shown]) -> Option<Vote> {
    let rotations: Vec<DQuat> = photos.iter().map(|photo| photo.rotation).collect();
    let ahead = photos.iter().map(Shown::forward).sum::<DVec3>();
    let ahead = ahead / photos.len().max(1) as f64;
    let mut best: Option<Vote> = None;
    let mut tried: Vec<DVec3> = Vec::new();
    for guess in guesses(photos) {
        let is_known = |other: &DVec3| other.dot(guess).abs() > SAME_GUESS;
        if tried.iter().any(is_known) {
            continue;
        }
        tried.push(guess);
        let up = settled(&rotations, guess);
        for vote in [up, -up].map(|up| Vote::new(&rotations, up)) {
            if best
                .as_ref()
                .is_none_or(|before| vote.is_better(before, ahead))
            {
                best = Some(vote);
            }
        }
        let is_all = |vote: &Vote| vote.by_quarters[0] == photos.len();
        if best.as_ref().is_some_and(is_all) || tried.len() == MOST_GUESSES {
            break;
        }
    }
    best
}

/// Directions that may be the vertical: first that of the mean of all ups; then, from the photos in the middle
/// outwards, what is level in two of them, and up or aside in one.
fn guesses(photos: &[Shown]) -> Vec<DVec3> {
    let rights: Vec<DVec3> = photos.iter().map(Shown::right).collect();
    let ups: Vec<DVec3> = photos.iter().map(Shown::up).collect();

    let first = photos.first().map_or(DVec3::ZERO, |photo| photo.center);
    let centers: Vec<DVec3> = photos.iter().map(|photo| photo.center - first).collect();
    let middle = centers.iter().sum::<DVec3>() / photos.len().max(1) as f64;
    let distances: Vec<f64> = centers.iter().map(|c| c.distance(middle)).collect();
    let farthest = distances.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
    // Those that are equally near but for rounding stay in their order.
    let nearness = |i: usize| (1e6 * (distances[i] / farthest)).round();
    let mut outwards: Vec<usize> = (0..photos.len()).collect();
    outwards.sort_by(|i, j| nearness(*i).total_cmp(&nearness(*j)));

    let direction = |v: DVec3| (v.length() > 1e-9).then(|| v.normalize());
    let mut guesses = Vec::with_capacity(3 * photos.len() + 2);
    guesses.extend(direction(ups.iter().sum()));
    guesses.extend(direction(rights.iter().sum()));
    for (place, &i) in outwards.iter().enumerate() {
        let next = outwards[(place + 1) % outwards.len()];
        guesses.extend(direction(rights[i].cross(rights[next])));
        guesses.extend([ups[i], rights[i]]);
    }
    guesses
}

/// The vertical near a guess.
fn settled(rotations: &[DQuat], guess: DVec3) -> DVec3 {
    let mut up = guess;
    for _ in 0..12 {
        match fitted(rotations, up) {
            Some(next) if next.distance(up) > 1e-9 => up = next,
            _ => break,
        }
    }
    up
}

/// The direction u that is most nearly upright in photos which are turned by what a guess of it says: it
/// minimises Σ (rᵢ·u)² + λ|u|² − 2λ Σ uᵢ·u, with their right axes rᵢ and ups uᵢ. Those of a ring from high
/// above lean towards its middle by as much, so that the mean of ups would be no vertical of a part of it.
pub(super) fn fitted(rotations: &[DQuat], guess: DVec3) -> Option<DVec3> {
    let (mut rights, mut ups) = (Vec::with_capacity(rotations.len()), DVec3::ZERO);
    for &rotation in rotations {
        let Some(turn) = quarters(rotation, guess) else {
            continue;
        };
        let world_from_camera = turned(rotation, turn).conjugate();
        rights.push(world_from_camera * DVec3::X);
        ups += world_from_camera * DVec3::NEG_Y;
    }
    if rights.is_empty() {
        return None;
    }
    let count = rights.len() as f64;
    let sum = squares(rights.into_iter()) + DMat3::IDENTITY * (UPS * count);
    (sum.inverse() * ups).try_normalize()
}

#[cfg(test)]
mod tests;
