//! CPU time of the calling thread, for statistics of stages only: no output depends on it.

use rustix::time::{ClockId, clock_gettime};

/// A stopwatch of the thread's CPU time.
#[derive(Clone, Copy, Debug)]
pub struct CpuClock(f64);

impl CpuClock {
    pub fn start() -> Self {
        Self(now_s())
    }

    /// Returns the seconds since the start or the last lap.
    pub fn lap_s(&mut self) -> f64 {
        let now = now_s();
        let lap = now - self.0;
        self.0 = now;
        lap
    }
}

fn now_s() -> f64 {
    let t = clock_gettime(ClockId::ThreadCPUTime);
    t.tv_sec as f64 + t.tv_nsec as f64 * 1e-9
}
