/// How many frames to take out of a video.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FrameCount {
    /// Three a second, but at least 20 and at most 150.
    Auto,
    /// So many.
    Frames(usize),
    /// So many a second.
    PerSecond(f64),
}

const AUTO_PER_SECOND: f64 = 3.0;
const AUTO_AT_LEAST: usize = 20;
const AUTO_AT_MOST: usize = 150;

/// A frame that was looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScoredFrame {
    /// When it is shown.
    pub time_s: f64,
    /// The larger the sharper; comparable between frames of one video.
    pub sharpness: f64,
    /// Whether it could not be decoded whole, or may be predicted from one that could not.
    pub is_damaged: bool,
}

/// As many photos are the least that show depth.
const AT_LEAST: usize = 2;

/// The indices of the sharpest frame of each of so many equal stretches of time, rising.
/// The earlier of equally sharp ones; none where a stretch has no frame, or damaged ones alone.
/// Where that leaves but one of several, the time of the whole frames is what is divided, at least in two.
/// Frames come in the order of their times.
pub fn choose(frames: &[ScoredFrame], count: FrameCount) -> Vec<usize> {
    let wanted = stretches(frames, count);
    let chosen = sharpest(frames, wanted);
    if chosen.len() >= AT_LEAST.min(wanted) {
        return chosen;
    }
    let whole: Vec<usize> = (0..frames.len())
        .filter(|&i| !frames[i].is_damaged)
        .collect();
    let left: Vec<ScoredFrame> = whole.iter().map(|&i| frames[i]).collect();
    let stretches = stretches(&left, count).max(AT_LEAST);
    let chosen = sharpest(&left, stretches).into_iter();
    chosen.map(|i| whole[i]).collect()
}

/// How long frames are shown in all, in seconds; 0 for fewer than two.
fn duration_s(frames: &[ScoredFrame]) -> f64 {
    let [first, .., last] = frames else {
        return 0.0;
    };
    // The last frame is shown about as long as the others.
    let step_s = (last.time_s - first.time_s) / (frames.len() - 1) as f64;
    last.time_s - first.time_s + step_s
}

/// How many stretches of time a frame each is asked of: one or more, and no more than there are frames.
fn stretches(frames: &[ScoredFrame], count: FrameCount) -> usize {
    let per_second = |fps: f64| (fps * duration_s(frames)).round() as usize;
    let stretches = match count {
        FrameCount::Auto => per_second(AUTO_PER_SECOND).clamp(AUTO_AT_LEAST, AUTO_AT_MOST),
        FrameCount::Frames(count) => count,
        FrameCount::PerSecond(fps) => per_second(fps),
    };
    stretches.clamp(1, frames.len().max(1))
}

/// The sharpest whole frame of each of so many equal stretches; the first one where all frames are shown at one
/// time.
fn sharpest(frames: &[ScoredFrame], stretches: usize) -> Vec<usize> {
    let mut whole = (0..frames.len()).filter(|&i| !frames[i].is_damaged);
    let duration_s = duration_s(frames);
    if !(duration_s > 0.0) {
        return whole.next().into_iter().collect();
    }
    let mut best: Vec<Option<usize>> = vec![None; stretches];
    for i in whole {
        let frame = frames[i];
        let share = (frame.time_s - frames[0].time_s) / duration_s;
        // A frame on a border begins the later stretch, however its time was rounded.
        let stretch = ((share * stretches as f64 + 1e-6) as usize).min(stretches - 1);
        let sharper = |other: usize| frame.sharpness > frames[other].sharpness;
        if best[stretch].is_none_or(sharper) {
            best[stretch] = Some(i);
        }
    }
    best.into_iter().flatten().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(fps: f64, sharpness: &[f64]) -> Vec<ScoredFrame> {
        let frame = |(i, &sharpness): (usize, &f64)| ScoredFrame {
            time_s: 5.0 + i as f64 / fps,
            sharpness,
            is_damaged: false,
        };
        sharpness.iter().enumerate().map(frame).collect()
    }

    #[test]
    fn the_sharpest_of_each_stretch_the_earlier_of_equals() {
        let six = frames(30.0, &[1.0, 3.0, 2.0, 7.0, 7.0, 5.0]);
        assert_eq!(choose(&six, FrameCount::Frames(2)), [1, 3]);
        assert_eq!(choose(&six, FrameCount::Frames(1)), [3]);
        assert_eq!(choose(&six, FrameCount::Frames(100)), [0, 1, 2, 3, 4, 5]);
        assert_eq!(choose(&six, FrameCount::PerSecond(10.0)), [1, 3]);
        assert_eq!(
            choose(&six, FrameCount::Auto).len(),
            6,
            "no more than there are"
        );
    }

    #[test]
    fn the_rate_follows_the_length() {
        let count = |seconds: usize| {
            let frames = frames(30.0, &vec![1.0; 30 * seconds]);
            choose(&frames, FrameCount::Auto).len()
        };
        assert_eq!([1, 10, 30, 600].map(count), [20, 30, 90, 150]);
    }

    #[test]
    fn time_counts_and_not_the_number_of_frames() {
        // Ten frames in the first tenth of a second, then one after a second.
        let mut varied = frames(100.0, &[1.0; 10]);
        varied[4].sharpness = 2.0;
        varied.push(ScoredFrame {
            time_s: 6.0,
            sharpness: 0.5,
            is_damaged: false,
        });
        assert_eq!(choose(&varied, FrameCount::Frames(4)), [4, 10]);
    }

    #[test]
    fn damaged_frames_are_passed_over_however_sharp() {
        let mut six = frames(30.0, &[1.0, 3.0, 2.0, 7.0, 7.0, 5.0]);
        six[1].is_damaged = true;
        six[3].is_damaged = true;
        assert_eq!(choose(&six, FrameCount::Frames(2)), [2, 4]);
        assert_eq!(choose(&six, FrameCount::Frames(6)), [0, 2, 4, 5]);
        six.iter_mut().for_each(|frame| frame.time_s = 0.0);
        six[0].is_damaged = true;
        assert_eq!(choose(&six, FrameCount::Auto), [2], "at one time");
        six.iter_mut().for_each(|frame| frame.is_damaged = true);
        assert_eq!(choose(&six, FrameCount::Auto), [0; 0]);
        assert_eq!(choose(&six[..1], FrameCount::Auto), [0; 0]);
    }

    #[test]
    fn whole_frames_that_lie_close_together_are_taken_apart() {
        // The first ten of two seconds are whole.
        let mut sharpness = vec![1.0; 60];
        sharpness[3] = 2.0;
        sharpness[9] = 3.0;
        let mut early = frames(30.0, &sharpness);
        for frame in &mut early[10..] {
            frame.is_damaged = true;
        }
        assert_eq!(choose(&early, FrameCount::Frames(3)), [3, 4, 9]);
        assert_eq!(choose(&early, FrameCount::PerSecond(1.0)), [3, 9]);
        assert_eq!(choose(&early, FrameCount::Frames(1)), [9], "as asked for");
        // Two of ten minutes.
        let mut long = frames(30.0, &vec![1.0; 18_000]);
        for frame in &mut long[2..] {
            frame.is_damaged = true;
        }
        assert_eq!(choose(&long, FrameCount::Auto), [0, 1]);
        assert_eq!(choose(&long, FrameCount::PerSecond(0.1)), [0, 1]);
        long[0].is_damaged = true;
        assert_eq!(choose(&long, FrameCount::Auto), [1]);
    }

    #[test]
    fn degenerate_videos_give_what_they_have() {
        assert_eq!(choose(&[], FrameCount::Auto), [0; 0]);
        assert_eq!(choose(&frames(1.0, &[1.0]), FrameCount::Auto), [0]);
        let still = [ScoredFrame {
            time_s: 0.0,
            sharpness: 1.0,
            is_damaged: false,
        }; 3];
        assert_eq!(choose(&still, FrameCount::Auto), [0]);
    }
}
