"""Sweeps against their formula, and responses of chains that are known."""

import sys
import unittest
from unittest import mock

import numpy as np

import sabine
from case import RATE_HZ, Case


def delayed(samples, delay_s, gain=1.0):
    return gain * np.concatenate([np.zeros(round(delay_s * RATE_HZ)), samples])


class Playback(Case):
    def test_samples_are_those_of_the_formula(self):
        sweep = sabine.Sweep(from_hz=100, to_hz=3200, duration_s=0.5, peak=0.8, fade_in_s=0.05, fade_out_s=0.01)
        times_s = np.arange(RATE_HZ // 2) / RATE_HZ
        scale_s = 0.5 / np.log(32)
        expected = 0.8 * np.sin(2 * np.pi * 100 * scale_s * np.expm1(times_s / scale_s))
        between = slice(int(0.06 * RATE_HZ), int(0.48 * RATE_HZ))
        np.testing.assert_allclose(sweep.samples[between], expected[between], atol=2e-6)
        self.assertLess(abs(sweep.samples[int(0.001 * RATE_HZ)]), 0.01)

    def test_every_repetition_is_followed_by_silence(self):
        sweep = sabine.Sweep(duration_s=0.5, silence_s=0.25, repetitions=2)
        period = sweep.playback().reshape(2, -1)
        self.assertEqual(period.shape[1], 0.75 * RATE_HZ)
        np.testing.assert_array_equal(period[0], period[1])
        np.testing.assert_array_equal(period[0][: len(sweep.samples)], sweep.samples)
        self.assertFalse(np.any(period[:, len(sweep.samples) :]))

    def test_settings_are_refused_in_words(self):
        for name, bad in (
            ("sample_rate", 500),
            ("sample_rate", 44_100.5),
            ("from_hz", -1),
            ("to_hz", 30_000),
            ("to_hz", "high"),
            ("duration_s", np.nan),
            ("silence_s", -1),
            ("repetitions", 0),
            ("repetitions", 1.5),
            ("peak", 2),
            ("fade_in_s", 9),
            ("fade_out_s", -1),
        ):
            self.assert_refused(name, sabine.Sweep, **{name: bad})


class Deconvolution(Case):
    def test_a_chain_of_two_taps_comes_back_with_its_latency(self):
        sweep = sabine.Sweep(duration_s=1.0, silence_s=0.5)
        played = np.append(sweep.playback(), np.zeros(RATE_HZ // 2))
        chain = np.zeros(RATE_HZ // 5)
        chain[[960, 2880]] = 0.5, -0.2  # 20 and 60 ms
        recording = np.stack([np.convolve(played, chain), np.convolve(played, 0.5 * chain)])
        found = sweep.deconvolve(recording, RATE_HZ)
        self.assertEqual((found.sample_rate, found.responses.dtype), (RATE_HZ, np.float32))
        first = np.argmax(np.abs(found.responses[0]))
        self.assertAlmostEqual(found.start_s + first / RATE_HZ, 0.02, delta=1 / RATE_HZ)
        self.assertAlmostEqual(found.responses[0][first + 1920] / found.responses[0][first], -0.4, delta=0.005)
        np.testing.assert_allclose(found.responses[1], 0.5 * found.responses[0], atol=1e-5)
        spectrum_hz = np.fft.rfftfreq(found.responses.shape[1], 1 / RATE_HZ)
        inside = (spectrum_hz > 200) & (spectrum_hz < 17_000)
        expected = np.abs(0.5 - 0.2 * np.exp(-2j * np.pi * spectrum_hz * 0.04))
        level_db = 20 * np.log10(np.abs(np.fft.rfft(found.responses[0])) / expected)
        self.assertLess(np.abs(level_db[inside]).max(), 0.1)
        self.assertEqual((found.left_out, found.clock_drift_ppm, len(found.differences_db)), ((), None, 0))

    def test_a_loopback_without_latency_is_a_pulse_at_its_beginning(self):
        sweep = sabine.Sweep(duration_s=1.0, silence_s=0.5)
        found = sweep.deconvolve(sweep.playback(), RATE_HZ)
        self.assertEqual((found.start_s, np.argmax(found.responses[0])), (0.0, 0))

    def test_repetitions_are_averaged_and_one_that_differs_is_left_out(self):
        noise = np.random.default_rng(1)
        sweep = sabine.Sweep(duration_s=0.5, silence_s=0.5, repetitions=3)
        recording = delayed(sweep.playback(), 0.1)
        recording += 0.01 * noise.standard_normal(len(recording))
        quiet = sweep.deconvolve(recording, RATE_HZ)
        self.assertEqual(quiet.differences_db.shape, (3,))
        self.assertLess(abs(quiet.clock_drift_ppm), 5)
        slammed = recording.copy()
        second = slice(int(1.2 * RATE_HZ), int(1.5 * RATE_HZ))
        slammed[second] += 0.2 * noise.standard_normal(second.stop - second.start)
        self.assert_refused("repetition 2 differs", sweep.deconvolve, slammed, RATE_HZ)
        kept = sweep.deconvolve(slammed, RATE_HZ, leave_out_differing=True)
        self.assertEqual(kept.left_out, (1,))
        self.assertIn("left out [1]", repr(kept))
        np.testing.assert_allclose(kept.responses[0].max(), quiet.responses[0].max(), rtol=0.01)
        # The mean of three is quieter than one of them by 10 lg 3.
        single = sabine.Sweep(duration_s=0.5, silence_s=0.5).deconvolve(recording[: RATE_HZ + 4800], RATE_HZ)
        tail = slice(int(0.2 * RATE_HZ), int(0.45 * RATE_HZ))
        less_db = 20 * np.log10(single.responses[0][tail].std() / quiet.responses[0][tail].std())
        self.assertAlmostEqual(less_db, 10 * np.log10(3), delta=0.3)

    def test_recordings_are_refused_in_words(self):
        sweep = sabine.Sweep(duration_s=0.5, silence_s=0.5)
        recording = delayed(sweep.playback(), 0.1)
        refused = lambda words, samples, rate_hz=RATE_HZ: self.assert_refused(words, sweep.deconvolve, samples, rate_hz)
        refused("clipped", np.clip(3 * recording, -1, 1))
        refused("lasts 0.21 s", recording[:10_000])
        refused("begins .* after the sweep", recording[12_000:])
        refused("silent", 0 * recording)
        refused("not one of this sweep|no sound", recording[::-1])
        refused("44100", recording, 44_100)
        refused("recording: 52800 channels; expected 1 to 64", recording[:, None])
        refused("recording: shape \\(1, 1, 52800\\)", recording[None, None])
        refused("recording: 0 channels", [])
        refused("recording: its rows differ in length", [[0.1, 0.2], [0.3]])
        refused("recording\\[1\\]: dtype bool", [recording, recording > 0])
        refused("not finite", np.append(recording, np.nan))
        refused("recording\\[1\\]: 52799 samples; recording\\[0\\] has 52800", [recording, recording[:-1]])

    def test_to_pyfar_says_what_it_needs(self):
        sweep = sabine.Sweep(duration_s=0.5, silence_s=0.5)
        found = sweep.deconvolve(delayed(sweep.playback(), 0.1), RATE_HZ)
        with mock.patch.dict(sys.modules, {"pyfar": None}):
            with self.assertRaisesRegex(ImportError, "pip install pyfar"):
                found.to_pyfar()


if __name__ == "__main__":
    unittest.main()
