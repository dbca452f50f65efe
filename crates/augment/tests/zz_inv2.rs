#![allow(clippy::unwrap_used)]
mod material;
use material::shared_data;
use sabine_acoustics::*;
use sabine_augment::*;
#[test]
fn inv() {
    let data = shared_data().unwrap();
    let n = ImpulseResponse::from(
        read_audio(&data.join("rir/decayfitnet/singleslope_00006_sh_rirs.wav"), Channel::Index(0)).unwrap(),
    );
    let r = resample_response(&n, 16000).unwrap();
    let augment = T60Augment::new(T60Config::default()).unwrap();
    println!("full {}", augment.full_band_s(&r).unwrap());
    for target in [1.1, 1.5] {
        let c = augment.to_s(&r, target, 5).unwrap();
        println!("len {} -> {}", r.samples().len(), c.samples().len());
        let bank = FilterBank::new(OctaveBands::new(62.5, 8000.0).unwrap(), 16000).unwrap();
        for (hz, p) in bank.split(c.samples()).iter() {
            let e: Vec<i32> = p
                .chunks(1600)
                .map(|c| (10.0 * (c.iter().map(|&s| f64::from(s * s)).sum::<f64>() / 1600.0).log10()) as i32)
                .collect();
            println!("{hz} {e:?}");
        }
    }
}
