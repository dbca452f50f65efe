"""Tests of the installed package: closed forms, the repository's fixtures, and bad input. Needs numpy alone.

    python -m unittest discover --start-directory crates/python/tests
"""

import json
import os
import signal
import sys
import tempfile
import threading
import time
import unittest
import wave
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np

import sabine
from case import (
    FIXTURES,
    RATE_HZ,
    RECEIVER_M,
    SIZE_M,
    SOURCE_M,
    Case,
    decaying_tones,
    diffuse_box,
    eyring_t60_s,
)


def read_wav(path):
    with wave.open(str(path)) as file:
        return np.frombuffer(file.readframes(file.getnframes()), np.int16), file.getframerate()


class Measure(unittest.TestCase):
    def test_decays_of_known_length_are_measured_within_a_hundredth(self):
        t60_s = np.array([1.2, 1.1, 1.0, 0.9, 0.8, 0.7])
        found = sabine.measure(decaying_tones(t60_s, 1.5), RATE_HZ, bands_hz=[125, 250, 500, 1000, 2000, 4000])
        np.testing.assert_allclose(found.t60_s, t60_s, rtol=0.01)
        np.testing.assert_allclose(found.t30_s, t60_s, rtol=0.01)
        np.testing.assert_allclose(found.t20_s, t60_s, rtol=0.01)

    def test_energy_ratios_of_an_exponential_decay_have_their_closed_form(self):
        found = sabine.measure(decaying_tones(np.ones(6), 1.5), RATE_HZ, bands_hz=[500, 1000, 2000])
        remaining = 10.0 ** (-6.0 * 0.08)
        np.testing.assert_allclose(found.c80_db, 10 * np.log10((1 - remaining) / remaining), atol=0.2)
        np.testing.assert_allclose(found.d50, 1 - 10.0 ** (-6.0 * 0.05), atol=0.01)

    def test_what_cannot_be_read_is_nan_and_says_why(self):
        found = sabine.measure(decaying_tones(np.ones(6), 1.5)[::3], RATE_HZ / 3)
        self.assertTrue(np.isnan(found.t60_s.at(8000)))
        self.assertIn("half the sample rate", found.t60_s.missing[8000.0])
        self.assertIn("half the sample rate", repr(found))

    def test_integers_count_as_the_full_scale_that_they_stand_for(self):
        response = 0.1 * decaying_tones(np.ones(6), 1.5)
        of_floats = sabine.measure(response, RATE_HZ).t60_s
        of_integers = sabine.measure(np.round(2.0**31 * response).astype(np.int32), RATE_HZ).t60_s
        np.testing.assert_allclose(of_integers, of_floats, rtol=1e-4)

    def test_readings_are_used_as_arrays(self):
        t60_s = sabine.measure(decaying_tones(np.ones(6), 1.5), RATE_HZ, bands_hz=sabine.THIRD_OCTAVES[9:13]).t60_s
        self.assertEqual((len(t60_s), np.asarray(t60_s).shape), (4, (4,)))
        low, high = t60_s.interval()
        np.testing.assert_allclose(high - low, 2 * 1.96 * t60_s.standard_error)
        with self.assertRaisesRegex(ValueError, "no band at 3 Hz"):
            t60_s.at(3)


class Estimate(unittest.TestCase):
    def test_the_room_is_heard_in_the_fixtures_speech(self):
        truth = json.loads((FIXTURES / "truth.json").read_text())
        found = sabine.estimate(*read_wav(FIXTURES / "speech/recording.wav"))
        for hz, t60_s in zip(truth["bands_hz"][1:], truth["t60_s"][1:]):
            self.assertLess(abs(found.t60_s.at(hz) / t60_s - 1), 0.16, f"{hz} Hz")
        self.assertEqual(found.eq_db.at(1000), 0.0)
        self.assertEqual(found.warnings, ("resampled from 22050 to 16000 Hz",))

    def test_two_recordings_of_a_room_are_surer_than_one(self):
        speech, rate_hz = read_wav(FIXTURES / "speech/recording.wav")
        halves = [speech[: len(speech) // 2], speech[len(speech) // 2 :]]
        one, both = sabine.estimate(halves[0], rate_hz), sabine.estimate(halves, rate_hz)
        self.assertLess(both.t60_s.standard_error[3], one.t60_s.standard_error[3])
        self.assertLess(both.eq_db.standard_error[2], one.eq_db.standard_error[2])
        self.assertTrue(all(warning.startswith("recording ") for warning in both.warnings))


class Trace(unittest.TestCase):
    def test_a_diffuse_box_decays_as_eyring_says(self):
        expected_s = eyring_t60_s(SIZE_M, 0.2)
        room = diffuse_box(0.2)
        response = room.trace(SOURCE_M, RECEIVER_M, rays=4000)
        middle = slice(2, 5)  # 500 Hz to 2 kHz: the formula has no air.
        np.testing.assert_allclose(room.eyring_t60_s[middle], expected_s, rtol=0.03)
        np.testing.assert_allclose(response.t60_s[middle], expected_s, rtol=0.05)
        np.testing.assert_allclose(response.measure().t60_s[middle], expected_s, rtol=0.06)

    def test_the_direct_sound_arrives_when_and_as_loud_as_it_must(self):
        response = diffuse_box(0.5).trace(SOURCE_M, RECEIVER_M, rays=1000)
        distance_m = np.linalg.norm(np.subtract(RECEIVER_M, SOURCE_M))
        arrival = distance_m / 343.2 * RATE_HZ
        self.assertLess(np.abs(response.samples[: int(arrival) - 200]).max(), 1e-3 / distance_m)
        first = int(arrival) - 5 + np.argmax(np.abs(response.samples[int(arrival) - 5 : int(arrival) + 6]))
        self.assertLess(abs(first - arrival), 2)
        self.assertLess(abs(response.samples[first] * distance_m - 1), 0.2)

    def test_the_decay_starts_at_0_db_and_never_rises(self):
        response = diffuse_box(0.2).trace(SOURCE_M, RECEIVER_M, rays=1000)
        self.assertEqual(response.decay_db.shape, (len(sabine.ROOM_OCTAVES), len(response.decay_times_s)))
        np.testing.assert_allclose(response.decay_db[:, 0], 0.0, atol=1e-9)
        self.assertTrue(np.all(np.diff(response.decay_db[:, : len(response.decay_times_s) // 2]) <= 0))

    def test_the_same_seed_gives_the_same_response_and_another_another(self):
        first, again, other = (diffuse_box(0.3).trace(SOURCE_M, RECEIVER_M, rays=1000, seed=s) for s in (7, 7, 8))
        np.testing.assert_array_equal(first.samples, again.samples)
        np.testing.assert_array_equal(first.t60_s, again.t60_s)
        self.assertFalse(np.array_equal(first.samples, other.samples))

    def test_ctrl_c_stops_it_and_other_threads_go_on_meanwhile(self):
        # What a shell starts in the background ignores Ctrl-C: the trace would take all memory before it ended.
        self.addCleanup(signal.signal, signal.SIGINT, signal.signal(signal.SIGINT, signal.default_int_handler))
        press = threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT))
        began = time.monotonic()
        self.addCleanup(press.cancel)
        press.start()
        with self.assertRaises(KeyboardInterrupt):
            diffuse_box(0.02).trace(SOURCE_M, RECEIVER_M, rays=5_000_000)
        self.assertLess(time.monotonic() - began, 20)


class Rooms(unittest.TestCase):
    def test_a_box_has_the_surfaces_that_were_given(self):
        room = sabine.ShoeBox(
            SIZE_M,
            absorption={"x0": 0.1, "x1": 0.2, "y0": np.linspace(0.1, 0.7, 7), "y1": 0.4},
            materials={"floor": "carpet_thin", "ceiling": "acoustic_plaster"},
            sources={"talker": SOURCE_M},
        )
        self.assertEqual(tuple(room.surfaces), sabine.FACES)
        self.assertAlmostEqual(room.volume_m3, 52.0)
        self.assertAlmostEqual(room.surfaces["floor"].area_m2, 20.0)
        np.testing.assert_allclose(room.surfaces["y0"].absorption, np.linspace(0.1, 0.7, 7))
        self.assertGreater(room.surfaces["floor"].absorption[-1], 0.2)
        np.testing.assert_allclose(room.size_m, SIZE_M)
        np.testing.assert_allclose(room.sources["talker"], SOURCE_M)
        self.assertIn("carpet_thin", sabine.library())

    def test_a_room_folder_is_read(self):
        room = sabine.Room.read(FIXTURES / "room")
        self.assertEqual(len(room.surfaces), 8)
        self.assertIn("talker", room.sources)
        self.assertIn("2 responses", repr(room))

    def test_a_box_of_pyroomacoustics_becomes_the_same_box(self):
        walls = ("west", "east", "south", "north", "floor", "ceiling")
        octaves = np.array([125.0, 250.0, 500.0, 1000.0])
        wall = lambda i, name: SimpleNamespace(name=name, absorption=octaves / 2000 + i / 100, scatter=[0.3])
        theirs = SimpleNamespace(
            dim=3,
            shoebox_dim=np.array(SIZE_M),
            walls=[wall(i, name) for i, name in enumerate(walls)],
            octave_bands=SimpleNamespace(centers=octaves),
            sources=[SimpleNamespace(position=np.array(SOURCE_M))],
            mic_array=SimpleNamespace(R=np.array([RECEIVER_M]).T),
            physics=SimpleNamespace(T=22.0, H=40.0),
        )
        room = sabine.Room.from_pyroomacoustics(theirs)
        for i, face in enumerate(sabine.FACES):
            expected = np.array([125, 250, 500, 1000, 1000, 1000, 1000]) / 2000 + i / 100
            np.testing.assert_allclose(room.surfaces[face].absorption, expected)
            np.testing.assert_allclose(room.surfaces[face].scattering, 0.3)
        np.testing.assert_allclose(room.receivers["r1"], RECEIVER_M)
        with self.assertRaisesRegex(ValueError, "expected a pyroomacoustics.ShoeBox"):
            sabine.Room.from_pyroomacoustics(SimpleNamespace(dim=2))


class Fit(unittest.TestCase):
    def mean_absorption(self, room):
        areas = [surface.area_m2 for surface in room.surfaces.values()]
        return np.average([surface.absorption for surface in room.surfaces.values()], axis=0, weights=areas)

    def test_absorption_is_recovered_from_reverberation_times(self):
        target_s = eyring_t60_s(SIZE_M, 0.3)
        fitted = sabine.fit(diffuse_box(0.15), target_s, source=SOURCE_M, receiver=RECEIVER_M, rays=3000)
        np.testing.assert_allclose(self.mean_absorption(fitted.room)[:5], 0.3, atol=0.02)
        np.testing.assert_allclose(fitted.t60_s, target_s, rtol=0.05)
        np.testing.assert_allclose(self.mean_absorption(fitted.before), 0.15)

    def test_absorption_is_recovered_from_responses(self):
        true, receivers_m = diffuse_box(0.3), [RECEIVER_M, (2.0, 3.2, 1.7)]
        traced = [(at, true.trace(SOURCE_M, at, rays=4000, seed=11 + i)) for i, at in enumerate(receivers_m)]
        responses = [(SOURCE_M, at, response.samples, response.sample_rate) for at, response in traced]
        guess = diffuse_box(0.15)
        fitted, again = (sabine.fit(guess, responses=responses, time_zero="emission", rays=3000) for _ in range(2))
        np.testing.assert_allclose(self.mean_absorption(fitted.room)[1:6], 0.3, atol=0.04)
        np.testing.assert_array_equal(self.mean_absorption(fitted.room), self.mean_absorption(again.room))

    def test_readings_are_fitted_in_the_bands_that_have_a_value(self):
        heard = sabine.measure(decaying_tones(np.full(6, 0.4), 1.0), RATE_HZ).t60_s
        fitted = sabine.fit(diffuse_box(0.2), heard, source=SOURCE_M, receiver=RECEIVER_M, rays=2000)
        np.testing.assert_array_equal(fitted.t60_s.bands_hz, heard.bands_hz[~np.isnan(heard)])

    def test_what_cannot_be_reached_is_said(self):
        fitted = sabine.fit(diffuse_box(0.2), 0.02, source=SOURCE_M, receiver=RECEIVER_M, rays=500, bands_hz=[1000])
        self.assertIn("cannot be reached", fitted.unreachable[1000.0])
        self.assertIn("not reached at 1000 Hz", repr(fitted))


class BadInput(Case):
    def test_samples_are_refused_in_words(self):
        tone = np.ones(1000, np.float32)
        for call in (sabine.measure, sabine.estimate):
            name = "response" if call is sabine.measure else "speech"
            self.assert_refused(f"{name}: shape \\(2, 500\\)", call, tone.reshape(2, 500), RATE_HZ)
            self.assert_refused(f"{name}: shape \\(\\)", call, 1.0, RATE_HZ)
            self.assert_refused(f"{name}: dtype complex64", call, tone * 1j, RATE_HZ)
            self.assert_refused(f"{name}: dtype <U1", call, ["a"], RATE_HZ)
            self.assert_refused(f"{name}: dtype bool", call, tone > 0, RATE_HZ)
            self.assert_refused("no values|empty|no samples", call, tone[:0], RATE_HZ)
            for bad in (np.nan, np.inf, 1e300):
                self.assert_refused("not finite", call, np.append(tone.astype(float), bad), RATE_HZ)
            for rate_hz in (0, -1, 44.1, 999, 1e9, np.nan, np.inf, 44100.5):
                self.assert_refused("sample.rate", call, tone, rate_hz)
            self.assert_refused("sample_rate: expected a number", call, tone, "fast")
        self.assert_refused("bands_hz", sabine.measure, tone, RATE_HZ, bands_hz=[])
        self.assert_refused("bands_hz", sabine.measure, tone, RATE_HZ, bands_hz=[125, 1000])
        self.assert_refused("bands_hz", sabine.measure, tone, RATE_HZ, bands_hz=[np.nan])
        self.assert_refused("bands_hz", sabine.measure, tone, RATE_HZ, bands_hz="octaves")
        self.assert_refused("8000", sabine.estimate, tone, 8000)
        self.assert_refused("0.0", sabine.estimate, tone, RATE_HZ)

    def test_silence_has_no_parameters_and_no_speech(self):
        found = sabine.measure(np.zeros(RATE_HZ), RATE_HZ)
        self.assertTrue(np.all(np.isnan(found.t60_s)))
        self.assertIsNone(found.onset_s)
        self.assert_refused("silent", sabine.estimate, np.zeros(2 * RATE_HZ), RATE_HZ)

    def test_boxes_are_refused_in_words(self):
        refused = lambda words, *given, **named: self.assert_refused(words, sabine.ShoeBox, *given, **named)
        refused("size_m", [5, 4], 0.1)
        refused("size_m", "box", 0.1)
        refused("side of the box", [5, -4, 2.6], 0.1)
        refused("side of the box", [5, np.nan, 2.6], 0.1)
        refused("absorption", SIZE_M, 1.2)
        refused("absorption", SIZE_M, np.nan)
        refused("absorption of x0: shape \\(2,\\)", SIZE_M, [0.1, 0.2])
        refused("absorption of x0: 'rough' are not numbers", SIZE_M, "rough")
        refused("the face x0 has none", SIZE_M)
        refused("no face 'roof'", SIZE_M, {"roof": 0.1})
        refused("scattering", SIZE_M, 0.1, scattering=-0.1)
        refused("carpet", SIZE_M, materials="carpet_x")
        refused("absorption_sd", SIZE_M, 0.1, absorption_sd=0)
        refused("bands_hz", SIZE_M, 0.1, bands_hz=[1, 2, 3])
        refused("temperature", SIZE_M, 0.1, temperature_c=1e6)
        refused("source a: expected 3 coordinates", SIZE_M, 0.1, sources={"a": [1, 2]})

    def test_places_and_settings_are_refused_in_words(self):
        trace = diffuse_box(0.2).trace
        self.assert_refused("outside the room", trace, (9.0, 1.0, 1.0), RECEIVER_M)
        self.assert_refused("coincide", trace, SOURCE_M, SOURCE_M)
        self.assert_refused("source: expected 3 coordinates", trace, (1.0, 1.0), RECEIVER_M)
        self.assert_refused("position", trace, (np.nan, 1.0, 1.0), RECEIVER_M)
        self.assert_refused("the room names none", trace, "s1", RECEIVER_M)
        self.assert_refused("rays", trace, SOURCE_M, RECEIVER_M, rays=0)
        self.assert_refused("rays", trace, SOURCE_M, RECEIVER_M, rays=10**30)
        self.assert_refused("rays", trace, SOURCE_M, RECEIVER_M, rays=1e3)
        self.assert_refused("seed", trace, SOURCE_M, RECEIVER_M, seed=-1)
        self.assert_refused("duration_s", trace, SOURCE_M, RECEIVER_M, duration_s=np.nan)
        self.assert_refused("duration_s", trace, SOURCE_M, RECEIVER_M, duration_s="long")
        self.assert_refused("sample_rate", trace, SOURCE_M, RECEIVER_M, sample_rate=1e6)
        self.assert_refused("sample_rate", trace, SOURCE_M, RECEIVER_M, sample_rate=-1)
        self.assert_refused("image_order", trace, SOURCE_M, RECEIVER_M, image_order=11)

    def test_fits_are_refused_in_words(self):
        box = diffuse_box(0.2)
        ends = {"source": SOURCE_M, "receiver": RECEIVER_M}
        tone = np.ones(1000, np.float32)
        self.assert_refused("responses: there are none", sabine.fit, box)
        self.assert_refused("source: the room names none", sabine.fit, box, 0.5)
        self.assert_refused("t60_s: shape \\(2,\\)", sabine.fit, box, [0.5, 0.5], **ends)
        self.assert_refused("T60|t60|reverberation", sabine.fit, box, -1.0, **ends)
        self.assert_refused("T60|t60|reverberation", sabine.fit, box, np.nan, **ends)
        self.assert_refused("not both", sabine.fit, box, 0.5, responses=[])
        self.assert_refused("time_zero", sabine.fit, box, responses=[(SOURCE_M, RECEIVER_M, tone, 48e3)], time_zero="?")
        self.assert_refused("responses\\[0\\]: shape", sabine.fit, box, responses=[(SOURCE_M, RECEIVER_M, [tone], 48e3)])
        self.assert_refused("responses\\[0\\]: expected", sabine.fit, box, responses=[(SOURCE_M, RECEIVER_M)])
        self.assert_refused("responses\\[0\\]: .*no direct sound", sabine.fit, box, responses=[(SOURCE_M, RECEIVER_M, 0 * tone, 48e3)])
        self.assert_refused("room: expected a Room", sabine.fit, "box", 0.5)

    def test_a_file_that_is_missing_is_an_os_error_with_its_name(self):
        self.assert_refused("nowhere", sabine.Room.read, "nowhere", error=FileNotFoundError)
        with tempfile.TemporaryDirectory() as folder:
            Path(folder, "room.toml").write_text("[room]\nmesh = 3\n")
            self.assert_refused("room.toml", sabine.Room.read, folder)


class OptionalPackages(unittest.TestCase):
    def test_plots_and_pyfar_say_what_they_need(self):
        response = diffuse_box(0.5).trace(SOURCE_M, RECEIVER_M, rays=500)
        with mock.patch.dict(sys.modules, {"matplotlib": None, "pyfar": None}):
            with self.assertRaisesRegex(ImportError, "pip install matplotlib"):
                response.plot()
            with self.assertRaisesRegex(ImportError, "pip install pyfar"):
                response.to_pyfar()


if __name__ == "__main__":
    unittest.main()
