//! The table of live handles of this process. A forked child cannot use its parent's handles: their devices have
//! threads that the child does not have, and their locks may be held for ever. So the child gets a new table before it
//! takes any lock.

use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicPtr, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Arc, PoisonError, RwLock};

/// What a handle stands for: of any kind, found again by its type.
pub trait Object: Any + Send + Sync {
    /// The last error of a call on it.
    fn error_text(&self) -> String;
}

/// Handles and what stands behind them.
pub struct Table {
    /// 0: not set yet.
    process: AtomicU32,
    /// Handles below this are of the process that forked this one.
    inherited_to: usize,
    live: RwLock<BTreeMap<usize, Arc<dyn Object>>>,
    /// Inherited ones that were destroyed here.
    dropped: RwLock<BTreeSet<usize>>,
}

/// That of the process that loaded the library: it owns no memory while it is empty.
static FIRST: Table = Table::new(0, 0);
/// That of a forked child. Never freed: a process has one.
static CHILDS: AtomicPtr<Table> = AtomicPtr::new(std::ptr::null_mut());
static NEXT: AtomicUsize = AtomicUsize::new(1);

/// The table of this process.
pub fn table() -> &'static Table {
    let process = std::process::id();
    match FIRST.process.compare_exchange(0, process, Ordering::AcqRel, Ordering::Acquire) {
        Ok(_) => &FIRST,
        Err(owner) if owner == process => &FIRST,
        Err(_) => of_child(process),
    }
}

fn of_child(process: u32) -> &'static Table {
    loop {
        let current = CHILDS.load(Ordering::Acquire);
        // SAFETY: null, or from `Box::into_raw` below and never freed.
        if let Some(table) = unsafe { current.as_ref() }
            && table.process.load(Ordering::Acquire) == process
        {
            return table;
        }
        let made = Box::into_raw(Box::new(Table::new(process, NEXT.load(Ordering::Acquire) * 2 + 1)));
        if CHILDS.compare_exchange(current, made, Ordering::AcqRel, Ordering::Acquire).is_err() {
            // SAFETY: new, and no other thread has seen it.
            drop(unsafe { Box::from_raw(made) });
        }
    }
}

impl Table {
    const fn new(process: u32, inherited_to: usize) -> Self {
        Self {
            process: AtomicU32::new(process),
            inherited_to,
            live: RwLock::new(BTreeMap::new()),
            dropped: RwLock::new(BTreeSet::new()),
        }
    }

    /// Whether a handle is one of the process that forked this one, and was not destroyed here.
    pub fn inherited(&self, handle: usize) -> bool {
        let is_of_parent = handle % 2 == 1 && handle < self.inherited_to;
        is_of_parent && !self.dropped.read().unwrap_or_else(PoisonError::into_inner).contains(&handle)
    }

    /// Drops an inherited handle: from now on there is none.
    pub fn drop_inherited(&self, handle: usize) {
        self.dropped.write().unwrap_or_else(PoisonError::into_inner).insert(handle);
    }

    /// Gives an object a handle, which is never given out twice.
    pub fn insert(&self, object: Arc<dyn Object>) -> usize {
        // Odd, so that it is no address of anything aligned.
        let handle = NEXT.fetch_add(1, Ordering::Relaxed) * 2 + 1;
        self.live.write().unwrap_or_else(PoisonError::into_inner).insert(handle, object);
        handle
    }

    /// The object behind a handle.
    pub fn get(&self, handle: usize) -> Option<Arc<dyn Object>> {
        self.live.read().unwrap_or_else(PoisonError::into_inner).get(&handle).cloned()
    }

    /// The handle is destroyed.
    pub fn remove(&self, handle: usize) {
        self.live.write().unwrap_or_else(PoisonError::into_inner).remove(&handle);
    }
}
