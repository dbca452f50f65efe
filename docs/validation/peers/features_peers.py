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


def by_numpy():
    frames = np.lib.stride_tricks.sliding_window_view(samples, 256)[::128] * window
    spectrum = scipy.fft.rfft(frames, axis=1)
    power = spectrum.real**2 + spectrum.imag**2
    return 10.0 * np.log10(np.maximum(mel @ power.T, 1e-10))


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
