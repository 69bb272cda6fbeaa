//! A thread of low priority beside the frames.

use std::any::Any;
use std::fmt;
use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvError, Sender, TryRecvError, channel};
use std::thread::{Builder, Scope};

/// What the thread is to do; it is told whether nobody waits any more.
type Job<'a, T> = Box<dyn FnOnce(&AtomicBool) -> T + Send + 'a>;

/// Does one thing at a time, on one thread that frames do not use. When it is dropped the thread ends as
/// soon as what it is at allows.
pub(super) struct Background<'a, T> {
    jobs: Sender<Job<'a, T>>,
    done: Receiver<Result<T, String>>,
    /// By what its user knows what it is at.
    at: Option<usize>,
    is_over: Arc<AtomicBool>,
}

impl<'a, T: Send + 'a> Background<'a, T> {
    /// Starts the thread.
    ///
    /// # Errors
    /// The system's, where it gives no thread.
    pub(super) fn start(scope: &'a Scope<'a, '_>) -> io::Result<Self> {
        let (jobs, asked) = channel::<Job<'a, T>>();
        let (tell, done) = channel();
        let is_over = Arc::new(AtomicBool::new(false));
        // What it runs on several threads elsewhere stays on this one.
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(1)
            .thread_name(|_| "ahead".to_owned())
            .start_handler(|_| give_way())
            .build()
            .map_err(io::Error::other)?;
        let over = Arc::clone(&is_over);
        let run = move || {
            for job in asked {
                let job = || pool.install(|| job(&over));
                let result = catch_unwind(AssertUnwindSafe(job)).map_err(|cause| said(&*cause));
                if tell.send(result).is_err() {
                    return;
                }
            }
        };
        Builder::new()
            .name("ahead's".to_owned())
            .spawn_scoped(scope, run)?;
        Ok(Self {
            jobs,
            done,
            at: None,
            is_over,
        })
    }

    /// What it is at, by the number it was asked with.
    pub(super) fn at(&self) -> Option<usize> {
        self.at
    }

    /// Asks for something under a number, where it is at nothing.
    pub(super) fn ask(&mut self, number: usize, job: impl FnOnce(&AtomicBool) -> T + Send + 'a) {
        if self.at.is_none() && self.jobs.send(Box::new(job)).is_ok() {
            self.at = Some(number);
        }
    }

    /// What it has done since it was last asked, if that is so; what a panic said in place of it.
    pub(super) fn poll(&mut self) -> Option<Result<T, String>> {
        self.at?;
        let done = match self.done.try_recv() {
            Ok(done) => done,
            Err(TryRecvError::Empty) => return None,
            Err(TryRecvError::Disconnected) => Err(GONE.to_owned()),
        };
        self.at = None;
        Some(done)
    }

    /// Waits for what it is at, if it is at anything.
    pub(super) fn wait(&mut self) -> Option<Result<T, String>> {
        self.at.take()?;
        let done = self.done.recv();
        Some(done.unwrap_or_else(|RecvError| Err(GONE.to_owned())))
    }
}

const GONE: &str = "its thread is gone";

impl<T> Drop for Background<'_, T> {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
    }
}

impl<T> fmt::Debug for Background<'_, T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Background")
            .field("at", &self.at)
            .finish_non_exhaustive()
    }
}

/// What a panic said.
fn said(cause: &(dyn Any + Send)) -> String {
    let text = cause.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| cause.downcast_ref::<String>().cloned())
        .unwrap_or_else(|| "a panic".to_owned())
}

/// Lets other threads go first, where the system has priorities of threads that need no rights.
fn give_way() {
    // Linux' "nice" is of a thread: half of what can be given way by. Who may not goes on as before.
    #[cfg(target_os = "linux")]
    let _ = rustix::process::setpriority_process(None, 10);
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;
    use std::sync::Barrier;
    use std::sync::atomic::AtomicUsize;
    use std::thread::{scope, sleep};
    use std::time::Duration;

    #[test]
    fn what_is_asked_is_done_on_one_thread_that_frames_do_not_use() {
        let frames = rayon::current_num_threads();
        scope(|scope| {
            let mut background = Background::start(scope).unwrap();
            assert!(background.poll().is_none() && background.wait().is_none());
            background.ask(7, |_: &AtomicBool| {
                let name = |_| std::thread::current().name().map(str::to_owned);
                let names: Vec<_> = (0..99).into_par_iter().map(name).collect();
                (rayon::current_num_threads(), names)
            });
            assert_eq!(background.at(), Some(7));
            let (threads, names) = background.wait().unwrap().unwrap();
            assert_eq!((threads, background.at()), (1, None));
            assert!(names.iter().all(|name| name.as_deref() == Some("ahead")));
        });
        assert_eq!(rayon::current_num_threads(), frames);
    }

    #[test]
    fn a_panic_comes_back_as_what_it_said_and_the_thread_goes_on() {
        scope(|scope| {
            let mut background = Background::start(scope).unwrap();
            background.ask(1, |_: &AtomicBool| panic!("no {}", "way"));
            assert_eq!(background.wait(), Some(Err("no way".to_owned())));
            background.ask(2, |_| panic!("none"));
            let answer = loop {
                match background.poll() {
                    Some(answer) => break answer,
                    None => sleep(Duration::from_millis(1)),
                }
            };
            assert_eq!(answer, Err("none".to_owned()));
            background.ask(3, |_| 33);
            assert_eq!(background.wait(), Some(Ok(33)));
        });
    }

    #[test]
    fn it_is_at_one_thing_and_ends_in_the_middle_of_it() {
        let (begun, steps) = (Barrier::new(2), AtomicUsize::new(0));
        scope(|scope| {
            let mut background = Background::start(scope).unwrap();
            background.ask(1, |is_over: &AtomicBool| {
                begun.wait();
                while !is_over.load(Ordering::Relaxed) {
                    steps.fetch_add(1, Ordering::Relaxed);
                    sleep(Duration::from_millis(1));
                }
            });
            background.ask(2, |_| unreachable!("it is at something"));
            assert_eq!(background.at(), Some(1));
            begun.wait();
            // Nobody waits for the answer. The scope waits for the thread.
            drop(background);
        });
        let ended = steps.load(Ordering::Relaxed);
        sleep(Duration::from_millis(5));
        assert_eq!(steps.load(Ordering::Relaxed), ended);
    }
}
