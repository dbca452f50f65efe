//! probe
use sabine_acoustics::*;
use sabine_testkit::{LabConfig, Laboratory};
fn main() {
    let seed: u64 = std::env::args().nth(1).unwrap().parse().unwrap();
    let lab = Laboratory::new(LabConfig { seed, ..LabConfig::default() }).unwrap();
    println!("{:#?}", lab.truth(&[]).unwrap().materials);
    println!("{:?} {:?}", lab.air(), lab.sources());
    for r in lab.responses(&[]).unwrap().iter().take(3) {
        let b = FilterBank::new(OctaveBands::T60, 48000).unwrap().analyse(r.samples());
        for k in 0..2 {
            let e: Vec<f64> = b.values()[k].chunks(1440).map(|c| c.iter().map(|x| f64::from(*x).powi(2)).sum()).collect();
            let t: f64 = e.iter().sum();
            println!("{k}: {:?}", e.iter().map(|x| (10.0*(x/t).log10()).round()).collect::<Vec<_>>());
        }
    }
}
