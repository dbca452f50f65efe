"""The recipe of a training clip in numpy, scipy and librosa: what sabine-augment's speed is held against.

usage: augment_peers.py SPEECH_DIR SECONDS
Each clip: 4 s of speech (and 1.5 s before it) convolved with a response of 1.5 s, noise at a drawn ratio, a level, log-mel
32 x 499, 16-bit floats. One process; prints clips per second.
"""

import glob
import sys
import time

import librosa
import numpy as np
import scipy.signal
import soundfile

RATE, SAMPLES, RESPONSE = 16000, 64000, 24000


def main():
    rng = np.random.default_rng(1)
    files = sorted(glob.glob(sys.argv[1] + "/**/*.flac", recursive=True))[:40]
    speech = [soundfile.read(f, dtype="float32")[0] for f in files]
    speech = [s for s in speech if len(s) > SAMPLES + RESPONSE]
    decay = 10 ** (-3 * np.arange(RESPONSE) / RATE / 1.0)
    mel = librosa.filters.mel(sr=RATE, n_fft=256, n_mels=32, fmin=0, fmax=8000)

    def clip():
        s = speech[rng.integers(len(speech))]
        start = rng.integers(RESPONSE, len(s) - SAMPLES + 1)
        response = (rng.standard_normal(RESPONSE) * decay).astype("float32")
        wet = scipy.signal.fftconvolve(s[start - RESPONSE : start + SAMPLES], response)[RESPONSE : RESPONSE + SAMPLES]
        noise = rng.standard_normal(SAMPLES).astype("float32")
        snr_db = rng.uniform(0, 40)
        wet = wet + noise * np.sqrt(np.mean(wet**2) / np.mean(noise**2) * 10 ** (-snr_db / 10))
        wet *= np.sqrt(10 ** (rng.uniform(-45, -10) / 10) / np.mean(wet**2))
        power = np.abs(librosa.stft(wet, n_fft=256, hop_length=128, center=False)) ** 2
        return (10 * np.log10(np.maximum(mel @ power, 1e-10))).astype("float16")

    clip()
    count, begin = 0, time.perf_counter()
    while time.perf_counter() - begin < float(sys.argv[2]):
        assert clip().shape == (32, 499)
        count += 1
    print(f"{count / (time.perf_counter() - begin):.1f} clips/s in one process")


main()
