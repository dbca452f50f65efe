#!/usr/bin/env python3
"""Full-band T60 of noisy decays: this project and pyrato (Chu and Lundeby, T30) on the same files in one run.

    cargo build --release -p sabine-cli
    OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 python3 docs/validation/peers/decay_peers.py [SABINE]

Needs numpy, soundfile and pyrato. White noise under exponential envelopes, T = 0.2, 0.5, 1 and 2 s, eight seeds each, on white noise 60,
45 or 30 dB below the start, 48 kHz. Prints the mean absolute error, how many were answered, and the median time for one response; ours
includes neither reading the file nor starting the program, pyrato's neither.
"""
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import warnings

import numpy as np
import pyfar
import pyrato
import soundfile

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..")
OURS = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "target/release/sabine")
RATE, TIMES, SEEDS = 48000, (0.2, 0.5, 1.0, 2.0), 8


def by_pyrato(samples):
    start = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            curve = pyrato.edc.energy_decay_curve_chu_lundeby(pyfar.Signal(samples, RATE))
            found = float(np.squeeze(pyrato.parameters.reverberation_time_linear_regression(curve, T="T30")))
        except (ValueError, IndexError):
            found = float("nan")
    return found, time.perf_counter() - start


def main():
    print("| SNR (dB) | ours: mean error | answered | ms | pyrato: mean error | answered | ms |\n|---|---|---|---|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        for snr_db in (60, 45, 30):
            files, truths, theirs = [], [], []
            for t60_s in TIMES:
                for seed in range(SEEDS):
                    rng = np.random.default_rng([seed, int(1000 * t60_s), snr_db])
                    n = int(RATE * (1.5 * t60_s + 0.5))
                    envelope = 10 ** (-3.0 * np.arange(n) / RATE / t60_s)
                    noise = 10 ** (-snr_db / 20) * rng.standard_normal(n)
                    samples = (0.1 * (envelope * rng.standard_normal(n) + noise)).astype(np.float32)
                    path = os.path.join(folder, f"{snr_db}_{t60_s}_{seed}.wav")
                    soundfile.write(path, samples, RATE, subtype="FLOAT")
                    files.append(path)
                    truths.append(t60_s)
                    theirs.append(by_pyrato(samples.astype(float)))
            results = os.path.join(folder, "ours.json")
            subprocess.run([OURS, "measure", *files, "--json", results], check=True, stdout=subprocess.DEVNULL)
            with open(results, encoding="utf-8") as file:
                ours = [
                    (entry["full_band"]["t60_s"], entry["seconds"]["full_band"]) for entry in json.load(file)
                ]
            row = f"| {snr_db} |"
            for found in (ours, theirs):
                errors = [
                    abs(value / truth - 1)
                    for (value, _), truth in zip(found, truths)
                    if value is not None and np.isfinite(value)
                ]
                milliseconds = 1e3 * statistics.median(seconds for _, seconds in found)
                row += f" {100 * np.mean(errors):.2f} % | {len(errors)} of {len(found)} | {milliseconds:.2f} |"
            print(row)


if __name__ == "__main__":
    main()
