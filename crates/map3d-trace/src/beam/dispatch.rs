//! One compilation of the descent for each instruction set, chosen at run time.

use map3d_base::Isa;

use super::descent::Descent;
use crate::lanes::Plain;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512};

/// Runs a descent; `BeamTracer::with_isa` has checked that this machine has `isa`.
pub(crate) fn run(descent: Descent, isa: Isa) {
    match isa {
        Isa::Scalar => scalar(descent),
        // SAFETY: `BeamTracer::with_isa` refuses an instruction set that the processor does not say it has.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { avx2(descent) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { avx512(descent) },
    }
}

fn scalar(descent: Descent) {
    descent.run_with::<Plain>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn avx2(descent: Descent) {
    descent.run_with::<Avx2>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512(descent: Descent) {
    descent.run_with::<Avx512>();
}
