//! Instruction sets. Each kernel is compiled for all of them and chosen at run time; all give equal bytes.

/// An instruction set that this machine has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Isa {
    Scalar,
    #[cfg(target_arch = "x86_64")]
    Avx2,
    #[cfg(target_arch = "x86_64")]
    Avx512,
}

impl Isa {
    /// Returns the instruction sets of this machine, the fastest last.
    pub fn available() -> Vec<Self> {
        let mut out = vec![Self::Scalar];
        #[cfg(target_arch = "x86_64")]
        {
            if has_avx2() {
                out.push(Self::Avx2);
            }
            if has_avx512() {
                out.push(Self::Avx512);
            }
        }
        out
    }

    pub fn best() -> Self {
        *Self::available().last().expect("scalar is always there")
    }
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    let bits = is_x86_feature_detected!("bmi1") && is_x86_feature_detected!("bmi2") && is_x86_feature_detected!("lzcnt");
    is_x86_feature_detected!("avx2") && bits && is_x86_feature_detected!("popcnt")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    let wide = is_x86_feature_detected!("avx512f") && is_x86_feature_detected!("avx512vl") && is_x86_feature_detected!("avx512dq");
    has_avx2() && wide && is_x86_feature_detected!("avx512bw")
}
