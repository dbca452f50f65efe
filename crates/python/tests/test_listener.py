"""Speech transmission, strength, lateral energy, ears and single numbers, against closed forms."""

import unittest

import numpy as np

import sabine
from case import OCTAVES_HZ, RATE_HZ, Case, decaying_tones, pulses

# IEC 60268-16:2020, tables A.1 to A.3 and A.6.1.
ALPHA = np.array([0.085, 0.127, 0.230, 0.233, 0.309, 0.224, 0.173])
BETA = np.array([0.085, 0.078, 0.065, 0.011, 0.047, 0.095])
THRESHOLD_DB = np.array([46.0, 27.0, 12.0, 6.5, 7.5, 8.0, 12.0])
SPEECH_DB = np.array([-2.5, 0.5, 0.0, -6.0, -12.0, -18.0, -24.0])
MODULATION_HZ = np.array([0.63, 0.8, 1, 1.25, 1.6, 2, 2.5, 3.15, 4, 5, 6.3, 8, 10, 12.5])


def index_of(transfer):
    """STI of modulation transfer, shape (7, 14)."""
    snr_db = 10 * np.log10(transfer / (1 - transfer)).clip(-1.5, 1.5)
    indices = np.mean((snr_db + 15) / 30, axis=1)
    return ALPHA @ indices - BETA @ np.sqrt(indices[1:] * indices[:-1])


def transfer_of_decay(t60_s):
    """Modulation transfer of exponential decays, one for each octave."""
    return 1 / np.hypot(1, 2 * np.pi * MODULATION_HZ * np.asarray(t60_s)[:, None] / (6 * np.log(10)))


class Speech(Case):
    def test_exponential_decays_have_the_index_of_the_standard(self):
        for t60_s in (np.full(7, 0.5), np.full(7, 2.0), np.linspace(2.0, 0.8, 7)):
            response = decaying_tones(t60_s, 2.5, OCTAVES_HZ)
            found = sabine.speech_transmission(response, RATE_HZ)
            np.testing.assert_allclose(found.modulation_transfer, transfer_of_decay(t60_s), atol=0.02)
            self.assertAlmostEqual(float(found), index_of(transfer_of_decay(t60_s)), delta=0.006)
            self.assertIsNone(found.reason)

    def test_noise_lowers_it_as_the_standard_says(self):
        t60_s = np.full(7, 1.0)
        response = decaying_tones(t60_s, 2.0, OCTAVES_HZ)
        for snr_db in (0.0, np.linspace(-6, 12, 7)):
            left = 1 / (1 + 10 ** (-np.broadcast_to(snr_db, 7) / 10))
            found = sabine.speech_transmission(response, RATE_HZ, snr_db=snr_db)
            self.assertAlmostEqual(found.value, index_of(transfer_of_decay(t60_s) * left[:, None]), delta=0.006)

    def test_a_uniform_matrix_has_the_index_of_its_ratio(self):
        for snr_db, expected in ((0.0, 0.5), (10.0, 25 / 30), (-20.0, 0.0), (20.0, 1.0)):
            found = sabine.speech_transmission_of(np.full((7, 14), 1 / (1 + 10 ** (-snr_db / 10))))
            self.assertAlmostEqual(found.value, expected, places=9)
            np.testing.assert_allclose(found.transmission_indices, expected, atol=1e-9)

    def test_letters_are_those_of_annex_f(self):
        def letter(sti):
            snr_db = 30 * sti - 15
            return sabine.speech_transmission_of(np.full((7, 14), 1 / (1 + 10 ** (-snr_db / 10)))).qualification

        self.assertEqual([letter(sti) for sti in (0.35, 0.37, 0.50, 0.61, 0.75, 0.77)], ["U", "J", "G", "D", "A", "A+"])

    def test_levels_bring_masking_and_threshold(self):
        noise_db = np.array([40.0, 45.0, 30.0, 50.0, 20.0, 10.0, 5.0])
        for level_db, noise in ((60.0, None), (60.0, noise_db), (95.0, noise_db)):
            speech = 10 ** ((level_db + SPEECH_DB) / 10)
            disturbing = 0.0 * speech if noise is None else 10 ** (noise / 10)
            below_db = 10 * np.log10((speech + disturbing)[:-1])
            slope_db = np.where(
                below_db < 63,
                0.5 * below_db - 65,
                np.where(below_db < 67, 1.8 * below_db - 146.9, np.where(below_db < 100, 0.5 * below_db - 59.8, -10.0)),
            )
            masking = np.append(0.0, 10 ** ((below_db + slope_db) / 10))
            left = speech / (speech + disturbing + masking + 10 ** (THRESHOLD_DB / 10))
            found = sabine.speech_transmission_of(np.ones((7, 14)), speech_level_db=level_db, noise_db=noise)
            expected = index_of(np.tile(left[:, None], 14))
            self.assertAlmostEqual(found.value, expected, places=9)

    def test_what_cannot_be_read_is_nan_and_says_why(self):
        found = sabine.speech_transmission(decaying_tones(np.ones(6), 1.5)[::3], RATE_HZ / 3)
        self.assertTrue(np.isnan(found.value) and np.all(np.isnan(found.transmission_indices)))
        self.assertIn("half the sample rate", found.reason)
        self.assertIn("half the sample rate", repr(found))
        self.assertIsNone(found.qualification)

    def test_bad_levels_are_refused_in_words(self):
        response = decaying_tones(np.ones(7), 1.0, OCTAVES_HZ)
        refused = lambda words, **named: self.assert_refused(words, sabine.speech_transmission, response, RATE_HZ, **named)
        refused("snr_db: give this or speech_level_db", snr_db=0.0, speech_level_db=60.0)
        refused("noise_db: levels of noise need speech_level_db", noise_db=np.zeros(7))
        refused("snr_db: shape \\(2,\\)", snr_db=[1, 2])
        refused("snr_db: 'loud' are not numbers", snr_db="loud")
        refused("signal-to-noise", snr_db=np.nan)
        refused("level of the speech", speech_level_db=1e3)
        refused("level of the noise", speech_level_db=60.0, noise_db=np.inf)
        of = sabine.speech_transmission_of
        self.assert_refused("modulation_transfer: shape \\(7,\\)", of, np.ones(7))
        self.assert_refused("modulation_transfer: .* not numbers", of, [[1, 2], [3]])
        self.assert_refused("modulation transfer", of, np.full((7, 14), 1.5))
        self.assert_refused("modulation transfer", of, np.full((7, 14), np.nan))
        self.assert_refused("response: shape", sabine.speech_transmission, np.ones((2, 9)), RATE_HZ)


class Strength(Case):
    HZ = (500.0, 1000.0, 2000.0)

    def test_the_direct_sound_at_10_m_has_0_db_and_later_energy_adds(self):
        found = sabine.sound_strength(pulses((0.1, 0.1), (0.2, 0.2)), RATE_HZ, bands_hz=self.HZ)
        np.testing.assert_allclose(found.g_early_db, 0.0, atol=0.05)
        np.testing.assert_allclose(found.g_late_db, 20 * np.log10(2), atol=0.05)
        np.testing.assert_allclose(found.g_db, 10 * np.log10(5), atol=0.05)
        mid = found.single_numbers["g_mid_db"]
        self.assertAlmostEqual(float(mid), np.mean(found.g_db[:2]), places=9)

    def test_a_gain_raises_it_by_its_level(self):
        response = decaying_tones(np.full(6, 0.8), 1.2)
        quiet, loud = (sabine.sound_strength(g * response, RATE_HZ, bands_hz=self.HZ) for g in (0.1, 0.25))
        np.testing.assert_allclose(np.subtract(loud.g_db, quiet.g_db), 20 * np.log10(2.5), atol=1e-3)

    def test_a_measured_reference_counts_with_its_distance_and_gain(self):
        response = pulses((0.3, 0.1))
        reference = sabine.FreeFieldReference.measured(pulses((0.3, 0.01), duration_s=0.1), RATE_HZ, distance_m=3.0, bands_hz=self.HZ)
        found = sabine.sound_strength(response, RATE_HZ, reference)
        np.testing.assert_array_equal(found.bands_hz, self.HZ)
        np.testing.assert_allclose(found.g_db, 20 * np.log10(10 / 3), atol=0.05)
        # Directions whose energies are 1 and 3 have the mean 2.
        directions = np.stack([pulses((a, 0.01), duration_s=0.1) for a in (1.0, np.sqrt(3.0))])
        for given in (directions, list(directions)):
            reference = sabine.FreeFieldReference.measured(given, RATE_HZ, bands_hz=self.HZ)
            found = sabine.sound_strength(pulses((1.0, 0.1)), RATE_HZ, reference)
            np.testing.assert_allclose(found.g_db, -10 * np.log10(2), atol=0.05)

    def test_exposure_levels_are_those_of_a_pulse_in_an_octave(self):
        # A sample of 1 has the energy 1, spread evenly over half the sample rate.
        width_hz = np.array(self.HZ) * (10**0.15 - 10**-0.15)
        levels_db = 10 * np.log10(width_hz / (RATE_HZ / 2) / RATE_HZ)
        reference = sabine.FreeFieldReference.from_exposure_levels(levels_db, RATE_HZ, bands_hz=self.HZ)
        found = sabine.sound_strength(pulses((1.0, 0.1)), RATE_HZ, reference)
        np.testing.assert_allclose(found.g_db, 0.0, atol=0.1)

    def test_bad_references_are_refused_in_words(self):
        pulse = pulses((1.0, 0.1))
        reference = sabine.FreeFieldReference
        self.assert_refused("reference: expected a FreeFieldReference", sabine.sound_strength, pulse, RATE_HZ, pulse)
        other = reference.unit_source(44_100)
        self.assert_refused("reference: .*44100", sabine.sound_strength, pulse, RATE_HZ, other)
        self.assert_refused("responses: 0 channels", reference.measured, [], RATE_HZ)
        self.assert_refused("responses\\[1\\]: dtype bool", reference.measured, [pulse, pulse > 0], RATE_HZ)
        self.assert_refused("energy of the reference", reference.measured, 0 * pulse, RATE_HZ)
        self.assert_refused("distance", reference.measured, pulse, RATE_HZ, distance_m=-1)
        self.assert_refused("reference level", reference.from_exposure_levels, np.nan, RATE_HZ)
        self.assert_refused("levels_db: shape \\(2,\\)", reference.from_exposure_levels, [1, 2], RATE_HZ)
        self.assert_refused("sample_rate", reference.unit_source, -1)


class Lateral(Case):
    HZ = (1000.0, 2000.0, 4000.0)

    def test_a_reflection_from_the_side_counts_by_square_and_by_cosine(self):
        omni = pulses((1.0, 0.1), (0.5, 0.12))
        for sine in (0.5, 1.0):
            eight = pulses((0.5 * sine, 0.12))
            for normalisation, louder in (("equal", 1.0), ("n3d", np.sqrt(3)), ("fuma", np.sqrt(2))):
                found = sabine.lateral_energy(omni, louder * eight, RATE_HZ, normalisation=normalisation, bands_hz=self.HZ)
                np.testing.assert_allclose(found.j_lf, 0.25 * sine**2 / 1.25, atol=0.002)
                np.testing.assert_allclose(found.j_lfc, 0.25 * sine / 1.25, atol=0.002)
                self.assertIsNone(found.l_j_db)

    def test_late_sound_from_the_side_counts_against_the_reference(self):
        omni, eight = pulses((1.0, 0.1), (0.2, 0.3)), pulses((0.2, 0.3))
        hz = (125, 250, 500, 1000)
        reference = sabine.FreeFieldReference.unit_source(RATE_HZ, bands_hz=hz)
        found = sabine.lateral_energy(omni, eight, RATE_HZ, reference=reference, bands_hz=hz)
        np.testing.assert_allclose(found.l_j_db, 20 * np.log10(2), atol=0.1)
        energies = 10 ** (np.asarray(found.l_j_db) / 10)
        self.assertAlmostEqual(found.single_numbers["l_j_low_db"].value, 10 * np.log10(energies.mean()), places=6)
        self.assertAlmostEqual(found.single_numbers["j_lf_low"].value, np.mean(found.j_lf), places=9)
        self.assertIn("l_j_low_db", repr(found))

    def test_channels_that_do_not_belong_together_are_refused(self):
        omni = pulses((1.0, 0.1))
        call = sabine.lateral_energy
        self.assert_refused("figure_of_eight: 9 samples; omnidirectional has 48000", call, omni, omni[:9], RATE_HZ)
        self.assert_refused("normalisation: \"sn3d\" is none of", call, omni, omni, RATE_HZ, normalisation="sn3d")
        self.assert_refused("normalisation: expected a name", call, omni, omni, RATE_HZ, normalisation=3)
        reference = sabine.FreeFieldReference.unit_source(RATE_HZ, bands_hz=[1000])
        self.assert_refused("reference: ", call, omni, omni, RATE_HZ, reference=reference)
        self.assert_refused("not finite", call, omni, np.nan * omni, RATE_HZ)


class Ears(Case):
    def noise(self, seed, t60_s=0.6):
        times_s = np.arange(RATE_HZ) / RATE_HZ
        return np.random.default_rng(seed).standard_normal(len(times_s)) * 10.0 ** (-3.0 * times_s / t60_s)

    def test_the_same_sound_at_both_ears_has_1_whatever_its_sign_and_delay(self):
        left = self.noise(1)
        for right in (left, -0.5 * left, np.roll(left, 24)):
            found = sabine.interaural_correlation(left, right, RATE_HZ, bands_hz=[500, 1000, 2000])
            np.testing.assert_allclose(found.iacc, 1.0, atol=0.02)

    def test_independent_noise_has_a_small_one_and_a_mixture_its_share(self):
        left, other = self.noise(1), self.noise(2)
        hz = [2000, 4000, 8000]
        apart = sabine.interaural_correlation(left, other, RATE_HZ, bands_hz=hz)
        self.assertLess(np.max(apart.iacc), 0.15)
        self.assertLess(np.max(apart.iacc_late), 0.2)
        mixed = sabine.interaural_correlation(left, 0.8 * left + 0.6 * other, RATE_HZ, bands_hz=hz)
        np.testing.assert_allclose(mixed.iacc, 0.8, atol=0.05)

    def test_early_and_late_sound_are_told_apart(self):
        early, late = self.noise(1), self.noise(2)
        parting = int(0.08 * RATE_HZ)
        left, right = early.copy(), early.copy()
        right[parting:] = late[parting:]
        found = sabine.interaural_correlation(left, right, RATE_HZ, bands_hz=[4000])
        self.assertGreater(found.iacc_early[0], 0.97)
        self.assertLess(found.iacc_late[0], 0.2)

    def test_ears_that_do_not_belong_together_are_refused(self):
        self.assert_refused("right: 9 samples; left has 48000", sabine.interaural_correlation, self.noise(1), np.ones(9), RATE_HZ)
        self.assert_refused("left: dtype", sabine.interaural_correlation, ["a"], np.ones(9), RATE_HZ)
        self.assert_refused("bands_hz", sabine.interaural_correlation, self.noise(1), self.noise(2), RATE_HZ, bands_hz=[])


class SingleNumbers(Case):
    def test_they_are_means_over_the_octaves_of_the_standard(self):
        found = sabine.measure(decaying_tones([1.2, 1.1, 1.0, 0.9, 0.8, 0.7], 1.5), RATE_HZ)
        numbers = found.single_numbers
        self.assertAlmostEqual(numbers["t30_mid_s"].value, 0.95, delta=0.01)
        self.assertAlmostEqual(numbers["bass_ratio"].value, 2.3 / 1.9, delta=0.02)
        for name, readings in (("edt_mid_s", found.edt_s), ("c80_mid_db", found.c80_db), ("d50_mid", found.d50)):
            self.assertAlmostEqual(numbers[name].value, np.mean(readings[3:5]), places=9)
        error = np.hypot(*found.t30_s.standard_error[3:5]) / 2
        self.assertAlmostEqual(numbers["t30_mid_s"].standard_error, error, places=12)
        self.assertIn("bass_ratio", repr(found))

    def test_bands_that_are_missing_are_named(self):
        found = sabine.measure(decaying_tones(np.ones(6), 1.5), RATE_HZ, bands_hz=[1000, 2000])
        number = found.single_numbers["t30_mid_s"]
        self.assertTrue(np.isnan(number.value))
        self.assertIn("from 500 to 1000 Hz", number.reason)

    def test_the_mean_over_positions_has_the_error_of_their_spread(self):
        hz = [500, 1000]
        at = [sabine.measure(decaying_tones(np.full(6, t), 1.5), RATE_HZ, bands_hz=hz).t30_s for t in (0.8, 1.0, 1.2)]
        silent = sabine.measure(np.zeros(RATE_HZ), RATE_HZ, bands_hz=hz).t30_s
        found = sabine.spatial_mean([silent, *at])
        values = np.array([np.asarray(readings) for readings in at])
        np.testing.assert_allclose(found.mean, values.mean(axis=0), rtol=1e-12)
        np.testing.assert_allclose(found.mean.standard_error, values.std(axis=0, ddof=1) / np.sqrt(3), rtol=1e-9)
        np.testing.assert_array_equal(found.positions, [3, 3])
        nothing = sabine.spatial_mean([silent, silent]).mean
        self.assertEqual(nothing.reason, silent.reason)
        self.assertTrue(np.all(np.isnan(nothing.value)))

    def test_positions_that_do_not_go_together_are_refused(self):
        one, other = (sabine.measure(decaying_tones(np.ones(6), 1.5), RATE_HZ, bands_hz=hz).t30_s for hz in ([500], [1000]))
        self.assert_refused("positions\\[1\\]: its bands", sabine.spatial_mean, [one, other])
        self.assert_refused("positions: there are none", sabine.spatial_mean, [])
        self.assert_refused("positions\\[0\\]: expected Readings", sabine.spatial_mean, [1.0])


if __name__ == "__main__":
    unittest.main()
