//! Reverberation time and equalisation per octave from speech: a small convolutional network, its training, and its weights.
//!
//! It stands between a recording and the fit of a room: [`Estimator`] takes speech and gives
//! [`sabine_acoustics::RoomTargets`]. It hears features of `sabine-features`, implements
//! [`sabine_acoustics::RoomEstimator`], and is where candle lives.
//!
//! It does **not** read files, remove noise, find speech in music, or tell one talker's voice from the colour of the room
//! beyond what an average voice allows: see [`Errors`] for how far the equalisation can be trusted. It makes no data sets:
//! `sabine-augment` does.
//!
//! ```toml
//! [dependencies]
//! sabine-estimator = "0.1"
//! ```
//!
//! # Example
//!
//! ```
//! use sabine_acoustics::{RoomEstimator, Signal};
//! use sabine_estimator::Estimator;
//!
//! // Clicks that decay by 60 dB in 0.3 s, four each second, instead of speech.
//! let fall = |n: usize| 10f32.powf(-3.0 * (n % 4000) as f32 / 4800.0);
//! let noise = |n: usize| ((n * n) as f32 * 0.7).sin();
//! let speech = Signal::new((0..64_000).map(|n| 0.3 * fall(n) * noise(n)).collect(), 16_000)?;
//!
//! let targets = Estimator::pretrained()?.estimate(&speech)?;
//! let t60_s = targets.t60_s().at_hz(1000.0).ok_or("no such octave")?;
//! assert!(t60_s.value > 0.1 && t60_s.value < 0.9, "{t60_s:?}");
//! assert!(t60_s.standard_error > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Which type for what
//!
//! | for | use |
//! |---|---|
//! | an answer with its standard errors | [`Estimator::pretrained`], [`RoomEstimator::estimate`](sabine_acoustics::RoomEstimator::estimate) |
//! | the windows it is made of, and reasons for doubt | [`Estimator::estimate_detailed`], [`Warning`] |
//! | many recordings at once | [`Estimator::estimate_batch`] |
//! | several recordings of one room, other talkers in each | [`Estimator::combine`] |
//! | a live stream | [`LiveEstimator`] |
//! | a guess to compare with | [`ConstantEstimator`] |
//! | training | [`Dataset`], [`TrainConfig`], [`Trainer`] |
//! | errors by octave and room; by length of the recording | [`Evaluation`]; [`RecordingEvaluation`] |
//! | the bare network | [`NetworkConfig`], [`Parameters`], [`Network`] |
//!
//! # Units and conventions
//!
//! Seconds and dB. Labels stand in one order everywhere: seven reverberation times from 125 Hz to 8 kHz, then six levels at
//! 62.5, 125, 250, 500, 2000 and 4000 Hz relative to 1 kHz ([`label_name`]). A window is 4 s at 16 kHz: 32 mel bands times
//! 499 frames. Recordings are cut into windows every 2 s; shorter ones, from 1 s, are repeated. The same seed gives the same
//! weights on any number of threads of one machine.
//!
//! # Accuracy
//!
//! - Gradients of the whole network against central differences of a naive one in double precision, 1e-4 of the largest:
//!   test `every_gradient_meets_central_differences`. Inference against the same: `training_and_folded_networks_meet_the_naive_one`.
//! - Errors of the pretrained weights in measured rooms with unseen speakers, beside a constant guess:
//!   `docs/validation/estimator.md`; data, licences and limits: `docs/model_card.md`.
//!
//! # References
//!
//! - Z. Tang, N. J. Bryan, D. Li, T. R. Langlois, D. Manocha, "Scene-aware audio rendering via deep acoustic analysis", IEEE
//!   TVCG 26(5), 2020: the task, the features and the network.
//! - N. J. Bryan, "Impulse response data augmentation and deep neural networks for blind room acoustic parameter estimation",
//!   ICASSP 2020.
//! - D. P. Kingma, J. Ba, "Adam", ICLR 2015; I. Loshchilov, F. Hutter, "Decoupled weight decay", ICLR 2019.
//! - M. Seitzer et al., "On the pitfalls of heteroscedastic uncertainty estimation", ICLR 2022: the loss.

mod adam;
mod block;
mod calibrate;
mod checkpoint;
mod checksum;
mod combination;
mod combination_fit;
mod combine;
mod config;
mod constant;
mod correlate;
mod cues;
mod dataset;
mod detectors;
mod error;
mod estimator;
mod evaluation;
mod evidence;
mod graph;
mod joint;
mod labels;
mod layout;
mod live;
mod loss;
mod model;
mod network;
mod norm;
mod parameters;
mod perturb;
mod pool;
mod reader;
mod recordings;
mod shape;
mod stack;
mod train_config;
mod trainer;
mod warning;
mod window_estimate;
mod windows;

pub use checksum::add_checksum;
pub use combination::Combination;
pub use combination_fit::HeardPlace;
pub use config::{Block, NetworkConfig, Summary};
pub use constant::ConstantEstimator;
pub use dataset::{Clip, Dataset, Partition};
pub use detectors::{Detectors, Sound};
pub use error::{DatasetFault, Error, WeightsFault};
pub use estimator::{Estimator, LEAST_DURATION_S};
pub use evaluation::{Errors, Evaluation, RoomMean, Selection};
pub use evidence::Evidence;
pub use labels::{EQ_COUNT, LABEL_COUNT, LabelScale, T60_COUNT, T60Scale, label_hz, label_name};
pub use layout::{FeatureLayout, Normalisation};
pub use live::LiveEstimator;
pub use loss::Loss;
pub use model::{Calibration, Model};
pub use network::{Network, Scratch};
pub use parameters::Parameters;
pub use perturb::PerturbConfig;
pub use recordings::{Recording, RecordingEvaluation};
pub use train_config::{EpochRecord, Schedule, TrainConfig};
pub use trainer::{Trained, Trainer};
pub use warning::Warning;
pub use window_estimate::{DetailedEstimate, WindowEstimate};
