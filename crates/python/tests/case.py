"""What several test files need: the fixtures, boxes, decays of closed form, and refusals in words."""

import re
import unittest
from pathlib import Path

import numpy as np

import sabine

FIXTURES = Path(__file__).resolve().parents[3] / "fixtures"
RATE_HZ = 48_000
SIZE_M = (5.0, 4.0, 2.6)
SOURCE_M, RECEIVER_M = (1.0, 1.0, 1.5), (4.0, 3.0, 1.2)
#: Exact centres of the octaves from 125 Hz to 8 kHz (IEC 61260-1, base ten).
OCTAVES_HZ = 1000.0 * 10.0 ** (0.3 * np.arange(-3, 4))
#: Those to 4 kHz.
CENTRES_HZ = OCTAVES_HZ[:6]


def decaying_tones(t60_s, duration_s, centres_hz=CENTRES_HZ):
    """A tone at the centre of each octave that falls by 60 dB in its own time."""
    times_s = np.arange(int(duration_s * RATE_HZ)) / RATE_HZ
    tones = np.cos(2 * np.pi * centres_hz[:, None] * times_s)
    return np.sum(tones * 10.0 ** (-3.0 * times_s / np.asarray(t60_s)[:, None]), axis=0)


def pulses(*amplitudes_at_s, duration_s=1.0):
    """Silence with samples of some amplitude at some times."""
    response = np.zeros(int(duration_s * RATE_HZ))
    for amplitude, time_s in amplitudes_at_s:
        response[round(time_s * RATE_HZ)] += amplitude
    return response


def eyring_t60_s(size_m, absorption):
    """Without air, at 343.2 m/s."""
    x, y, z = size_m
    surface = 2 * (x * y + y * z + z * x)
    return 24 * np.log(10) / 343.2 * x * y * z / (-surface * np.log(1 - absorption))


def diffuse_box(absorption, **more):
    return sabine.ShoeBox(SIZE_M, absorption, scattering=0.9, **more)


class Case(unittest.TestCase):
    """A test that can say that a call is refused, and in which words."""

    def assert_refused(self, words, call, *arguments, error=ValueError, **named):
        with self.subTest(words), self.assertRaisesRegex(error, re.compile(words, re.DOTALL)):
            call(*arguments, **named)
