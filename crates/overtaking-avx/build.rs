//! Chooses the SIMD levels that are compiled: all, or with `OVERTAKING_LEVELS=native` the best of this CPU.

fn main() {
    println!("cargo::rerun-if-env-changed=OVERTAKING_LEVELS");
    println!("cargo::rustc-check-cfg=cfg(avx2, avx512)");
    let native = std::env::var("OVERTAKING_LEVELS").is_ok_and(|levels| levels == "native");
    let [avx512, avx2] = best();
    for (name, is_best) in [("avx512", avx512), ("avx2", avx2)] {
        if is_best || !native {
            println!("cargo::rustc-cfg={name}");
        }
    }
}

/// Whether AVX-512 is the best level of this CPU, and whether AVX2 is.
#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fn best() -> [bool; 2] {
    let level = fearless_simd::Level::new();
    let avx512 = level.as_avx512().is_some();
    [avx512, !avx512 && level.as_avx2().is_some()]
}

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
fn best() -> [bool; 2] {
    [false; 2]
}
