#!/usr/bin/env python3
"""G, J_LF, J_LFC, L_J, IACC and STI of the same responses: this project, phonometry and pyrato.

    cargo build --release -p sabine-cli
    python3 docs/validation/peers/listener_peers.py [SABINE]

Needs Python 3.13, numpy, soundfile, phonometry 4.0.0rc1 (`pip install --pre phonometry==4.0.0rc1`) and pyrato 1.1. Gaussian decays of
T = 0.5, 1 and 2 s with a direct sound, 48 kHz, without noise: four channels with a known share in common. Prints the largest difference
over the octaves from 125 Hz to 4 kHz and from 500 Hz on, and the STI of each, with and without noise.
"""
import json
import os
import subprocess
import sys
import tempfile
import warnings

import numpy as np
import phonometry as ph
import pyfar
import pyrato
import soundfile
from phonometry.room import auditorium
from phonometry.speech import sti as ph_sti

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..")
OURS = sys.argv[1] if len(sys.argv) > 1 else os.path.join(ROOT, "target/release/sabine")
RATE = 48000
LEVELS = np.array([57.5, 60.5, 60.0, 54.0, 48.0, 42.0, 36.0])  # male speech at 60 dB(A), IEC 60268-16:2020
NOISE = np.array([50.0, 47.0, 44.0, 41.0, 38.0, 35.0, 32.0])


def channels(t60_s, seed):
    rng = np.random.default_rng([seed, int(1000 * t60_s)])
    n = int(RATE * (1.3 * t60_s + 1.0))
    start = RATE // 10
    envelope = np.zeros(n)
    envelope[start:] = 0.1 * 10 ** (-3.0 * np.arange(n - start) / RATE / t60_s)
    common, own, side = (envelope * rng.standard_normal(n) for _ in range(3))
    left, right = common, 0.6 * common + 0.8 * own
    left[start] += 1.0
    right[start] += 1.0
    free = np.zeros(n)
    free[start] = 1.0
    return left.astype(np.float32), right.astype(np.float32), (0.5 * side).astype(np.float32), free.astype(np.float32)


def ours(folder, left, right, side, free):
    names = {}
    for name, data in (("left", left), ("side", side), ("free", free), ("ears", np.stack([left, right], 1))):
        names[name] = os.path.join(folder, name + ".wav")
        soundfile.write(names[name], data, RATE, subtype="FLOAT")
    result = os.path.join(folder, "ours.json")

    def run(*arguments):
        subprocess.run([OURS, "measure", *arguments, "--from", "125", "--to", "4000", "--json", result], check=True, stdout=subprocess.DEVNULL)
        with open(result, encoding="utf-8") as file:
            return json.load(file)[0]

    found = run(names["left"], "--lateral", names["side"], "--reference", names["free"], "--sti")
    ears = run(names["ears"], "--binaural", "--sti", "--speech-level", "60", "--noise", ",".join(map(str, NOISE)))
    found.update({k: ears[k] for k in ("iacc", "iacc_early", "iacc_late")})
    found["sti_noise"] = ears["sti"]["value"]
    found["sti"] = found["sti"]["value"]
    return {k: np.array(found[k], dtype=float) for k in ("g_db", "j_lf", "j_lfc", "l_j_db", "iacc", "iacc_early", "iacc_late", "sti", "sti_noise")}


def by_phonometry(left, right, side, free):
    iacc = auditorium.interaural_cross_correlation
    return {
        "g_db": auditorium.sound_strength(left, free, RATE).strength,
        "j_lf": auditorium.early_lateral_energy_fraction(left, side, RATE).energy_fraction,
        "j_lfc": auditorium.early_lateral_energy_fraction(left, side, RATE, weighting="cosine").energy_fraction,
        "l_j_db": auditorium.late_lateral_sound_level(left, side, free, RATE).level,
        "iacc": iacc(left, right, RATE).coefficient,
        "iacc_early": iacc(left, right, RATE, window=(0.0, 0.08)).coefficient,
        "iacc_late": iacc(left, right, RATE, window=(0.08, None)).coefficient,
        "sti": ph_sti.sti_from_impulse_response(left, RATE).sti,
        "sti_noise": ph_sti.sti_from_impulse_response(left, RATE, level=LEVELS, ambient=NOISE).sti,
    }


def by_pyrato(left):
    return {"sti": float(np.squeeze(pyrato.parameters.speech_transmission_index_indirect(pyfar.Signal(left.astype(float), RATE))))}


def main():
    warnings.simplefilter("ignore")
    differences, stis = {}, []
    with tempfile.TemporaryDirectory() as folder:
        for t60_s in (0.5, 1.0, 2.0):
            for seed in range(4):
                sound = channels(t60_s, seed)
                mine, theirs, third = ours(folder, *sound), by_phonometry(*sound), by_pyrato(sound[0])
                for name, value in theirs.items():
                    differences.setdefault(name, []).append(np.atleast_1d(np.abs(mine[name] - value)))
                differences.setdefault("sti, pyrato", []).append(np.atleast_1d(abs(mine["sti"] - third["sti"])))
                stis.append((t60_s, float(mine["sti"]), float(theirs["sti"]), third["sti"]))
    print(f"phonometry {ph.__version__}, pyrato {pyrato.__version__}, {len(stis)} responses\n")
    print("| quantity | largest difference, 125 Hz to 4 kHz | from 500 Hz on | mean difference |\n|---|---|---|---|")
    for name, values in differences.items():
        values = np.array(values)
        upper = values[:, 2:] if values.shape[1] > 1 else values
        print(f"| {name} | {values.max():.4f} | {upper.max():.4f} | {values.mean():.4f} |")


if __name__ == "__main__":
    main()
