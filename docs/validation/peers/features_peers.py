#!/usr/bin/env python3
"""Log-mel of 4 s at 16 kHz: this project, librosa and numpy + scipy.fft in turn, single thread, on one machine in one run.

    cargo bench -p sabine-features --bench against_peers --no-run
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python3 docs/validation/peers/features_peers.py

Needs numpy, scipy and librosa. Prints best and median times and their ratios. The peers hold what can be planned: librosa's mel matrix
is cached by librosa itself, numpy's is made outside the loop. Rounds alternate, so load falls on all alike.
"""
import glob
import os
import statistics
import subprocess
import time

import librosa
import numpy as np
import scipy.fft
import scipy.signal

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..")
ROUNDS, REPEATS = 10, 40

n = np.arange(64000, dtype=np.int64)
samples = ((n * n % 7919) / 7919.0 - 0.5).astype(np.float32)
mel = librosa.filters.mel(sr=16000, n_fft=256, n_mels=32, fmin=0, fmax=8000, htk=False, norm="slaney").astype(np.float32)
window = scipy.signal.get_window("hann", 256).astype(np.float32)


def by_librosa():
    power = librosa.feature.melspectrogram(
        y=samples, sr=16000, n_fft=256, hop_length=128, center=False, n_mels=32, fmin=0, fmax=8000)
    return librosa.power_to_db(power, ref=1.0, amin=1e-10, top_db=None)


frames = np.lib.stride_tricks.sliding_window_view(samples, 256)[::128]
windowed, power, squares = np.empty((499, 256), "f4"), np.empty((499, 129), "f4"), np.empty((499, 129), "f4")
mel_columns = np.ascontiguousarray(mel.T)


def by_numpy():
    """Written for speed: nothing allocated but what scipy's rfft returns and the result."""
    np.multiply(frames, window, out=windowed)
    spectrum = scipy.fft.rfft(windowed, axis=1, overwrite_x=True)
    np.multiply(spectrum.real, spectrum.real, out=power)
    np.multiply(spectrum.imag, spectrum.imag, out=squares)
    np.add(power, squares, out=power)
    levels = power @ mel_columns
    np.maximum(levels, 1e-10, out=levels)
    np.log10(levels, out=levels)
    levels *= 10
    return levels.T


def timed(work):
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(1e3 * (time.perf_counter() - start))
    return min(times), statistics.median(times)


def ours():
    found = [p for p in glob.glob(os.path.join(ROOT, "target/release/deps/against_peers-*")) if os.access(p, os.X_OK)]
    for program in sorted(found, key=os.path.getmtime, reverse=True):
        line = subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()
        if line and line[0] == "log_mel":
            return float(line[1]), float(line[2])
    raise SystemExit("build the bench first: see the top of this file")


def main():
    assert np.abs(by_librosa() - by_numpy()).max() < 1e-2
    results = {"sabine": [], "librosa": [], "numpy + scipy.fft": []}
    for _ in range(ROUNDS):
        results["sabine"].append(ours())
        results["librosa"].append(timed(by_librosa))
        results["numpy + scipy.fft"].append(timed(by_numpy))
    best = {name: min(b for b, _ in rounds) for name, rounds in results.items()}
    median = {name: statistics.median(m for _, m in rounds) for name, rounds in results.items()}
    for name in results:
        print(f"{name:18} best {best[name]:.3f} ms, median {median[name]:.3f} ms; "
              f"times ours: best {best[name] / best['sabine']:.2f}, median {median[name] / median['sabine']:.2f}")


if __name__ == "__main__":
    main()
