"""Diagnoses, models to start from, and plans."""

import functools
import json
import math
import shutil
import struct
import tempfile
import unittest
from pathlib import Path

import numpy as np

import sabine
from case import FIXTURES, Case, diffuse_box

HAZE = """
[[laws]]
id = "haze"
target = "path"
formula = "-a * length_m"
parameters = { a = { value = 0.1, low = 0, high = 0.2, unit = "dB/m" } }
"""


def delay_wav(path, delay_s):
    """Puts silence before the sound, whatever form its samples have."""
    head, data = path.read_bytes().split(b"data", 1)
    rate_hz, _, frame_bytes = struct.unpack("<IIH", head[head.index(b"fmt ") + 12 :][:10])
    sound = bytes(round(delay_s * rate_hz) * frame_bytes) + data[4:]
    head = head[:4] + struct.pack("<I", len(head) + len(sound)) + head[8:]
    path.write_bytes(head + b"data" + struct.pack("<I", len(sound)) + sound)


@functools.cache
def latency_found():
    """The diagnosis of the fixture with 5 ms of silence before its responses."""
    with tempfile.TemporaryDirectory() as folder:
        return diagnose_delayed(Path(folder, "room"))


def diagnose_delayed(room, **more):
    shutil.copytree(FIXTURES / "room", room)
    for path in (room / "ir").glob("*.wav"):
        delay_wav(path, 0.005)
    return sabine.diagnose(room, rays=1000, effects=["time_zero", "sound_speed", "channel_fault"], **more)


class Diagnose(Case):
    def assert_latency(self, found):
        self.assertEqual((found.verdict, found.causes[0]["effect"]), ("explained", "time_zero"))
        self.assertLess(abs(found.causes[0]["parameters"]["latency"]["value"] - 5.0), 0.2)

    def test_a_latency_in_the_recordings_is_named(self):
        found = latency_found()
        self.assert_latency(found)
        self.assertRegex(repr(found), "time_zero .*\n    latency 5")
        self.assertIn("latency", found.extended_model)
        json.dumps(found.data)

    def test_a_diagnosis_is_written_and_started_from(self):
        with tempfile.TemporaryDirectory() as folder:
            latency_found().write(Path(folder, "out", "diagnosis"))
            written = Path(folder, "out", "diagnosis")
            self.assertEqual(json.loads((written / "diagnosis.json").read_text()), latency_found().data)
            again = diagnose_delayed(Path(folder, "again"), model=written / "extended_model.toml")
        self.assert_latency(again)

    def test_a_cause_of_the_model_that_the_data_do_not_need_is_dropped_with_a_note(self):
        for model in (latency_found(), latency_found().extended_model):
            found = sabine.diagnose(FIXTURES / "room", rays=1000, effects=["sound_speed"], model=model)
            self.assertNotIn("time_zero", [cause["effect"] for cause in found.causes])
            self.assertRegex(" ".join(found.notes), "model.*time_zero|time_zero.*model")

    def test_a_law_is_weighed_beside_the_catalogue(self):
        found = sabine.diagnose(FIXTURES / "room", rays=500, effects=["time_zero"], laws=HAZE)
        self.assertEqual({one["effect"] for one in found.candidates}, {"time_zero", "haze"})

    def test_an_effect_is_weighed_on_request(self):
        threshold = lambda **more: sabine.diagnose(
            FIXTURES / "room", rays=500, effects=["time_zero"], **more
        ).data["threshold_nats"]
        # A name pays for the number of effects that are tried: two for one.
        self.assertAlmostEqual(threshold(also=["missing_object"]) - threshold(), math.log(2.0))

    def test_what_cannot_be_diagnosed_is_refused_in_words(self):
        refused = lambda words, room=FIXTURES / "room", **more: self.assert_refused(words, sabine.diagnose, room, **more)
        refused("no measured responses", diffuse_box(0.2))
        refused("no effect \"gremlins\"", effects=["gremlins"])
        refused("effects: expected a list", effects="time_zero")
        refused("no effect \"gremlins\"", also=["gremlins"])
        refused("also: expected a list", also="missing_object")
        refused("rays", rays=1)
        refused("nobody", hold_out=["nobody"])
        refused("discover: \"often\" is none of", discover="often")
        refused("discover: \"3\" is none of", discover=3)
        refused("laws: .*law `haze`, column 6", laws=HAZE.replace("length_m", "lengths_m"))
        on_roof = HAZE.replace('"path"', '"reflection"\nsurface = "roof"').replace("length_m", "cos_incidence")
        refused("law `haze`.*roof", laws=on_roof.replace("dB/m", "dB"))
        refused("laws: .*time_zero", laws=HAZE.replace("haze", "time_zero"))
        refused("model: expected a path", model=3)
        refused("model: .*version 1", model="version = 1\ncentres_hz = []\n")
        refused("model: .*gremlins", model=latency_found().extended_model.replace("latency_s", "gremlins"))
        self.assert_refused("nowhere", sabine.diagnose, "nowhere", error=FileNotFoundError)
        self.assert_refused("nowhere", sabine.diagnose, FIXTURES / "room", model="nowhere.toml", error=FileNotFoundError)


class Rendering(Case):
    ROOM = sabine.Room.read(FIXTURES / "room")
    MODEL = "version = 2\ncentres_hz = [125, 250, 500, 1000, 2000, 4000, 8000]\n"

    def trace(self, *changes, room=ROOM, ends=("talker", "microphone"), **more):
        model = self.MODEL + "".join(f'[[causes]]\nid = "{i}"\nchanges = [{{ {c} }}]\n' for i, c in enumerate(changes))
        return room.trace(*ends, rays=500, duration_s=0.4, model=model, **more)

    def test_a_model_without_causes_is_the_room_itself(self):
        plain = self.ROOM.trace("talker", "microphone", rays=500, duration_s=0.4)
        np.testing.assert_array_equal(self.trace().samples, plain.samples)

    def test_latency_delays_gain_raises_and_warm_air_hastens(self):
        plain, changed = self.trace(), self.trace("latency_s = 0.005", "response_gain = { response = \"talker-microphone\", gain_db = 6 }")
        shift = round(0.005 * plain.sample_rate)
        early = slice(0, 4000)
        np.testing.assert_allclose(changed.samples[shift:][early], 10**0.3 * plain.samples[early], atol=1e-4)
        peaks = [np.argmax(np.abs(found.samples)) for found in (plain, self.trace("temperature_c = 35.0"))]
        self.assertAlmostEqual(peaks[0] / peaks[1], np.sqrt((273.15 + 35) / (273.15 + 21)), delta=0.002)

    def test_a_diagnosis_is_heard_as_the_room_that_it_found(self):
        plain, found = self.trace(), self.ROOM.trace("talker", "microphone", rays=500, duration_s=0.4, model=latency_found())
        later_s = (np.argmax(np.abs(found.samples)) - np.argmax(np.abs(plain.samples))) / plain.sample_rate
        self.assertAlmostEqual(later_s, 0.005, delta=0.0001)

    def test_laws_take_the_place_of_those_of_the_model(self):
        weak = HAZE.replace("value = 0.1", "value = 0.001")
        law = "law = { " + ", ".join(line for line in HAZE.splitlines() if " = " in line) + " }"
        of_model, of_both, of_law = self.trace(law), self.trace(law, laws=weak), self.trace(laws=weak)
        np.testing.assert_array_equal(of_both.samples, of_law.samples)
        self.assertLess(np.abs(of_model.samples).max(), 0.98 * np.abs(of_law.samples).max())

    def test_models_that_do_not_fit_are_refused_in_words(self):
        refused = lambda words, *changes, **more: self.assert_refused(words, self.trace, *changes, **more)
        refused("model: it is of a room folder", room=diffuse_box(0.2), ends=((1, 1, 1), (2, 2, 2)))
        refused("source: with a model it is a name", ends=((2.0, 2.0, 1.0), "corner"))
        refused("receiver: with a model it is a name", ends=("talker", (2.0, 2.0, 1.0)))
        refused("source_directivity: the model says it", source_directivity="cardioid")
        refused("receiver_axis: the model says it", receiver_axis=(1, 0, 0))
        refused("model: its response below 120 Hz is that of waves", "wave_below_hz = 120")
        refused("model: .*temperature_c", "temperature_c = 900")
        refused("model: .*nobody", "position = { place = \"nobody\", position_m = [1, 1, 1] }")


class Plans(Case):
    ROOM = FIXTURES / "room"

    def test_each_measurement_has_its_place_its_time_and_its_nats(self):
        found = sabine.plan(self.ROOM, rays=200, candidates=6, microphones=1, minutes={"microphone": 7})
        room = sabine.Room.read(self.ROOM)
        ends = np.array([*room.sources.values(), *room.receivers.values()])
        nats = [one["nats"] for one in found.candidates]
        self.assertEqual(nats, sorted(nats, reverse=True))
        for one in found.candidates:
            self.assertAlmostEqual(one["nats_per_minute"], one["nats"] / one["minutes"], places=9)
            if one["measurement"]["kind"] != "microphone":
                continue
            self.assertEqual(one["minutes"], 7)
            at = np.array(one["measurement"]["position_m"])
            self.assertIn(f"({at[0]:.2f}, {at[1]:.2f}, {at[2]:.2f}) m", one["words"])
            self.assertTrue(np.all(at > 0.5) and np.all(at < room.size_m - 0.5))
            self.assertGreater(np.linalg.norm(ends - at, axis=1).min(), 0.5)
        self.assertEqual([one["measurement"]["kind"] for one in found.chosen], ["microphone"])
        self.assertIs(found.chosen[0]["words"], found.candidates[found.data["chosen"][0]["candidate"]]["words"])
        self.assertIn(f"1. {found.chosen[0]['words']}", repr(found))
        best = max(one["nats"] / one["minutes"] for one in found.candidates)
        self.assertAlmostEqual(found.most_per_minute["nats_per_minute"], best)

    def test_after_a_diagnosis_it_weighs_what_decides_between_its_causes(self):
        effects = [{"effect": "sound_speed", "subject": None}, {"effect": "transducer_response", "subject": None}]
        haze = {"effect": "haze", "subject": None}
        room = sabine.Room.read(self.ROOM)
        data = {
            "bands_hz": room.bands_hz.tolist(),
            "materials": dict.fromkeys(room.surfaces),
            "causes": effects[:1],
            "alternatives": [one["effect"] for one in effects],
            "candidates": [haze, *effects],
        }
        places_m = [(3.0, 3.0, 1.5), (4.0, 4.5, 1.2), (5.0, 1.0, 1.4), (2.0, 2.5, 1.0)]
        more = {"rays": 200, "candidates": 8, "microphones": 1, "places_m": places_m}
        ask = lambda given=None, **changed: sabine.plan(room, sabine.Diagnosis({**data, **changed}, ""), laws=given, **more)
        leading = lambda found: [one["effect"] for one in found.data["question"]["leading"]]
        found = ask()
        self.assertEqual(leading(found), ["sound_speed", "transducer_response"])
        placed = [one["measurement"]["position_m"] for one in found.candidates if one["measurement"]["kind"] == "microphone"]
        self.assertTrue(placed and all(tuple(at) in places_m for at in placed))
        self.assertEqual({one["effect"] for one in found.effects}, {"sound_speed", "transducer_response"})
        self.assert_refused("diagnosis: materials: .*another room", ask, materials={})
        self.assert_refused("diagnosis: bands_hz: .*another room", ask, bands_hz=[1000.0])
        self.assert_refused("two hypotheses", ask, alternatives=[], candidates=[])
        self.assert_refused("a law that is not given here", ask, causes=[haze], alternatives=[])
        # A law that the user gives, and one that the search for laws found.
        text = '''
            [[laws]]
            id = "haze"
            target = "path"
            formula = "-a / 100 * length_m"
            parameters.a = { value = 1.0, low = 0.0, high = 10.0, unit = "dB/m" }
        '''
        self.assertEqual(leading(ask(text, causes=[haze], alternatives=[]))[0], "haze")
        self.assert_refused("laws: ", ask, text.replace("length_m", "width_m"))
        law = {"id": "mist", "target": "path", "surface": None, "words": "Says so.", "formula": "-a / 100 * length_m"}
        law["parameters"] = {"a": {"value": 1.0, "low": 0.0, "high": 10.0, "unit": "dB/m"}}
        named = {"effect": "unknown_law", "subject": "paths go with their length"}
        self.assertEqual(leading(ask(causes=[named], alternatives=[], laws=[law]))[0], "mist")

    def test_what_cannot_be_planned_is_refused_in_words(self):
        refused = lambda words, *given, room=self.ROOM, **more: self.assert_refused(words, sabine.plan, room, *given, **more)
        refused("room: a plan is for a room folder", room=diffuse_box(0.2))
        refused("diagnosis: expected a Diagnosis", "diagnosis.json")
        refused("microphones", microphones=21)
        refused("microphones", microphones=-1)
        refused("sources", sources=6)
        refused("candidates", candidates=1)
        refused("clearance_m", clearance_m=np.nan)
        refused("clearance_m", clearance_m="wide")
        refused("places_m: shape", places_m=[1, 2, 3])
        refused("places_m: .* not numbers", places_m=[["a", "b", "c"]])
        refused("minutes: \"lunch\" is none of", minutes={"lunch": 3})
        refused("minutes: expected a mapping", minutes=3)
        refused("places_m: .* not numbers", places_m=[[1, 2, 3], [1, 2]])
        refused("minutes of climate: expected a number", minutes={"climate": "long"})
        refused("climate_min", minutes={"climate": -3})
        refused("rays", rays=1)


if __name__ == "__main__":
    unittest.main()
