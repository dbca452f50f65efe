//! From "I have a phone recording" to "why is my simulation wrong", one step after another.
//!
//! Each step has the command that does it, for those who do not program, and the code that does it. All code runs with the tests of
//! this crate on the files in `fixtures/` of the repository; put your own in their place. Commands are run there
//! (`sabine COMMAND --help` says more; `cargo install --path crates/cli` installs it).
//!
//! ```text
//!  1 a recording ──► 2 what the room does to sound ─┐
//!                                                   ├─► 5 matched ─► 6 new sound in the room, live too
//!  3 a model of it ─► 4 a simulation ───────────────┘      │
//!                           │                              ▼
//!  7 measured responses ────┴─► materials fitted ─► 8 why is it still wrong? ─► 9 what would another material do?
//! ```
//!
//! # 1. Read a recording
//! Speech in the room, four seconds or more, 16 kHz or more, a distance away from the talker; no music, no processing. A phone will do if
//! its automatic gain can be turned off. WAV always; FLAC, Ogg Vorbis and AIFF with the feature `symphonia`.
//! ```
//! use sabine::acoustics::{Channel, read_audio};
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let recording = read_audio("fixtures/speech/recording.wav", Channel::Mono)?;
//! assert!(recording.duration_s() > 4.0 && recording.sample_rate_hz() >= 16_000);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 2. Hear the room in it
//! `sabine estimate recording.wav`. Reverberation time and equalisation per octave, each with a standard error: equalisation is
//! uncertain, low octaves more than high ones. [`Estimator`](crate::estimator::Estimator) hears 16 kHz.
//! ```
//! use sabine::acoustics::{Channel, read_audio, resample};
//! use sabine::estimator::Estimator;
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let estimator = Estimator::pretrained()?;
//! let recording = read_audio("fixtures/speech/recording.wav", Channel::Mono)?;
//! let heard = estimator.estimate_detailed(&resample(&recording, estimator.sample_rate_hz())?)?;
//! let t60 = heard.targets.t60_s().at_hz(1000.0).ok_or("no such octave")?;
//! // The room that this was made in has 0.763 s (`fixtures/truth.json`).
//! assert!((t60.value - 0.763).abs() < 0.11, "{t60:?}");
//! assert!(t60.standard_error > 0.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! Have you an impulse response (a sweep, a balloon) instead of speech? Then measure, do not guess: `sabine measure response.wav`.
//! ```
//! use sabine::acoustics::{Bands, Channel, ImpulseResponse, RoomParameters, read_audio};
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let response: ImpulseResponse = read_audio("fixtures/room/ir/talker_microphone.wav", Channel::Mono)?.into();
//! let room = RoomParameters::measure(&response, Bands::T60)?;
//! let t60 = room.t60_s.at_hz(1000.0).ok_or("no such octave")?.clone()?;
//! assert!((t60.value - 0.763).abs() < 3.0 * t60.standard_error + 0.02);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 3. Describe the room
//! A folder with a mesh and a `room.toml` (format, `docs/measured-room.md`): walls, floor, ceiling and what is as large as a
//! person, to 5 cm; finer detail belongs into scattering. Materials from the library or a table, and **how far you trust them**
//! (`absorption_sd`): the fit moves what you doubt.
//! ```
//! use sabine::acoustics::{Bands, library_material};
//! use sabine::scene::MeasuredRoom;
//! use sabine::propagate::MeshReport;
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let room = MeasuredRoom::read("fixtures/room")?;
//! assert!((room.scene().volume_m3() - 145.7).abs() < 0.1);
//! // Holes let sound out, and are named.
//! let mesh = MeshReport::inspect(room.scene(), room.source("talker")?.position_m)?;
//! assert!(mesh.is_closed() && mesh.escape_rate() == 0.0);
//! // What a thin carpet swallows at 1 kHz, from the library.
//! let carpet = library_material("carpet_thin")?.material(Bands::T60)?;
//! assert_eq!(carpet.absorption().at_hz(1000.0), Some(&0.2));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 4. Simulate it
//! `sabine trace --room DIR --out DIR`. Paths are traced once; materials, air and directivity act on them afterwards.
//! ```
//! use sabine::acoustics::Bands;
//! use sabine::paths::{Conditions, PathParameters, Propagator};
//! use sabine::scene::{DiffuseRoom, MeasuredRoom};
//! use sabine::propagate::{PathTracer, PressureRenderer, RenderConfig, TracerConfig};
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let room = MeasuredRoom::read("fixtures/room")?;
//! let (source, receiver) = (room.source("talker")?, room.receiver("microphone")?);
//! let tracer = PathTracer::new(TracerConfig { rays: 5_000, duration_s: 1.5, ..TracerConfig::default() })?;
//! let paths = tracer.trace(room.scene(), source, receiver, &room.air(), &())?;
//! let materials: Vec<_> = room.scene().materials().iter().map(|m| m.material.clone()).collect();
//!
//! let response = PressureRenderer::new(RenderConfig::default())?.render(&paths, &Conditions::new(&materials, &room.air()))?;
//! // The direct sound comes after the way from the talker to the microphone, and not before.
//! let distance_m = (0..3).map(|k| (source.position_m[k] - receiver.position_m[k]).powi(2)).sum::<f64>().sqrt();
//! let direct = (distance_m / room.air().speed_of_sound_m_s() * f64::from(response.sample_rate_hz())) as usize;
//! let before: f32 = response.samples()[..direct - 100].iter().map(|s| s * s).sum();
//! let around: f32 = response.samples()[direct - 100..direct + 100].iter().map(|s| s * s).sum();
//! assert!(around > 1000.0 * before);
//!
//! // A room that is not diffuse need not meet Eyring's formula, but it is of that size.
//! let energy = paths.energy_response(&Conditions::new(&materials, &room.air()), 1e-3)?;
//! let at_1_khz = room.bands().index_of(1000.0).ok_or("no such octave")?;
//! let t30_s = energy.decay_curve(at_1_khz).decay_time_s(-5.0, -35.0)?;
//! let eyring_s = DiffuseRoom::of_scene(room.scene(), &room.air(), room.bands())?.values()[at_1_khz].eyring_t60_s();
//! assert!((t30_s / eyring_s - 1.0).abs() < 0.4, "{t30_s} s and {eyring_s} s");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 5. Match it to the recording
//! `match_room -- --speech recording.wav --room DIR --source s1 --receiver r1 --dry voice.wav --out DIR`. Listening, tracing, the fit
//! of absorption, the filter for what geometry cannot give: one call, [`match_room`](crate::match_room), whose example is on the
//! [front page](crate). [`MatchSummary`](crate::MatchSummary) puts the result into JSON, [`materials_toml`](crate::materials_toml) the fitted
//! materials into a room file.
//!
//! Heed the warnings (`RoomMatch::warnings`): what was heard badly, which octaves no material can reach, where the mesh leaks.
//! One reverberation time for each octave does not tell eight materials apart: read `not_determined` before you read an absorption.
//!
//! # 6. Place other sound there
//! The matched response and its filter are good for any dry sound; `sabine live` does it while somebody speaks, `sabine walk` while somebody
//! walks. For head responses turn on the feature `sofa`.
//! ```
//! use sabine::acoustics::{Bands, PerBand, Signal};
//! use sabine::eqfilter::{EqFilter, EqFilterConfig, PartitionedConfig, PartitionedConvolver, convolve};
//! let gains_db = PerBand::from_fn(Bands::EQ, |band| if band == 4 { 6.0 } else { 0.0 }); // 1 kHz
//! let filter = EqFilter::design(&gains_db, 48_000, EqFilterConfig::default())?;
//! let tone = (0..48_000).map(|n| (std::f32::consts::TAU * n as f32 / 48.0).sin()).collect();
//! let louder = filter.apply(&Signal::new(tone, 48_000)?)?;
//! assert!(louder.peak() > 1.9); // 6 dB and a little: the octave's mean, most at its centre
//!
//! // At once, or block by block: the same sound.
//! let (response, sound) = (vec![0.5; 3000], vec![1.0; 1024]);
//! let whole = convolve(&sound, &response);
//! let mut live = PartitionedConvolver::new(&response, PartitionedConfig { block: 256, ..PartitionedConfig::default() })?;
//! let mut block = [0.0; 256];
//! live.process_block(&sound[..256], &mut block)?;
//! assert!(live.latency_samples() == 0 && (block[255] / whole[255] - 1.0).abs() < 1e-4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # 7. Measure, and fit the materials to that
//! Responses beside the model make it a *measured* room. `sabine fit --room DIR --responses --hold-out r3 --out DIR`, then
//! `sabine validate --room DIR` for what was not fitted. In code: calibrate a room, `docs/how-to/calibrate-a-room.md`.
//! A folder can be written from Rust, too ([`NewRoom`](crate::scene::NewRoom)); the next step does.
//!
//! # 8. Why is my simulation wrong?
//! `diagnose -- --room DIR --hold-out r3 --out DIR`. The simulation never agrees with the measurement exactly. [`Diagnoser`](crate::diagnose::Diagnoser)
//! says what of the disagreement is chance, what has a cause, which, how large, and what it gains at positions that it has not seen; or that
//! it does not know. Here somebody has forgotten to take out 5 ms of latency:
//! ```
//! use sabine::acoustics::ImpulseResponse;
//! use sabine::scene::{MeasuredRoom, NewResponse, NewRoom};
//! use sabine::diagnose::{DiagnoseConfig, Diagnoser, Verdict};
//! # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))?;
//! let room = MeasuredRoom::read("fixtures/room")?;
//! let responses = room.responses().iter().enumerate().map(|(i, entry)| {
//!     let response = room.load_response(i)?;
//!     let mut samples = vec![0.0; (0.005 * f64::from(response.sample_rate_hz())) as usize];
//!     samples.extend(response.samples());
//!     let (source, receiver) = (room.sources()[entry.source].id.clone(), room.receivers()[entry.receiver].id.clone());
//!     let name = format!("{source}_{receiver}");
//!     let samples = ImpulseResponse::new(samples, response.sample_rate_hz())?;
//!     Ok(NewResponse { source, receiver, name, air: None, session: None, recorded_at: None, samples })
//! });
//! let late = NewRoom {
//!     scene: room.scene().clone(),
//!     priors: room.priors().to_vec(),
//!     air: Some(room.air()),
//!     measurement: room.measurement(), // "sample 0 is the instant of emission": no longer true
//!     position_sd: room.position_sd().clone(),
//!     sources: room.sources().to_vec(),
//!     receivers: room.receivers().to_vec(),
//!     responses: responses.collect::<Result<_, sabine::scene::Error>>()?,
//! };
//! # let folder = std::env::temp_dir().join(format!("sabine_guide_{}", std::process::id()));
//! # let _ = std::fs::remove_dir_all(&folder);
//! let late = late.write(&folder)?;
//! let config = DiagnoseConfig { rays: 500, simulations: 10, ..DiagnoseConfig::default() };
//! let found = Diagnoser::new(config)?
//!     .with_only(&["time_zero", "sound_speed", "position_error"].map(str::to_owned))?
//!     .diagnose(&late, &[], &());
//! # std::fs::remove_dir_all(&folder)?;
//! let found = found?;
//! let cause = found.causes.first().ok_or("nothing named")?;
//! assert_eq!((cause.effect.as_str(), cause.parameters[0].unit.as_str()), ("time_zero", "ms"));
//! assert!((cause.parameters[0].value - 5.0).abs() < 0.2, "{}", cause.parameters[0].value);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//! What the catalogue lacks can be added, `docs/how-to/own-effect.md`. How a cause is weighed: explanation, `docs/explanation/diagnosis.md`.
//!
//! # 9. What would another material do?
//! `sabine replace --room DIR ...`: T60, C50 and D50 before and after with the uncertainty of their difference
//! ([`PredictedChange`](crate::optimize::PredictedChange)), and both to listen to.
//!
//! # Parts of your own
//! [`match_room_with`](crate::match_room_with) takes any [`RoomEstimator`](crate::acoustics::RoomEstimator) and any
//! [`Propagator`](crate::paths::Propagator): own estimator, `docs/how-to/own-estimator.md`, own tracer, `docs/how-to/own-tracer.md`,
//! training on own data, `docs/how-to/train-on-my-data.md`.
//!
//! # Feature flags
//! | feature | what it adds | costs |
//! |---|---|---|
//! | none | WAV, OBJ and glTF; all crates | |
//! | `symphonia` | FLAC, Ogg Vorbis and AIFF wherever sound is read | a dependency under MPL-2.0 |
//! | `sofa` | head-related responses from AES69 files ([`HeadResponses`](crate::propagate::HeadResponses)) | the crate `sofar` |
//!
//! Each crate can be used without the others: `sabine-eqfilter` compiles neither a tensor library nor a mesh library, `sabine-acoustics`
//! reads glTF only with its feature `gltf`.
