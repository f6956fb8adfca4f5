//! Draws a contact sheet of the procedural textures: a row for each family in [`Family::ALL`]'s order, a column for each
//! seed. `cargo run --release -p grip-sim --example textures -- OUT.png`

use std::time::Instant;

use grip_sim::render::textures::Family;
use image::RgbImage;
use image::imageops::{FilterType, replace, resize};

const SEEDS: u32 = 8;
const SIDE: u32 = 190;

#[expect(clippy::print_stdout, reason = "the times are what one runs this for, beside the sheet")]
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or("textures.png".into());
    let mut sheet = RgbImage::new(SEEDS * SIDE, Family::ALL.len() as u32 * SIDE);
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    for (row, family) in Family::ALL.iter().enumerate() {
        let mut slowest = 0.0_f64;
        for seed in 0..SEEDS {
            let draw = || pool.install(|| family.draw(u64::from(seed), 512));
            // The best of three: what it takes when nothing else runs.
            let best = (0..3).map(|_| {
                let start = Instant::now();
                std::hint::black_box(draw());
                start.elapsed().as_secs_f64()
            });
            slowest = slowest.max(best.fold(f64::INFINITY, f64::min));
            let swatch = draw();
            let small = resize(&swatch.image, SIDE - 4, SIDE - 4, FilterType::Triangle);
            replace(&mut sheet, &small, i64::from(seed * SIDE), (row as u32 * SIDE).into());
        }
        println!("{:10} 512 px, one thread: {:.1} ms for the slowest seed", family.name(), 1e3 * slowest);
    }
    sheet.save(path)?;
    Ok(())
}
