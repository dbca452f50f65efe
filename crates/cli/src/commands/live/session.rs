//! Blocks in, blocks out, and refits beside them.

use super::matcher::{Matched, Matcher, SAMPLE_RATE_HZ};
use super::row;
use crate::failure::Failure;
use sabine::acoustics::{Estimate, PerBand, RoomTargets};
use sabine::eqfilter::{PartitionedConfig, PartitionedConvolver, PreparedResponse, ResponsePreparer};
use sabine::estimator::{Error as EstimatorError, LiveEstimator};
use std::sync::mpsc::{Receiver, Sender, TryRecvError, channel};
use std::time::{Duration, Instant};

/// An estimate within these of the one in use changes nothing that can be heard: one just-noticeable difference of T60 (ISO
/// 3382-1, Annex A), and 1 dB.
const T60_SHARE: f64 = 0.05;
const EQ_DB: f64 = 1.0;
/// Length of the cross-fade from response to response, in seconds.
const FADE_S: f64 = 0.1;

/// How time passes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pace {
    /// Blocks come when they would from a microphone; refits run beside them, and blocks never wait for a refit.
    RealTime,
    /// Blocks come at once; each refit is waited for, so that every run prints the same.
    Fast,
}

/// A stream, from its first block to its last.
pub struct Session {
    live: LiveEstimator,
    matcher: Option<Matcher>,
    convolver: PartitionedConvolver,
    block_ms: u32,
    pace: Pace,
    heard: Vec<f32>,
    in_use: Option<RoomTargets>,
    timing: Timing,
}

/// How long things took.
#[derive(Default)]
pub struct Timing {
    audio_s: f64,
    block_s: f64,
    blocks: Vec<f64>,
    updates: Vec<f64>,
    /// From an estimate to the first block that sounds of it.
    latencies: Vec<f64>,
    first_latency_s: f64,
    wall_s: f64,
    in_real_time: bool,
}

/// A refit on its way back, with the time at which its estimate was there.
type Reply = Result<(Matched, Box<PreparedResponse>, Instant), Failure>;

impl Session {
    /// Sets everything up before the first block.
    pub fn new(live: LiveEstimator, matcher: Matcher, block_ms: u32, pace: Pace) -> Result<Self, Failure> {
        let block = samples(block_ms, SAMPLE_RATE_HZ);
        let config = PartitionedConfig {
            block,
            longest_response: matcher.longest_response(),
            fade_blocks: ((FADE_S * 1000.0 / f64::from(block_ms)).round() as usize).max(1),
        };
        let convolver = PartitionedConvolver::new(matcher.first().samples(), config)?;
        let timing = Timing {
            block_s: f64::from(block_ms) / 1000.0,
            first_latency_s: live.first_latency_s(),
            in_real_time: pace == Pace::RealTime,
            ..Timing::default()
        };
        Ok(Self {
            live,
            matcher: Some(matcher),
            convolver,
            block_ms,
            pace,
            heard: Vec::new(),
            in_use: None,
            timing,
        })
    }

    /// Streams all of `speech`, while `dry` is heard in the room as it is known; then refits once more to all that was said.
    pub fn run(&mut self, speech: &[f32], dry: &[f32]) -> Result<Matched, Failure> {
        let Some(mut matcher) = self.matcher.take() else { return Err("the stream is over".into()) };
        let (to_worker, jobs) = channel::<(RoomTargets, Instant)>();
        let (to_stream, done) = channel::<Reply>();
        let preparer = self.convolver.preparer();
        let start = Instant::now();
        let mut matcher = std::thread::scope(|scope| -> Result<Matcher, Failure> {
            let worker = scope.spawn(move || {
                refit(&mut matcher, &preparer, &jobs, &to_stream);
                matcher
            });
            let streamed = self.stream(speech, dry, &to_worker, &done);
            // The worker ends when nobody can ask it any more.
            drop(to_worker);
            let matcher = worker.join().map_err(|_| "the refit broke down")?;
            streamed.map(|()| matcher)
        })?;
        self.timing.wall_s = start.elapsed().as_secs_f64();
        self.timing.audio_s = speech.len() as f64 / f64::from(self.live.sample_rate_hz());
        let end = self.live.estimate()?;
        for warning in &end.warnings {
            println!("note: {warning}");
        }
        // What was heard after the last full window counts too; nobody waits for this one.
        matcher.update(end.targets)
    }

    fn stream(
        &mut self,
        speech: &[f32],
        dry: &[f32],
        to_worker: &Sender<(RoomTargets, Instant)>,
        done: &Receiver<Reply>,
    ) -> Result<(), Failure> {
        let block_in = samples(self.block_ms, self.live.sample_rate_hz());
        let block_out = samples(self.block_ms, SAMPLE_RATE_HZ);
        let mut voice = dry.iter().copied().cycle();
        let (mut input, mut output) = (vec![0.0; block_out], vec![0.0; block_out]);
        let mut waiting = false;
        let mut pending: Option<(Box<PreparedResponse>, Instant)> = None;
        let start = Instant::now();
        for (index, block) in speech.chunks(block_in).enumerate() {
            if self.pace == Pace::RealTime {
                let due = Duration::from_secs_f64((index + 1) as f64 * self.timing.block_s);
                std::thread::sleep(due.saturating_sub(start.elapsed()));
            }
            let begun = Instant::now();
            let mut news = None;
            self.live.push(block, |estimate| news = Some(estimate.map(|e| e.targets)))?;
            input.iter_mut().zip(&mut voice).for_each(|(to, from)| *to = from);
            self.convolver.process_block(&input, &mut output)?;
            self.heard.extend_from_slice(&output);
            drop(self.convolver.take_retired());
            self.timing.blocks.push(begun.elapsed().as_secs_f64());

            if let Some(estimate) = news {
                waiting |= self.judge(estimate, waiting, begun, to_worker)?;
            }
            // Without real time a block takes as long as it must.
            let reply = match (waiting, self.pace) {
                (false, _) => None,
                (true, Pace::Fast) => Some(done.recv()?),
                (true, Pace::RealTime) => match done.try_recv() {
                    Ok(reply) => Some(reply),
                    Err(TryRecvError::Empty) => None,
                    Err(error) => return Err(error.into()),
                },
            };
            if let Some(reply) = reply {
                let (matched, response, since) = reply?;
                waiting = false;
                println!("{:>7}  materials and EQ refitted in {:.2} s", "", matched.seconds);
                for band_hz in &matched.unconverged_hz {
                    println!(
                        "{:>7}  warning: the fit of the materials has not converged at {band_hz} Hz",
                        ""
                    );
                }
                self.timing.updates.push(matched.seconds);
                self.in_use = Some(matched.targets);
                pending = Some((response, since));
            }
            // One exchange at a time: the next waits for the end of the cross-fade.
            if let Some((response, since)) = pending.take() {
                match self.convolver.exchange(response) {
                    Ok(()) => self.timing.latencies.push(since.elapsed().as_secs_f64()),
                    Err(response) => pending = Some((response, since)),
                }
            }
        }
        Ok(())
    }

    /// Says what was heard and asks for a refit if it makes a difference; whether it did.
    fn judge(
        &self,
        estimate: Result<RoomTargets, EstimatorError>,
        busy: bool,
        now: Instant,
        to_worker: &Sender<(RoomTargets, Instant)>,
    ) -> Result<bool, Failure> {
        let at = format!("{:5.1} s", self.live.duration_s());
        let targets = match estimate {
            Ok(targets) => targets,
            Err(EstimatorError::Silent { .. }) => {
                println!("{at}  nothing to hear so far");
                return Ok(false);
            }
            Err(error) => return Err(error.into()),
        };
        let values = |of: &PerBand<Estimate>| of.values().iter().map(|e| e.value).collect::<Vec<_>>();
        println!(
            "{at}  {}{}",
            row(values(targets.t60_s()).into_iter(), 2),
            row(values(targets.eq_db()).into_iter(), 1)
        );
        if self.in_use.as_ref().is_some_and(|in_use| sounds_alike(in_use, &targets)) {
            println!("{:>7}  settled: as the one in use within 5 % and 1 dB", "");
            return Ok(false);
        }
        if busy {
            println!("{:>7}  the last refit is still under way: this one is passed over", "");
            return Ok(false);
        }
        to_worker.send((targets, now))?;
        Ok(true)
    }

    /// What was heard, at [`SAMPLE_RATE_HZ`].
    pub fn heard(&self) -> &[f32] {
        &self.heard
    }

    /// How long things took.
    pub fn timing(&self) -> &Timing {
        &self.timing
    }
}

/// Refits to what comes in until nothing more can come; runs on a thread of its own.
fn refit(
    matcher: &mut Matcher,
    preparer: &ResponsePreparer,
    jobs: &Receiver<(RoomTargets, Instant)>,
    done: &Sender<Reply>,
) {
    while let Ok((targets, since)) = jobs.recv() {
        let reply = matcher.update(targets).and_then(|matched| {
            let prepared = preparer.prepare(matched.equalised.samples())?;
            Ok((matched, prepared, since))
        });
        // Nobody listens after the last block.
        if done.send(reply).is_err() {
            return;
        }
    }
}

fn sounds_alike(one: &RoomTargets, other: &RoomTargets) -> bool {
    let pairs = |a: &PerBand<Estimate>, b: &PerBand<Estimate>| -> Vec<(f64, f64)> {
        a.values().iter().zip(b.values()).map(|(a, b)| (a.value, b.value)).collect()
    };
    pairs(one.t60_s(), other.t60_s()).iter().all(|(a, b)| (a / b - 1.0).abs() < T60_SHARE)
        && pairs(one.eq_db(), other.eq_db()).iter().all(|(a, b)| (a - b).abs() < EQ_DB)
}

fn samples(block_ms: u32, sample_rate_hz: u32) -> usize {
    (block_ms * sample_rate_hz / 1000) as usize
}

impl Timing {
    /// The figures in words.
    pub fn print(&self) {
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len().max(1) as f64;
        let longest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
        let late = self.blocks.iter().filter(|&&s| s > self.block_s).count();
        println!("{:.1} s of speech in {} blocks", self.audio_s, self.blocks.len());
        println!(
            "block: {:.2} ms on average, {:.1} ms at most, {late} longer than {:.0} ms",
            1e3 * mean(&self.blocks),
            1e3 * longest(&self.blocks),
            1e3 * self.block_s
        );
        println!(
            "latency: first estimate after {:.1} s of speech; {} of {} refits came into use, {:.2} s after their estimate on average, {:.2} s at most",
            self.first_latency_s,
            self.latencies.len(),
            self.updates.len(),
            mean(&self.latencies),
            longest(&self.latencies)
        );
        let busy: f64 = self.blocks.iter().chain(&self.updates).sum();
        println!("real-time factor: {:.3} ({:.2} s of work)", busy / self.audio_s, busy);
        if self.in_real_time {
            println!("streamed in {:.1} s", self.wall_s);
        }
    }
}
