#![no_main]
libfuzzer_sys::fuzz_target!(|data: &[u8]| hlacdb_fuzz::http(data));
