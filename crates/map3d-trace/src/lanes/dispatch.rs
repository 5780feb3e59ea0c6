//! Selects the compilation of a traversal for the instruction set at run time.

use map3d_base::Isa;

use super::scalar::Scalar;
use super::traits::Lanes;
#[cfg(target_arch = "x86_64")]
use super::x86::{Avx2, Avx512};

/// Code that is compiled once for each instruction set. Mark `run` and all that it calls in its inner loops `#[inline(always)]`: only inlined code gets
/// the instructions of the caller.
pub(crate) trait Kernel {
    fn run<L: Lanes>(self);
}

/// Runs a kernel with the lanes of an instruction set. The caller has checked that `Isa::available` lists it.
pub(crate) fn dispatch<K: Kernel>(kernel: K, isa: Isa) {
    match isa {
        Isa::Scalar => kernel.run::<Scalar>(),
        // SAFETY: `BeamTracer::with_isa` and `SceneRegion::packets_along` refuse an instruction set that the processor does not report.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { run_avx2(kernel) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { run_avx512(kernel) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn run_avx2<K: Kernel>(kernel: K) {
    kernel.run::<Avx2>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn run_avx512<K: Kernel>(kernel: K) {
    kernel.run::<Avx512>();
}
