//! Chooses whether the level of every CPU is compiled: always, but with `OVERTAKING_LEVELS=native` only
//! where `overtaking-avx` has none for this CPU.

fn main() {
    println!("cargo::rerun-if-env-changed=OVERTAKING_LEVELS");
    println!("cargo::rustc-check-cfg=cfg(portable)");
    let native = std::env::var("OVERTAKING_LEVELS").is_ok_and(|levels| levels == "native");
    if !native || !has_avx() {
        println!("cargo::rustc-cfg=portable");
    }
}

#[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
fn has_avx() -> bool {
    fearless_simd::Level::new().as_avx2().is_some()
}

#[cfg(not(any(target_arch = "x86", target_arch = "x86_64")))]
fn has_avx() -> bool {
    false
}
