"""Laws and directivity: what changes a response beside the room."""

import tempfile
import unittest
from pathlib import Path

import numpy as np

import sabine
from case import RECEIVER_M, SOURCE_M, Case, diffuse_box

#: The direct sound comes by sample 520, that of the floor at 630.
BEFORE_THE_FLOOR = 580
HAZE = """
[[laws]]
id = "haze"
target = "path"
formula = "-a * length_m * above(frequency_hz, f0)"
parameters = { a = { value = 0.1, low = 0.05, high = 0.2, unit = "dB/m" }, f0 = { value = 1, low = 0.7, high = 1.4, unit = "kHz" } }
"""


class Laws(Case):
    def trace(self, **more):
        return diffuse_box(0.2).trace(SOURCE_M, RECEIVER_M, rays=1000, duration_s=0.5, **more)

    def test_a_decibel_for_each_ten_metres_steepens_every_decay_by_it(self):
        plain, hazy = self.trace(), self.trace(laws=HAZE)
        expected_s = 60 / (60 / np.asarray(plain.t60_s) + 0.1 * 343.2)
        np.testing.assert_allclose(hazy.t60_s[3:], expected_s[3:], rtol=0.01)
        np.testing.assert_array_equal(hazy.t60_s[:3], plain.t60_s[:3])
        np.testing.assert_allclose(hazy.measure().t60_s[3:5], expected_s[3:5], rtol=0.1)
        self.assertLess(np.sum(hazy.samples**2), np.sum(plain.samples**2))

    def test_a_file_a_folder_and_their_text_say_the_same(self):
        of_text = self.trace(laws=HAZE)
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, "haze.toml")
            file.write_text(HAZE)
            for laws in (file, str(file), folder):
                np.testing.assert_array_equal(self.trace(laws=laws).samples, of_text.samples)

    def test_what_is_wrong_is_said_with_the_law_and_its_column(self):
        refused = lambda words, laws, **more: self.assert_refused(words, self.trace, laws=laws, **more)
        refused("laws: .*law `haze`, column 6 .*lengths_m", HAZE.replace("length_m", "lengths_m"))
        refused("law `haze`, column 15 .*gives dB m", HAZE.replace('"dB/m"', '"dB"'))
        refused("law `haze`.*path, reflection, delay", HAZE.replace('"path"', '"paths"'))
        pure = HAZE.replace("dB/m", "dB")
        on_roof = pure.replace('"path"', '"reflection"\nsurface = "roof"').replace("length_m", "cos_incidence")
        refused("laws: .*law `haze`.*roof", on_roof)
        refused("law `haze`.*departure_cos.*axis", pure.replace("length_m", "departure_cos"))
        refused("haze.*(two|twice)", HAZE + HAZE)
        refused("TOML", "[[laws\n")
        refused("laws: expected a path or the text", 3)
        refused("nowhere.toml", "nowhere.toml", error=FileNotFoundError)

    def test_a_law_knows_the_axis_of_the_source(self):
        # 6 dB less for each unit of the cosine: the direct sound leaves along the axis, or against it.
        law = HAZE.replace("-a * length_m * above(frequency_hz, f0)", "-a * departure_cos").split("parameters")[0]
        law += 'parameters = { a = { value = 6, low = 0, high = 12, unit = "dB" } }\n'
        towards = np.subtract(RECEIVER_M, SOURCE_M)
        peaks = [np.abs(self.trace(laws=law, source_axis=a).samples[:BEFORE_THE_FLOOR]).max() for a in (towards, -towards)]
        self.assertAlmostEqual(20 * np.log10(peaks[1] / peaks[0]), 12.0, delta=0.5)


class Patterns(Case):
    def test_indices_of_the_first_order_are_the_closed_forms(self):
        for name, share in (
            ("omni", 1.0),
            ("subcardioid", 0.7),
            ("cardioid", 0.5),
            ("supercardioid", (np.sqrt(3) - 1) / 2),
            ("hypercardioid", 0.25),
            ("figure_of_eight", 0.0),
        ):
            expected_db = -10 * np.log10(share**2 + (1 - share) ** 2 / 3)
            for pattern in (sabine.Directivity(name), sabine.Directivity.first_order(share)):
                np.testing.assert_allclose(pattern.index_db, [expected_db], atol=1e-3)
                self.assertIsNone(pattern.bands_hz)

    def test_gains_in_all_directions_are_those_of_the_formula(self):
        directions = np.random.default_rng(1).standard_normal((50, 3))
        cosine = directions[:, 0] / np.linalg.norm(directions, axis=1)
        formula = sabine.Directivity.first_order([0.5, 0.8], bands_hz=[500, 1000])
        expected_db = 20 * np.log10(np.abs(np.stack([0.5 + 0.5 * cosine, 0.8 + 0.2 * cosine], axis=1)))
        np.testing.assert_allclose(formula.gain_db(directions), expected_db, atol=1e-9)
        angles = np.arange(0, 181, 2)
        levels_db = 20 * np.log10(0.8 + 0.2 * np.cos(np.radians(angles)))
        around = sabine.Directivity.axisymmetric(angles, [levels_db], [1000])
        np.testing.assert_allclose(around.gain_db(directions)[:, 0], expected_db[:, 1], atol=0.01)

    def test_a_grid_has_its_azimuth_to_the_left_and_its_elevation_upward(self):
        azimuths, elevations = np.radians(np.arange(0, 360, 5)), np.radians(np.arange(-90, 91, 5))
        x = np.cos(elevations)[:, None] * np.cos(azimuths)
        y = np.cos(elevations)[:, None] * np.sin(azimuths)
        magnitude = 1 + 0.2 * (x - 1) + 0.3 * y + 0.4 * np.sin(elevations)[:, None]
        pattern = sabine.Directivity.table([20 * np.log10(magnitude)], [1000])
        left, right, up = pattern.gain_db([[0, 1, 0], [0, -1, 0], [0, 0, 1]])[:, 0]
        np.testing.assert_allclose([left, right, up], 20 * np.log10([1.1, 0.5, 1.2]), atol=0.02)

    def test_a_null_is_minus_infinity(self):
        with np.errstate(divide="raise"):
            self.assertLess(sabine.Directivity("cardioid").gain_db([[-1, 0, 0]])[0, 0], -300)
        levels_db = [[0.0, -np.inf, 0.0]]
        self.assertEqual(sabine.Directivity.axisymmetric([0, 90, 180], levels_db, [1000]).gain_db([[0, 1, 0]])[0, 0], -np.inf)

    def test_patterns_are_refused_in_words(self):
        make = sabine.Directivity
        self.assert_refused("\"kardioid\" is none of omni", make, "kardioid")
        self.assert_refused("name: expected that of a pattern", make, 3)
        self.assert_refused("share", make.first_order, 1.5)
        self.assert_refused("omni_share: shape \\(2,\\)", make.first_order, [0.5, 0.5])
        self.assert_refused("angle", make.axisymmetric, [0, 90], [[0, 0]], [1000])
        self.assert_refused("levels_db: shape \\(1, 2\\)", make.axisymmetric, [0, 90, 180], [[0, 0]], [1000])
        self.assert_refused("level", make.axisymmetric, [0, 90, 180], [[0, np.nan, 0]], [1000])
        self.assert_refused("levels_db: shape \\(2, 4\\)", make.table, np.zeros((2, 4)), [1000])
        self.assert_refused("azimuths", make.table, np.zeros((1, 3, 2)), [1000])
        self.assert_refused("directions: each must be", make("omni").gain_db, [[0, 0, 0]])
        self.assert_refused("directions: shape", make("omni").gain_db, [0, 1, 0])


class DirectionalEnds(Case):
    def trace(self, absorption=0.2, **more):
        return diffuse_box(absorption).trace(SOURCE_M, RECEIVER_M, rays=4000, duration_s=0.4, **more)

    def test_reverberation_falls_by_the_index_and_the_direct_sound_stays(self):
        plain = self.trace(0.05)
        index_db = 10 * np.log10(3)
        for ends in ({"source_directivity": "cardioid"}, {"receiver_directivity": sabine.Directivity("cardioid")}):
            found = self.trace(0.05, **ends)
            late = slice(4_800, None)
            less_db = 10 * np.log10(np.sum(plain.samples[late] ** 2) / np.sum(found.samples[late] ** 2))
            self.assertAlmostEqual(less_db, index_db, delta=0.3)
            self.assertGreater(np.subtract(found.parameters.drr_db, plain.parameters.drr_db).min(), 3.5)
            peak = np.argmax(np.abs(plain.samples[:BEFORE_THE_FLOOR]))
            self.assertAlmostEqual(found.samples[peak] / plain.samples[peak], 1.0, delta=0.02)

    def test_the_axis_turns_the_pattern(self):
        towards = np.subtract(RECEIVER_M, SOURCE_M)
        across = np.cross(towards, (0, 0, 1))
        plain = np.abs(self.trace().samples[:BEFORE_THE_FLOOR]).max()
        for end, forward in (("source", towards), ("receiver", -towards)):
            shares = [
                np.abs(self.trace(**{f"{end}_directivity": "cardioid", f"{end}_axis": axis}).samples[:BEFORE_THE_FLOOR]).max() / plain
                for axis in (2 * forward, across, -forward)
            ]
            np.testing.assert_allclose(shares, [1.0, 0.5, 0.0], atol=0.03)

    def test_a_pattern_without_direction_changes_nothing(self):
        omni = sabine.Directivity.axisymmetric([0, 90, 180], np.zeros((2, 3)), [500, 1000])
        found = self.trace(source_directivity=omni, receiver_directivity="omni")
        np.testing.assert_allclose(found.samples, self.trace().samples, atol=1e-6)

    def test_ends_are_refused_in_words(self):
        refused = lambda words, **more: self.assert_refused(words, self.trace, **more)
        refused("source_directivity: expected a Directivity or one of omni, .*'trumpet'", source_directivity="trumpet")
        refused("receiver_directivity: expected", receiver_directivity=3)
        refused("source_axis: .*length", source_axis=(0, 0, 0))
        refused("receiver_axis: .*length", receiver_axis=(np.nan, 0, 0))
        refused("receiver_axis: expected the 3 components", receiver_axis="north")


if __name__ == "__main__":
    unittest.main()
