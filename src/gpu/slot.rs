//! One frame in flight: a command buffer, its fence and its timestamps.

use std::sync::Arc;
use std::time::{Duration, Instant};

use ash::vk;

use super::context::Context;
use super::failed;
use super::shared::{SemaphoreKind, SignalAt};
use crate::error::{Error, Result};

/// Timestamps a submission may write. Each mark takes two: lavapipe 22.3 latches the timestamp before a dispatch late,
/// but of two in a row the first is right (measured: 5.01 of 5.13 ms against 0.013 ms for the second).
pub(super) const MAX_QUERIES: u32 = 1024;
/// How long `Drop` waits for work in flight before it gives the device up.
const DROP_LIMIT: Duration = Duration::from_secs(20);

/// Time of one pass on the device.
#[derive(Clone, Debug, PartialEq)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// Duration by timestamp queries, ms (on a software device this is CPU time).
    pub ms: f64,
}

/// A command buffer that is recorded, submitted and waited for again and again.
pub struct Slot {
    pub(super) commands: vk::CommandBuffer,
    pub(super) queries: vk::QueryPool,
    pub(super) marks: Vec<&'static str>,
    pool: vk::CommandPool,
    fence: vk::Fence,
    in_flight: bool,
    context: Arc<Context>,
}

impl Slot {
    /// A slot with nothing in flight.
    ///
    /// # Errors
    /// Out of memory.
    pub fn new(context: &Arc<Context>, name: &str) -> Result<Self> {
        let device = &context.device;
        let info = vk::CommandPoolCreateInfo::default()
            .queue_family_index(context.info().queue_family)
            .flags(vk::CommandPoolCreateFlags::RESET_COMMAND_BUFFER);
        // SAFETY: the device is alive in this and the following calls.
        let pool =
            unsafe { device.create_command_pool(&info, None) }.map_err(failed("vkCreateCommandPool"))?;
        let mut slot = Self {
            commands: vk::CommandBuffer::null(),
            queries: vk::QueryPool::null(),
            marks: Vec::new(),
            pool,
            fence: vk::Fence::null(),
            in_flight: false,
            context: context.clone(),
        };
        let info = vk::CommandBufferAllocateInfo::default().command_pool(pool).command_buffer_count(1);
        // SAFETY: the pool was just made.
        let buffers = unsafe { device.allocate_command_buffers(&info) };
        slot.commands = buffers.map_err(failed("vkAllocateCommandBuffers"))?[0];
        context.name(slot.commands, name);
        let info = vk::FenceCreateInfo::default();
        // SAFETY: as above.
        slot.fence = unsafe { device.create_fence(&info, None) }.map_err(failed("vkCreateFence"))?;
        if context.info().timestamp_valid_bits > 0 {
            let info = vk::QueryPoolCreateInfo::default()
                .query_type(vk::QueryType::TIMESTAMP)
                .query_count(MAX_QUERIES);
            // SAFETY: as above.
            slot.queries =
                unsafe { device.create_query_pool(&info, None) }.map_err(failed("vkCreateQueryPool"))?;
        }
        Ok(slot)
    }

    /// Begins the command buffer again, and returns the context for recording.
    pub(super) fn begin_commands(&mut self) -> Result<Arc<Context>> {
        assert!(!self.in_flight, "a slot is waited for before it is recorded again");
        let info = vk::CommandBufferBeginInfo::default().flags(vk::CommandBufferUsageFlags::ONE_TIME_SUBMIT);
        // SAFETY: the buffer is not in flight; beginning resets it, as its pool allows.
        let begun = unsafe { self.context.device.begin_command_buffer(self.commands, &info) };
        begun.map_err(failed("vkBeginCommandBuffer"))?;
        self.marks.clear();
        if self.queries != vk::QueryPool::null() {
            // SAFETY: recording, and no submission uses the queries.
            unsafe { self.context.device.cmd_reset_query_pool(self.commands, self.queries, 0, MAX_QUERIES) };
        }
        Ok(self.context.clone())
    }

    /// Ends recording and hands the commands to the queue.
    ///
    /// # Errors
    /// Device lost, out of memory.
    pub fn submit(&mut self) -> Result<()> {
        self.submit_between(None, None)
    }

    /// The same; the device begins when `wait` is signalled (has its value), and signals `signal` at the end. Both must
    /// outlive the work.
    ///
    /// # Errors
    /// As for [`Self::submit`].
    pub fn submit_between(&mut self, wait: Option<&SignalAt>, signal: Option<&SignalAt>) -> Result<()> {
        let device = &self.context.device;
        // SAFETY: recording was begun by `begin`.
        unsafe { device.end_command_buffer(self.commands) }.map_err(failed("vkEndCommandBuffer"))?;
        let fences = [self.fence];
        // SAFETY: nothing is in flight, so the fence is not in use.
        unsafe { device.reset_fences(&fences) }.map_err(failed("vkResetFences"))?;
        let commands = [self.commands];
        let (waits, wait_values) = split(wait);
        let stages = vec![vk::PipelineStageFlags::ALL_COMMANDS; waits.len()];
        let (signals, signal_values) = split(signal);
        let mut values = vk::TimelineSemaphoreSubmitInfo::default()
            .wait_semaphore_values(&wait_values)
            .signal_semaphore_values(&signal_values);
        let mut submit = vk::SubmitInfo::default()
            .command_buffers(&commands)
            .wait_semaphores(&waits)
            .wait_dst_stage_mask(&stages)
            .signal_semaphores(&signals);
        let timeline = |s: Option<&SignalAt>| s.is_some_and(|(s, _)| s.kind() == SemaphoreKind::Timeline);
        if timeline(wait) || timeline(signal) {
            submit = submit.push_next(&mut values);
        }
        let submits = [submit];
        let queue = self.context.queue();
        // SAFETY: the queue is locked, buffer and fence are not in use.
        let done = unsafe { device.queue_submit(*queue, &submits, self.fence) };
        done.map_err(failed("vkQueueSubmit"))?;
        self.in_flight = true;
        Ok(())
    }

    /// Waits for the work in flight, if any.
    ///
    /// # Errors
    /// Device lost, or not finished within `limit`.
    pub fn wait(&mut self, limit: Duration) -> Result<()> {
        if !self.in_flight {
            return Ok(());
        }
        let start = Instant::now();
        loop {
            let step = limit.saturating_sub(start.elapsed()).min(Duration::from_millis(250));
            let step_ns = step.as_nanos() as u64;
            // SAFETY: the fence belongs to the work in flight.
            let done = unsafe { self.context.device.wait_for_fences(&[self.fence], true, step_ns) };
            match done {
                Ok(()) => break,
                Err(vk::Result::TIMEOUT) if start.elapsed() < limit => {}
                Err(vk::Result::TIMEOUT) => {
                    let result = format!("TIMEOUT after {} s", limit.as_secs_f64());
                    return Err(Error::Vulkan { call: "vkWaitForFences", result });
                }
                Err(error) => {
                    self.settle(error);
                    return Err(failed("vkWaitForFences")(error));
                }
            }
        }
        self.in_flight = false;
        Ok(())
    }

    /// After a failed wait: whether the work may still be running. A lost device may be reported while it is (software
    /// devices, faults injected by layers), and what the work uses must then not be destroyed. The fence tells: a
    /// device that is lost indeed says so again, or that the work is over.
    fn settle(&mut self, error: vk::Result) {
        if error != vk::Result::ERROR_DEVICE_LOST {
            return;
        }
        // SAFETY: the fence belongs to the work in flight.
        let again =
            unsafe { self.context.device.wait_for_fences(&[self.fence], true, DROP_LIMIT.as_nanos() as u64) };
        self.in_flight = !matches!(again, Ok(()) | Err(vk::Result::ERROR_DEVICE_LOST));
    }

    /// To be called where a wait has failed and what the work uses is about to be dropped: waits once more, and where
    /// that fails too, nothing of the device is destroyed from now on.
    pub(crate) fn let_go(&mut self) {
        if self.context.alive() && self.wait(DROP_LIMIT).is_err() && self.in_flight {
            self.context.abandon();
        }
    }

    /// Whether work is in flight.
    pub fn in_flight(&self) -> bool {
        self.in_flight
    }

    /// Whether the work in flight, if any, has finished; does not wait. [`Self::wait`] then returns at once.
    ///
    /// # Errors
    /// Device lost.
    pub fn finished(&self) -> Result<bool> {
        if !self.in_flight {
            return Ok(true);
        }
        // SAFETY: the fence is alive.
        unsafe { self.context.device.get_fence_status(self.fence) }.map_err(failed("vkGetFenceStatus"))
    }

    /// The same, once: from here on the submission has none.
    ///
    /// # Errors
    /// Device lost.
    pub fn take_times(&mut self) -> Result<Vec<PassTime>> {
        let times = self.times()?;
        self.marks.clear();
        Ok(times)
    }

    /// Times of the passes of the last finished submission; passes of one name are added up. Empty on devices without
    /// timestamps.
    ///
    /// # Errors
    /// Device lost.
    pub fn times(&self) -> Result<Vec<PassTime>> {
        if self.in_flight || self.queries == vk::QueryPool::null() || self.marks.is_empty() {
            return Ok(Vec::new());
        }
        let mut ticks = vec![0u64; 2 * (self.marks.len() + 1)];
        // SAFETY: the submission that wrote these queries has finished.
        let read = unsafe {
            self.context.device.get_query_pool_results(
                self.queries,
                0,
                &mut ticks,
                vk::QueryResultFlags::TYPE_64,
            )
        };
        read.map_err(failed("vkGetQueryPoolResults"))?;
        let info = self.context.info();
        let mask = u64::MAX >> (64 - info.timestamp_valid_bits.min(64));
        let mut times: Vec<PassTime> = Vec::new();
        for (i, &name) in self.marks.iter().enumerate() {
            let delta = ticks[2 * i + 2].wrapping_sub(ticks[2 * i]) & mask;
            let ms = delta as f64 * info.timestamp_period_ns * 1e-6;
            match times.iter_mut().find(|t| t.name == name) {
                Some(time) => time.ms += ms,
                None => times.push(PassTime { name, ms }),
            }
        }
        Ok(times)
    }
}

/// Handle and value as Vulkan's parallel arrays.
fn split(at: Option<&SignalAt>) -> (Vec<vk::Semaphore>, Vec<u64>) {
    at.map(|(semaphore, value)| (semaphore.handle, *value)).into_iter().unzip()
}

impl Drop for Slot {
    fn drop(&mut self) {
        self.let_go();
        if !self.context.alive() {
            return;
        }
        // SAFETY: nothing is in flight; null handles are allowed.
        unsafe {
            self.context.device.destroy_query_pool(self.queries, None);
            self.context.device.destroy_fence(self.fence, None);
            self.context.device.destroy_command_pool(self.pool, None);
        }
    }
}
