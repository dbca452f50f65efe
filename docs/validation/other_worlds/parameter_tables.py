"""A measured room with a table of parameters in place of its responses: what a measuring program lists of them.

Decay times, ratios of early to late energy and centre times of ISO 3382-1 by code that shares nothing with this project: octave filters of
scipy, forwards and backwards, the integral of the squared response from behind, lines of least squares. A decay whose noise lies less than
10 dB below what a parameter reads has none.
"""

import argparse
import pathlib
import re
import shutil

import numpy as np
import scipy.signal
import soundfile

COLUMNS = ["edt_s", "t20_s", "t30_s", "c50_db", "c80_db", "ts_s"]
RANGES_DB = {"edt_s": (0, -10), "t20_s": (-5, -25), "t30_s": (-5, -35)}
NOISE_SHARE = 0.1  # of a response: its end, of which noise is measured
CLEAR_DB = 10.0  # noise lies so far below what is read


def octave(response, rate_hz, centre_hz):
    edges = np.array([centre_hz / np.sqrt(2), min(centre_hz * np.sqrt(2), 0.49 * rate_hz)])
    sos = scipy.signal.butter(4, edges, "bandpass", fs=rate_hz, output="sos")
    padded = np.concatenate([np.zeros(rate_hz // 4), response, np.zeros(rate_hz // 4)])
    return scipy.signal.sosfiltfilt(sos, padded)[rate_hz // 4 : -(rate_hz // 4)]


def parameters(response, rate_hz, centre_hz):
    """Of a response whose first sample is the emission; the direct sound begins the decay."""
    onset = np.argmax(np.abs(response) > 0.1 * np.max(np.abs(response)))
    energy = octave(response, rate_hz, centre_hz) ** 2
    end = int((1 - NOISE_SHARE) * len(energy))
    noise = np.mean(energy[end:])
    # What rings before the direct sound belongs to it.
    energy[onset] += np.sum(energy[:onset])
    energy = energy[onset:end]
    # The decay ends where it meets its noise; what is noise is taken off.
    smooth = np.convolve(energy, np.ones(rate_hz // 50) / (rate_hz // 50), "same")
    below = np.nonzero(smooth < 2 * noise)[0]
    energy = energy[: below[0] if len(below) else len(energy)] - noise
    left = np.cumsum(energy[::-1])[::-1]
    if len(left) < rate_hz // 20 or left[0] <= 0:
        return {}
    level_db = 10 * np.log10(np.maximum(left, 1e-30) / left[0])
    floor_db = 10 * np.log10(max(noise, 1e-30) * len(left) / left[0])
    time_s = np.arange(len(left)) / rate_hz
    found = {}
    for name, (top, bottom) in RANGES_DB.items():
        inside = (level_db <= top) & (level_db >= bottom)
        if floor_db < bottom - CLEAR_DB and level_db[-1] < bottom and np.count_nonzero(inside) > 10:
            slope = np.polyfit(time_s[inside], level_db[inside], 1)[0]
            found[name] = -60 / slope
    for name, limit_s in [("c50_db", 0.05), ("c80_db", 0.08)]:
        at = int(limit_s * rate_hz)
        if at < len(left) and left[at] > 0:
            found[name] = 10 * np.log10((left[0] - left[at]) / left[at])
    found["ts_s"] = np.sum(time_s * energy) / np.sum(energy)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--room", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    text = (arguments.room / "room.toml").read_text()
    centres_hz = [float(x) for x in re.search(r"centres_hz = \[([^\]]*)\]", text).group(1).split(",")]
    head, *responses = text.split("[[responses]]")
    lines = ["source,receiver,band_hz," + ",".join(COLUMNS)]
    for response in responses:
        key = lambda name: re.search(name + r' = "([^"]*)"', response).group(1)
        samples, rate_hz = soundfile.read(arguments.room / key("file"))
        for centre_hz in centres_hz:
            found = parameters(samples, rate_hz, centre_hz)
            cells = [f"{found[name]:.4f}" if name in found else "-" for name in COLUMNS]
            lines.append(",".join([key("source"), key("receiver"), f"{centre_hz:g}", *cells]))
    arguments.out.mkdir(parents=True)
    (arguments.out / "parameters.csv").write_text("\n".join(lines) + "\n")
    (arguments.out / "room.toml").write_text(head + '[[parameters]]\nfile = "parameters.csv"\n')
    shutil.copy(arguments.room / "room.obj", arguments.out / "room.obj")
    if (arguments.room / "truth.json").exists():
        shutil.copy(arguments.room / "truth.json", arguments.out / "truth.json")


if __name__ == "__main__":
    main()
