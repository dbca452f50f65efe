#!/usr/bin/env python3
"""FIR of 1025 taps at 16 kHz from octave gains: this project and scipy's firwin2 in turn, on one machine in one run.

    cargo bench -p sabine-eqfilter --bench against_peers --no-run
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python3 docs/validation/peers/eqfilter_peers.py

Needs numpy and scipy. Times: best and median; rounds alternate, so load falls on all alike. Accuracy: worst difference between the gain
wanted and the mean power over the octave (cos^2 cross-overs between centres), over the same 200 sets of gains within 15 dB and the
two alternating sets; this project's filters come from its own program as raw taps.
"""
import glob
import os
import statistics
import struct
import subprocess
import sys
import time

import numpy as np
from scipy.signal import firwin2

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..")
RATE, TAPS, ROUNDS, REPEATS = 16000, 1025, 10, 100
G = 10**0.3
CENTRES = 1000 * G ** np.arange(-4.0, 3.0)  # 62.5 Hz to 4 kHz


def gain_sets():
    """The same sets as in benches/against_peers.rs: a linear congruential generator, then alternation."""
    state, sets = 1, []
    for _ in range(200):
        row = []
        for _ in CENTRES:
            state = (state * 6364136223846793005 + 1442695040888963407) % 2**64
            row.append((state >> 33) / 2**31 * 30 - 15)
        sets.append(row)
    for sign in (15.0, -15.0):
        sets.append([sign if b % 2 == 0 else -sign for b in range(len(CENTRES))])
    return np.array(sets)


def by_linear(gains):
    """firwin2 as it comes: straight lines in amplitude over frequency."""
    amplitudes = 10 ** (gains / 20)
    return firwin2(TAPS, np.r_[0, CENTRES, RATE / 2], np.r_[amplitudes[0], amplitudes, amplitudes[-1]], fs=RATE)


def by_log(gains):
    """firwin2 given 128 points of straight lines in dB over the logarithm of frequency."""
    hz = np.geomspace(20, RATE / 2 * 0.999, 128)
    amplitudes = 10 ** (np.interp(np.log(hz), np.log(CENTRES), gains) / 20)
    return firwin2(TAPS, np.r_[0, hz, RATE / 2], np.r_[amplitudes[0], amplitudes, amplitudes[-1]], fs=RATE)


def octave_gains_db(taps):
    length = 1 << 16
    hz = np.fft.rfftfreq(length, 1 / RATE)[1:]
    power = np.abs(np.fft.rfft(taps, length))[1:] ** 2
    out = []
    for centre in CENTRES:
        u = np.clip(1 - np.abs(np.log(hz / centre)) / np.log(G), 0, 1)
        weight = np.sin(np.pi / 2 * u**3 * (10 - 15 * u + 6 * u**2)) ** 2
        out.append(10 * np.log10((weight * power).sum() / weight.sum()))
    return np.array(out)


def program():
    found = [p for p in glob.glob(os.path.join(ROOT, "target/release/deps/against_peers-*")) if os.access(p, os.X_OK)]
    for path in sorted(found, key=os.path.getmtime, reverse=True):
        first = subprocess.run([path], capture_output=True, check=True).stdout[:6]
        if first == b"design":
            return path
    raise SystemExit("build the bench first: see the top of this file")


def main():
    sets, path = gain_sets(), program()
    times = {"sabine, planned": [], "sabine, EqFilter::design": [], "firwin2, linear": [], "firwin2, log": []}
    for _ in range(ROUNDS):
        lines = subprocess.run([path], capture_output=True, text=True, check=True).stdout.splitlines()
        for name, line in zip(("sabine, planned", "sabine, EqFilter::design"), lines):
            times[name].append(tuple(map(float, line.split()[1:])))
        for name, work in (("firwin2, linear", by_linear), ("firwin2, log", by_log)):
            spent = []
            for i in range(REPEATS):
                start = time.perf_counter()
                work(sets[i])
                spent.append(1e3 * (time.perf_counter() - start))
            times[name].append((min(spent), statistics.median(spent)))
    best = {name: min(b for b, _ in rounds) for name, rounds in times.items()}
    median = {name: statistics.median(m for _, m in rounds) for name, rounds in times.items()}
    for name in times:
        print(f"{name:26} best {best[name]:.4f} ms, median {median[name]:.4f} ms; firwin2 (linear) takes "
              f"{best['firwin2, linear'] / best[name]:.2f} (best), {median['firwin2, linear'] / median[name]:.2f} (median) times as long")
    raw = subprocess.run([path, "--taps"], capture_output=True, check=True).stdout
    ours = np.array(struct.unpack(f"<{len(sets) * TAPS}f", raw)).reshape(len(sets), TAPS)
    print("worst octave error in dB, 62.5 Hz to 4 kHz, over 202 sets of gains within 15 dB:")
    for name, filters in (("sabine", ours), ("firwin2, linear", map(by_linear, sets)), ("firwin2, log", map(by_log, sets))):
        errors = np.abs([octave_gains_db(taps) - gains for taps, gains in zip(filters, sets)])
        print(f"  {name:16} " + " ".join(f"{worst:6.2f}" for worst in errors.max(axis=0)))


if __name__ == "__main__":
    sys.exit(main())
