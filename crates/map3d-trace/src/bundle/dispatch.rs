//! One compilation of the descent for each instruction set, chosen at run time.

use map3d_base::Isa;

use super::descent::Descent;
use crate::lanes::Plain;
#[cfg(target_arch = "x86_64")]
use crate::lanes::{Avx2, Avx512};

/// Runs a descent; `Surroundings::along` has checked that this machine has `isa`.
pub(super) fn run<const ANY: bool>(descent: Descent, isa: Isa) {
    match isa {
        Isa::Scalar => scalar::<ANY>(descent),
        // SAFETY: `Surroundings::along` refuses an instruction set that the processor does not say it has.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 => unsafe { avx2::<ANY>(descent) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx512 => unsafe { avx512::<ANY>(descent) },
    }
}

fn scalar<const ANY: bool>(descent: Descent) {
    descent.run::<Plain, ANY>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn avx2<const ANY: bool>(descent: Descent) {
    descent.run::<Avx2, ANY>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt,avx512f,avx512vl,avx512dq,avx512bw")]
fn avx512<const ANY: bool>(descent: Descent) {
    descent.run::<Avx512, ANY>();
}
