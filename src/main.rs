//! The program `hlacdb`.

fn main() {
    println!("hlacdb {}", env!("CARGO_PKG_VERSION"));
}
