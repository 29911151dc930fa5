//! All pipelines of a device. They are kept when nothing uses them any more: to make one takes a driver up to a tenth
//! of a second, and the next engine of a device, or the same one with another camera, needs most of them again.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ash::vk;

use super::interface::Interface;
use crate::error::Result;
use crate::kernels::Kernel;

/// Pipelines that are kept though nothing uses them: more than all methods and a lens take together. Beyond them the
/// one that has been idle longest goes first.
const MOST_IDLE: usize = 128;

/// What a pipeline is made from: those of one key do the same.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Key {
    /// Addresses of its kernels, which are never freed.
    kernels: Vec<usize>,
    /// All else: specialization constants and fixed state.
    state: Vec<u32>,
}

impl Key {
    pub(super) fn new(kernels: &[&'static Kernel], state: Vec<u32>) -> Self {
        Self { kernels: kernels.iter().map(|k| std::ptr::from_ref::<Kernel>(k).addr()).collect(), state }
    }
}

/// A pipeline and its layouts. Whoever holds the last of it destroys it by hand.
pub(super) struct Made {
    pub(super) handle: vk::Pipeline,
    pub(super) interface: Interface,
}

impl Made {
    /// With a pipeline for the layout of `interface`, which goes where the pipeline cannot be made.
    pub(super) fn with(
        device: &ash::Device,
        interface: Interface,
        make: impl FnOnce(vk::PipelineLayout) -> Result<vk::Pipeline>,
    ) -> Result<Self> {
        match make(interface.layout) {
            Ok(handle) => Ok(Self { handle, interface }),
            Err(error) => {
                // SAFETY: nothing knows of it yet.
                unsafe { interface.destroy(device) };
                Err(error)
            }
        }
    }

    /// # Safety
    /// No work that uses it is on the device, and nothing uses it from here on.
    pub(super) unsafe fn destroy(&self, device: &ash::Device) {
        // SAFETY: the caller's promise; null handles are allowed.
        unsafe {
            device.destroy_pipeline(self.handle, None);
            self.interface.destroy(device);
        }
    }
}

struct Entry {
    made: Arc<Made>,
    users: usize,
}

#[derive(Default)]
struct Table {
    entries: HashMap<Key, Entry>,
    /// Keys of those without a user, the longest idle first.
    idle: VecDeque<Key>,
}

impl Table {
    fn find(&mut self, key: &Key) -> Option<Arc<Made>> {
        let entry = self.entries.get_mut(key)?;
        entry.users += 1;
        if entry.users == 1 {
            self.idle.retain(|k| k != key);
        }
        Some(entry.made.clone())
    }

    /// One user less; what is to be destroyed, if that makes too many idle ones.
    fn release(&mut self, key: &Key) -> Option<Arc<Made>> {
        let entry = self.entries.get_mut(key)?;
        entry.users -= 1;
        if entry.users > 0 {
            return None;
        }
        self.idle.push_back(key.clone());
        let oldest = (self.idle.len() > MOST_IDLE).then(|| self.idle.pop_front())??;
        Some(self.entries.remove(&oldest)?.made)
    }
}

/// All pipelines of a device.
#[derive(Default)]
pub(super) struct Pipelines(Mutex<Table>);

impl Pipelines {
    /// The pipeline of `key`, where there is one: it has a user more from here on.
    pub(super) fn find(&self, key: &Key) -> Option<Arc<Made>> {
        self.table().find(key)
    }

    /// Takes a new pipeline with its first user. Another thread may have been faster: then the one of that thread comes
    /// back, with a user more, and the new one as what is to be destroyed.
    pub(super) fn insert(&self, key: &Key, made: Made) -> (Arc<Made>, Option<Made>) {
        let mut table = self.table();
        if let Some(other) = table.find(key) {
            return (other, Some(made));
        }
        let made = Arc::new(made);
        table.entries.insert(key.clone(), Entry { made: made.clone(), users: 1 });
        (made, None)
    }

    /// A user of `key` less. What comes back has no user, and is to be destroyed.
    pub(super) fn release(&self, key: &Key) -> Option<Arc<Made>> {
        self.table().release(key)
    }

    fn table(&self) -> MutexGuard<'_, Table> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// # Safety
    /// No work is on the device, and nothing uses any of them from here on.
    pub(super) unsafe fn destroy(&mut self, device: &ash::Device) {
        for (_, entry) in std::mem::take(&mut *self.table()).entries {
            // SAFETY: the caller's promise.
            unsafe { entry.made.destroy(device) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(number: u32) -> Key {
        Key { kernels: vec![0], state: vec![number] }
    }

    fn taken(table: &mut Table, number: u32) {
        let made = || Arc::new(Made { handle: vk::Pipeline::null(), interface: Interface::default() });
        if table.find(&key(number)).is_none() {
            table.entries.insert(key(number), Entry { made: made(), users: 1 });
        }
    }

    #[test]
    fn the_longest_idle_goes_first_and_one_in_use_never() {
        let mut table = Table::default();
        (0..MOST_IDLE as u32 + 2).for_each(|n| taken(&mut table, n));
        taken(&mut table, 1);
        assert!(table.release(&key(1)).is_none(), "the second user has it");
        for n in 2..MOST_IDLE as u32 + 2 {
            assert!(table.release(&key(n)).is_none(), "{n}: there is room");
        }
        taken(&mut table, 2);
        assert!(table.release(&key(2)).is_none(), "it is the last in the queue now");
        assert!(table.release(&key(0)).is_some());
        assert!(table.find(&key(3)).is_none(), "the one that was idle longest");
        assert!(table.find(&key(2)).is_some() && table.find(&key(1)).is_some());
        assert_eq!(table.entries.len(), MOST_IDLE + 1);
    }
}
