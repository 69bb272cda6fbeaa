//! What many tests of a program begin with.

use std::collections::BTreeMap;
use std::sync::{Mutex, OnceLock, PoisonError};

/// Values by key, each made when it is first asked for, and kept.
pub(crate) struct Once<K, V: 'static>(Mutex<BTreeMap<K, &'static OnceLock<V>>>);

impl<K: Ord, V> Once<K, V> {
    pub(crate) const fn new() -> Self {
        Self(Mutex::new(BTreeMap::new()))
    }

    /// While one is made others can be had. What fails to be made is tried again by who asks next.
    pub(crate) fn get(&self, key: K, make: impl FnOnce() -> V) -> &'static V {
        let one: &'static OnceLock<V> = {
            let mut made = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            made.entry(key).or_insert_with(|| Box::leak(Box::default()))
        };
        one.get_or_init(make)
    }
}
