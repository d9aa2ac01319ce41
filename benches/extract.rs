//! The speed of the exact sums: every kernel, on one thread and on all, compared with the limit of this machine.
//!
//! ```sh
//! cargo bench --bench extract                 # the table, then the measurements of criterion
//! cargo bench --bench extract -- --table      # the table only
//! ```
//!
//! The limit is 237 multiply-adds (one per mask of three cells) per window, at the rate at which this machine multiplies and
//! adds words in registers, measured in the same run. Results are compared with the scalar reference first. The times of the
//! table are the best of many calls, so that other load on the machine matters little.

#![allow(clippy::unwrap_used, clippy::expect_used, missing_docs)]

use std::hint::black_box;
use std::time::{Duration, Instant};

use criterion::{Criterion, Throughput};
use hlacdb::hlac::kernels::{self, Kernel};
use hlacdb::hlac::{Voxels, extract, extract_parallel, extract_sampled};
use hlacdb::volume::Volume;
use rayon::iter::{IntoParallelRefIterator, ParallelIterator};

/// The number of masks of three cells, which need one multiply-add per window each.
const PRODUCTS: f64 = 237.0;

fn main() {
    let volumes = [64, 128, 256].map(noise);
    check();
    table(&volumes);
    if std::env::args().all(|argument| argument != "--table") {
        let mut criterion = Criterion::default()
            .sample_size(10)
            .measurement_time(Duration::from_secs(2))
            .warm_up_time(Duration::from_millis(500))
            .configure_from_args();
        measure(&mut criterion, &volumes);
        criterion.final_summary();
    }
}

fn noise(side: usize) -> Volume {
    let mut state = side as u64;
    Volume::from_fn([side; 3], |_, _, _| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 24) as u8
    })
    .unwrap()
}

fn voxels(volume: &Volume) -> Voxels<'_> {
    Voxels::new(volume.voxels(), volume.shape()).unwrap()
}

/// Every kernel must give the same sums as the reference before anything is measured.
fn check() {
    let volume = noise(40);
    let expected = Kernel::Scalar.octants(voxels(&volume));
    for kernel in kernels::available() {
        assert_eq!(kernel.octants(voxels(&volume)), expected, "{kernel} differs from the reference");
    }
    assert_eq!(extract_parallel(voxels(&volume)), expected);
    println!("answers: every kernel equals the scalar reference");
}

/// The shortest time of a call in seconds, of at least three calls over about `span`.
fn best<T>(span: Duration, mut call: impl FnMut() -> T) -> f64 {
    let (start, mut best, mut calls) = (Instant::now(), f64::MAX, 0);
    while calls < 3 || start.elapsed() < span {
        let call_start = Instant::now();
        black_box(call());
        best = best.min(call_start.elapsed().as_secs_f64());
        calls += 1;
    }
    best
}

fn table(volumes: &[Volume]) {
    let (name, rate) = limit();
    println!(
        "limit: {:.1} G multiply-adds/s ({name} in registers, one core); active: {}",
        rate / 1e9,
        kernels::active()
    );
    println!(
        "{:>6} {:<20} {:>10} {:>10} {:>12} {:>8} {:>8}",
        "side", "kernel", "ms", "Mvoxel/s", "Gmul-add/s", "x scalar", "% limit"
    );
    for volume in volumes {
        let side = volume.shape()[0];
        let windows = (side - 2).pow(3) as f64;
        // The reference takes the same time for every window, so its time for 64^3 is scaled to larger volumes.
        let scalar = best(Duration::ZERO, || Kernel::Scalar.octants(voxels(&volumes[0]))) * windows / 62_f64.powi(3);
        let row = |name: &str, seconds: f64, cores: f64| {
            let products = PRODUCTS * windows / seconds;
            println!(
                "{side:>6} {name:<20} {:>10.3} {:>10.1} {:>12.2} {:>8.1} {:>8.1}",
                seconds * 1e3,
                (side as f64).powi(3) / seconds / 1e6,
                products / 1e9,
                scalar / seconds,
                100.0 * products / (rate * cores),
            );
        };
        row("scalar", scalar, 1.0);
        for kernel in kernels::available().filter(|kernel| *kernel != Kernel::Scalar) {
            let span = Duration::from_millis(if kernel == Kernel::Portable { 0 } else { 1500 });
            if kernel != Kernel::Portable || side <= 64 {
                row(kernel.name(), best(span, || kernel.octants(voxels(volume))), 1.0);
            }
        }
        let threads = rayon::current_num_threads();
        let span = Duration::from_millis(1500);
        row(&format!("active, {threads} threads"), best(span, || extract_parallel(voxels(volume))), threads as f64);
    }
    many(&volumes[0]);
    binary(&volumes[0]);
    sampled(&volumes[0]);
}

/// Many volumes in parallel, one per core, compared with the same volumes one after another.
fn many(volume: &Volume) {
    let volumes = vec![volume.clone(); 64];
    let span = Duration::from_millis(1500);
    let one = best(span, || volumes.iter().map(|volume| extract(voxels(volume)).total().values[0]).sum::<u64>());
    let all = best(span, || volumes.par_iter().map(|volume| extract(voxels(volume)).total().values[0]).sum::<u64>());
    println!(
        "64 volumes of 64^3: {:.1} ms by one thread, {:.1} ms by {} ({:.2} times)",
        one * 1e3,
        all * 1e3,
        rayon::current_num_threads(),
        one / all
    );
}

fn binary(volume: &Volume) {
    let black_and_white: Vec<u8> = volume.voxels().iter().map(|voxel| if voxel % 2 == 0 { 0 } else { 255 }).collect();
    let voxels = Voxels::new(&black_and_white, volume.shape()).unwrap();
    let span = Duration::from_millis(500);
    let dense = best(span, || kernels::active().octants(voxels));
    let bits = best(span, || Kernel::octants_by_counting(voxels));
    println!("64^3 of 0 and 255: {:.3} ms by bits, {:.1} times the kernel", bits * 1e3, dense / bits);
}

/// The number of random windows that cost as much as the exact sums of all windows.
fn sampled(volume: &Volume) {
    let exact = best(Duration::from_millis(500), || extract(voxels(volume)));
    let window = best(Duration::from_millis(500), || extract_sampled(voxels(volume), 10_000, 1).unwrap()) / 10_000.0;
    println!(
        "random windows: {:.0} ns each; all {} exactly cost as much as {:.0} of them",
        window * 1e9,
        62_u64.pow(3),
        exact / window
    );
}

/// The name and the rate (words per second) of the machine's fastest multiply-add of words.
fn limit() -> (&'static str, f64) {
    #[cfg(target_arch = "x86_64")]
    {
        if is_x86_feature_detected!("avx512vnni") && is_x86_feature_detected!("avx512f") {
            // SAFETY: the CPU has these instructions, as was checked just before.
            return ("vpdpwssd", rate(32.0, |rounds| unsafe { registers::vnni(rounds) }));
        }
        if is_x86_feature_detected!("avx2") {
            // SAFETY: as above.
            return ("vpmaddwd", rate(16.0, |rounds| unsafe { registers::avx2(rounds) }));
        }
    }
    ("scalar multiply-add", rate(1.0, scalar_rounds))
}

/// Words per second of `call(rounds)`, which runs 20 instructions of `words` words per round.
fn rate(words: f64, call: impl Fn(u64)) -> f64 {
    const ROUNDS: u64 = 20_000;
    20.0 * words * ROUNDS as f64 / best(Duration::from_millis(300), || call(ROUNDS))
}

fn scalar_rounds(rounds: u64) {
    let mut sums = [0_i32; 20];
    for round in 0..rounds as i32 {
        for (lane, sum) in sums.iter_mut().enumerate() {
            *sum = sum.wrapping_add(black_box(round).wrapping_mul(lane as i32));
        }
    }
    black_box(sums);
}

/// Loops of 20 independent multiply-adds.
#[cfg(target_arch = "x86_64")]
mod registers {
    use std::arch::asm;

    macro_rules! rounds {
        ($name:ident, $features:literal, [$($line:literal)+]) => {
            /// # Safety
            /// The CPU must have the instructions.
            #[target_feature(enable = $features)]
            pub(crate) unsafe fn $name(rounds: u64) {
                // SAFETY: only registers are used, and all of them are declared as clobbered.
                unsafe {
                    asm!(
                        "2:", $($line,)+ "dec {rounds}", "jnz 2b",
                        rounds = inout(reg) rounds.max(1) => _,
                        out("xmm0") _, out("xmm1") _, out("xmm2") _, out("xmm3") _, out("xmm4") _, out("xmm5") _,
                        out("xmm6") _, out("xmm7") _, out("xmm8") _, out("xmm9") _, out("xmm10") _, out("xmm11") _,
                        out("xmm12") _, out("xmm13") _, out("xmm14") _, out("xmm15") _,
                        options(nomem, nostack),
                    );
                }
            }
        };
    }

    rounds!(vnni, "avx512f,avx512vnni", [
        "vpdpwssd zmm0, zmm14, zmm15" "vpdpwssd zmm1, zmm14, zmm15" "vpdpwssd zmm2, zmm14, zmm15"
        "vpdpwssd zmm3, zmm14, zmm15" "vpdpwssd zmm4, zmm14, zmm15" "vpdpwssd zmm5, zmm14, zmm15"
        "vpdpwssd zmm6, zmm14, zmm15" "vpdpwssd zmm7, zmm14, zmm15" "vpdpwssd zmm8, zmm14, zmm15"
        "vpdpwssd zmm9, zmm14, zmm15" "vpdpwssd zmm0, zmm14, zmm15" "vpdpwssd zmm1, zmm14, zmm15"
        "vpdpwssd zmm2, zmm14, zmm15" "vpdpwssd zmm3, zmm14, zmm15" "vpdpwssd zmm4, zmm14, zmm15"
        "vpdpwssd zmm5, zmm14, zmm15" "vpdpwssd zmm6, zmm14, zmm15" "vpdpwssd zmm7, zmm14, zmm15"
        "vpdpwssd zmm8, zmm14, zmm15" "vpdpwssd zmm9, zmm14, zmm15"
    ]);
    rounds!(avx2, "avx2", [
        "vpmaddwd ymm0, ymm14, ymm15" "vpmaddwd ymm1, ymm14, ymm15" "vpmaddwd ymm2, ymm14, ymm15"
        "vpmaddwd ymm3, ymm14, ymm15" "vpmaddwd ymm4, ymm14, ymm15" "vpmaddwd ymm5, ymm14, ymm15"
        "vpmaddwd ymm6, ymm14, ymm15" "vpmaddwd ymm7, ymm14, ymm15" "vpmaddwd ymm8, ymm14, ymm15"
        "vpmaddwd ymm9, ymm14, ymm15" "vpmaddwd ymm0, ymm14, ymm15" "vpmaddwd ymm1, ymm14, ymm15"
        "vpmaddwd ymm2, ymm14, ymm15" "vpmaddwd ymm3, ymm14, ymm15" "vpmaddwd ymm4, ymm14, ymm15"
        "vpmaddwd ymm5, ymm14, ymm15" "vpmaddwd ymm6, ymm14, ymm15" "vpmaddwd ymm7, ymm14, ymm15"
        "vpmaddwd ymm8, ymm14, ymm15" "vpmaddwd ymm9, ymm14, ymm15"
    ]);
}

fn measure(criterion: &mut Criterion, volumes: &[Volume]) {
    for volume in volumes {
        let side = volume.shape()[0];
        let mut group = criterion.benchmark_group(format!("extract {side}^3"));
        group.throughput(Throughput::Elements((side as u64).pow(3)));
        for kernel in kernels::available() {
            let slow = matches!(kernel, Kernel::Scalar | Kernel::Portable);
            if !slow || side == 64 {
                group.bench_function(kernel.name(), |b| b.iter(|| kernel.octants(voxels(volume))));
            }
        }
        group.bench_function("active, all threads", |b| b.iter(|| extract_parallel(voxels(volume))));
        group.finish();
    }
}
