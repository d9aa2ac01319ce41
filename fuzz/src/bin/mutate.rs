//! The stable runner: mutates seeds for some seconds per target, and stops at the first input that panics.
//!
//!     cargo run --release -- [SECONDS [TARGET...]]

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::{Duration, Instant};

use hlacdb_fuzz::{TARGETS, seeds};

struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() >> 11) as usize % end.max(1)
    }
}

/// Bytes that lie well: ends of ranges, and what text formats trip over.
const TOKENS: &[&[u8]] = &[
    &[0; 4], &[0xff; 8], &[0xff, 0x7f], &[0, 0, 0, 0x80], &[1, 0, 0, 0], b"-1", b"99999999999999999999", b"\n", b"\n\n", b"(", b",", b"[", b"'",
    b"nan", b"1e999", b" ../", b"{", b"=", b":", b"\"",
];

fn mutate(noise: &mut Noise, pool: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = pool[noise.below(pool.len())].clone();
    for _ in 0..=noise.below(6) {
        let at = noise.below(bytes.len() + 1);
        match noise.below(8) {
            0 if at < bytes.len() => bytes[at] ^= 1 << noise.below(8),
            1 if at < bytes.len() => bytes[at] = noise.next() as u8,
            2 => bytes.truncate(at),
            3 => {
                let token = TOKENS[noise.below(TOKENS.len())];
                bytes.splice(at..at, token.iter().copied());
            }
            4 => {
                let token = TOKENS[noise.below(TOKENS.len())];
                let end = bytes.len().min(at + token.len());
                bytes[at..end].copy_from_slice(&token[..end - at]);
            }
            5 => {
                let end = bytes.len().min(at + noise.below(40));
                bytes.drain(at..end);
            }
            6 => {
                let end = bytes.len().min(at + noise.below(40));
                let part = bytes[at..end].to_vec();
                bytes.splice(at..at, part);
            }
            _ => {
                let other = &pool[noise.below(pool.len())];
                let from = noise.below(other.len() + 1);
                let end = other.len().min(from + noise.below(64));
                bytes.splice(at..at, other[from..end].iter().copied());
            }
        }
    }
    bytes.truncate(1 << 16);
    bytes
}

fn peak() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("VmHWM: unknown").to_owned()
}

fn main() {
    let mut arguments = std::env::args().skip(1);
    let seconds: u64 = arguments.next().map_or(60, |seconds| seconds.parse().expect("seconds"));
    let wanted: Vec<String> = arguments.collect();
    let seed = std::env::var("HLACDB_SEED").map_or(88_172_645_463_325_252, |seed| seed.parse().expect("a seed"));
    println!("HLACDB_SEED={seed}");
    let mut failed = false;
    for (name, target) in TARGETS.iter().filter(|(name, _)| wanted.is_empty() || wanted.iter().any(|one| one == name)) {
        let mut noise = Noise(seed | 1);
        let mut pool: Vec<Vec<u8>> = seeds(name).iter().filter_map(|path| std::fs::read(path).ok()).collect();
        pool.push(Vec::new());
        pool.push(vec![0; 64]);
        let until = Instant::now() + Duration::from_secs(seconds);
        let (mut runs, mut slowest) = (0_u64, Duration::ZERO);
        while Instant::now() < until {
            let input = mutate(&mut noise, &pool);
            let began = Instant::now();
            let outcome = catch_unwind(AssertUnwindSafe(|| target(&input)));
            slowest = slowest.max(began.elapsed());
            runs += 1;
            if outcome.is_err() {
                let file = format!("finding-{name}-{runs}");
                std::fs::write(&file, &input).expect("the finding as a file");
                println!("{name}: a panic, input in {file}");
                failed = true;
                break;
            }
        }
        println!("{name}: {runs} inputs in {seconds} s, slowest {slowest:?}, {}", peak());
    }
    std::process::exit(i32::from(failed));
}
