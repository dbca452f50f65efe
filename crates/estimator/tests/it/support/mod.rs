//! A data set small enough for tests: bursts of noise that decay as fast as their labels say, coloured as their labels say.

use half::f16;
use rand::{Rng, SeedableRng};
use rand_pcg::Pcg64Mcg;
use safetensors::Dtype;
use safetensors::tensor::TensorView;
use sha2::{Digest, Sha256};
use std::path::Path;

pub const MELS: usize = 32;
pub const FRAMES: usize = 499;

/// Content of a shard.
#[derive(Clone, Default)]
pub struct Shard {
    pub features: Vec<f32>,
    pub t60_s: Vec<f32>,
    pub eq_db: Vec<f32>,
    pub room: Vec<i64>,
    pub speaker: Vec<i64>,
}

impl Shard {
    /// `clips` clips, two in each room; rooms and speakers are numbered from `first`.
    pub fn synthetic(clips: usize, first: i64, seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let mut shard = Self::default();
        for clip in 0..clips {
            let t60_s: f32 = rng.random_range(0.2..1.5);
            let tilt_db: f32 = rng.random_range(-3.0..3.0);
            let fall_db = 60.0 / t60_s * 0.008;
            let mut level_db = vec![-60.0f32; FRAMES];
            let mut next = 0;
            for t in 0..FRAMES {
                level_db[t] = if t == next {
                    next += rng.random_range(30..90);
                    rng.random_range(-20.0..-10.0)
                } else {
                    (level_db[t.max(1) - 1] - fall_db).max(-60.0)
                };
            }
            for mel in 0..MELS {
                let colour_db = tilt_db * (mel as f32 - 10.0) / 7.0;
                shard.features.extend(level_db.iter().map(|l| l + colour_db + rng.random_range(-2.0..2.0)));
            }
            shard.t60_s.extend([t60_s; 7]);
            // Octaves below and above 1 kHz, which lies in mel band 10.
            shard.eq_db.extend([-1.4, -1.3, -1.1, -0.7, 1.1, 2.2].map(|slope| slope * tilt_db));
            shard.room.push(first + clip as i64 / 2);
            shard.speaker.push(first + clip as i64 / 4);
        }
        shard
    }

    fn encode(&self) -> Vec<u8> {
        let n = self.room.len();
        let floats = |v: &[f32]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let integers = |v: &[i64]| v.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let features: Vec<u8> = self.features.iter().flat_map(|v| f16::from_f32(*v).to_le_bytes()).collect();
        let tensors = [
            ("features", Dtype::F16, vec![n, MELS, FRAMES], features),
            ("t60_s", Dtype::F32, vec![n, 7], floats(&self.t60_s)),
            ("eq_db", Dtype::F32, vec![n, 6], floats(&self.eq_db)),
            ("snr_db", Dtype::F32, vec![n], floats(&vec![30.0; n])),
            ("drr_db", Dtype::F32, vec![n], floats(&vec![0.0; n])),
            ("room", Dtype::I64, vec![n], integers(&self.room)),
            ("speaker", Dtype::I64, vec![n], integers(&self.speaker)),
        ];
        let views = tensors.iter().map(|(name, dtype, shape, bytes)| {
            (*name, TensorView::new(*dtype, shape.clone(), bytes).expect("a tensor of this shape"))
        });
        safetensors::serialize(views, None).expect("whole tensors")
    }
}

/// Writes a data set of these shards.
pub fn write(folder: &Path, shards: &[(&str, Shard)]) {
    let mut entries = Vec::new();
    for (i, (partition, shard)) in shards.iter().enumerate() {
        let bytes = shard.encode();
        let file = format!("{partition}-{i:05}.safetensors");
        std::fs::write(folder.join(&file), &bytes).expect("a writable folder");
        let sha256: String = Sha256::digest(&bytes).iter().map(|b| format!("{b:02x}")).collect();
        let clips = shard.room.len();
        entries.push(
            serde_json::json!({"file": file, "partition": partition, "clips": clips, "sha256": sha256}),
        );
    }
    let manifest = serde_json::json!({
        "format": "sabine-dataset-1", "sample_rate_hz": 16000, "mels": MELS, "frames": FRAMES,
        "t60_bands_hz": [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0],
        "eq_bands_hz": [62.5, 125.0, 250.0, 500.0, 2000.0, 4000.0],
        "shards": entries,
    });
    std::fs::write(folder.join("manifest.json"), manifest.to_string()).expect("a writable folder");
}

/// The usual one: 96 clips to train on, 32 for validation, 16 for the test.
pub fn usual(folder: &Path) {
    let shards = [
        ("train", Shard::synthetic(96, 0, 1)),
        ("validation", Shard::synthetic(32, 1000, 2)),
        ("test", Shard::synthetic(16, 2000, 3)),
    ];
    write(folder, &shards);
}
