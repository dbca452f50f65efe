#!/usr/bin/env python3
"""Golden log-mel spectrograms by librosa 0.11: writes inputs.f32 and levels.f32 beside itself.

    python3 make_golden.py          # needs numpy and librosa

Both files are little-endian float32. inputs.f32 holds the signals of CASES one after the other, each of LENGTH samples;
levels.f32 their levels in dB, each [mel, frame] row by row. The inputs are stored, not made again by the test, so that no sine or
random generator has to agree. librosa is given double precision, so the only rounding in the reference is that of the file.
"""
import pathlib

import librosa
import numpy as np

RATE, N_FFT, HOP, MELS, LENGTH = 16000, 256, 128, 32, 4096
CASES = ["noise", "tones", "click", "sweep", "voice", "decay"]


def signals():
    random = np.random.default_rng(20200101)
    t = np.arange(LENGTH) / RATE
    yield "noise", 0.3 * random.standard_normal(LENGTH)
    # Four partials 60 dB apart: weak bins beside strong ones.
    yield "tones", sum(a * np.sin(2 * np.pi * f * t) for a, f in [(0.9, 440), (0.03, 1234.5), (1e-3, 3000), (3e-5, 7000)])
    click = np.zeros(LENGTH)
    click[[300, 1500, 2000]] = [1.0, -0.5, 1e-3]
    yield "click", click
    # A sweep from 50 Hz to 7.9 kHz that falls by 100 dB.
    duration = LENGTH / RATE
    phase = 50 * duration / np.log(158) * (158 ** (t / duration) - 1)
    yield "sweep", np.sin(2 * np.pi * phase) * 10 ** (-5 * t / duration)
    # Pulses at 120 Hz through three resonances, as a vowel has.
    voice = (np.arange(LENGTH) % 133 == 0).astype(float)
    for f, bandwidth in [(700, 90), (1220, 110), (2600, 160)]:
        r = np.exp(-np.pi * bandwidth / RATE)
        out = np.zeros(LENGTH)
        for n in range(LENGTH):
            out[n] = voice[n] + (2 * r * np.cos(2 * np.pi * f / RATE) * out[n - 1] if n > 0 else 0)
            out[n] -= r * r * out[n - 2] if n > 1 else 0
        voice = out
    yield "voice", 0.5 * voice / np.abs(voice).max()
    # Noise that decays into digital silence: the floor.
    decay = 0.5 * random.standard_normal(LENGTH) * 10 ** (-60 * t)
    decay[3000:] = 0
    yield "decay", decay


def main():
    here = pathlib.Path(__file__).parent
    inputs, levels = [], []
    for (name, x), expected in zip(signals(), CASES, strict=True):
        assert name == expected
        x = x.astype("<f4")
        power = librosa.feature.melspectrogram(
            y=x.astype(np.float64), sr=RATE, n_fft=N_FFT, hop_length=HOP, window="hann", center=False, power=2.0,
            n_mels=MELS, fmin=0.0, fmax=8000.0, htk=False, norm="slaney", dtype=np.float64)
        inputs.append(x)
        levels.append(librosa.power_to_db(power, ref=1.0, amin=1e-10, top_db=None).astype("<f4"))
    (here / "inputs.f32").write_bytes(b"".join(x.tobytes() for x in inputs))
    (here / "levels.f32").write_bytes(b"".join(x.tobytes() for x in levels))
    print(f"{len(inputs)} cases, {levels[0].shape} levels each; librosa {librosa.__version__}, numpy {np.__version__}")


if __name__ == "__main__":
    main()
