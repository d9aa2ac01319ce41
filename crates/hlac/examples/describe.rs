//! Describes a raw file of 8-bit voxels, or a small volume made here, by the sums of its views.
//!
//! ```text
//! cargo run -p hlac --example describe                          # a volume made by this program
//! cargo run -p hlac --example describe -- core.raw 200,512,512  # a file, and its shape Z,Y,X (X fastest)
//! ```

use std::error::Error;

use hlac::{MASKS, View, Voxels, kernels};

/// The masks whose moments are printed: the mean, two pairs and a triple.
const SHOWN: [usize; 4] = [0, 1, 6, 14];

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (slice, shape) = match arguments.as_slice() {
        [] => balls([48, 48, 48]),
        [file, shape] => (std::fs::read(file)?, parse_shape(shape)?),
        _ => return Err("usage: describe [FILE Z,Y,X]".into()),
    };
    let volume = Voxels::new(&slice, shape)?;

    println!("{} x {} x {} voxels (Z, Y, X), kernel {}", shape[0], shape[1], shape[2], kernels::active());
    print!("{:<10} {:>10}", "view", "windows");
    for mask in SHOWN {
        print!(" {:>10}", format!("mask {}", MASKS[mask].letters()));
    }
    println!();
    for (view, octants) in hlac::describe(volume, &View::ALL) {
        let sums = octants.total();
        let moments = sums.moments();
        print!("{view:<10} {:>10}", sums.windows);
        for mask in SHOWN {
            print!(" {:>10.6}", moments[mask]);
        }
        println!();
    }
    Ok(())
}

/// A shape written as `Z,Y,X`.
fn parse_shape(text: &str) -> Result<[usize; 3], Box<dyn Error>> {
    let sides = text.split(',').map(str::parse).collect::<Result<Vec<usize>, _>>()?;
    sides.try_into().map_err(|_| "a shape has three sides: Z,Y,X".into())
}

/// A lattice of bright balls on a dark, slightly uneven ground.
fn balls(shape: [usize; 3]) -> (Vec<u8>, [usize; 3]) {
    let mut voxels = Vec::with_capacity(shape.iter().product());
    for z in 0..shape[0] {
        for y in 0..shape[1] {
            for x in 0..shape[2] {
                let squared: usize = [z, y, x].map(|at| (at % 12).abs_diff(6).pow(2)).iter().sum();
                voxels.push(if squared < 20 { 220 } else { 30 + ((z * 7 + y * 5 + x * 3) % 16) as u8 });
            }
        }
    }
    (voxels, shape)
}
