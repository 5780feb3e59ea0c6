//! One compilation of the sampler for each kind of register, chosen at run time.

use map3d_base::Isa;

use crate::sample::sampler::Sampler;
use crate::sample::tap::PlainSum;
#[cfg(target_arch = "x86_64")]
use crate::sample::tap::WideSum;

/// `isa`: of the sampler's plan, which has checked that this machine has it.
#[inline]
pub(super) fn sample(isa: Isa, sampler: &Sampler, x: i32, y: i32) -> [u16; 3] {
    match isa {
        Isa::Scalar => sampler.sample_with::<PlainSum>(x, y),
        // SAFETY: a plan is made only with an instruction set that the processor says it has; both have AVX2.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 | Isa::Avx512 => unsafe { wide_sample(sampler, x, y) },
    }
}

/// As `sample`.
#[inline]
pub(super) fn row(isa: Isa, sampler: &Sampler, x: i32, y: i32, out: &mut [[u16; 4]]) {
    match isa {
        Isa::Scalar => sampler.row_with::<PlainSum>(x, y, out),
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Isa::Avx2 | Isa::Avx512 => unsafe { wide_row(sampler, x, y, out) },
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn wide_sample(sampler: &Sampler, x: i32, y: i32) -> [u16; 3] {
    sampler.sample_with::<WideSum>(x, y)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
fn wide_row(sampler: &Sampler, x: i32, y: i32, out: &mut [[u16; 4]]) {
    sampler.row_with::<WideSum>(x, y, out);
}
