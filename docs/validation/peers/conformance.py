#!/usr/bin/env python3
"""phonometry's and pyrato's own conformance cases, as files: what `sabine measure`, phonometry and pyrato read of each.

    cargo build --release -p sabine-cli
    pip download --no-deps --no-binary :all: pyrato==1.1.0 && tar xzf pyrato-1.1.0.tar.gz
    python3 docs/validation/peers/conformance.py [SABINE [PYRATO]]

Needs Python 3.13, numpy, soundfile, phonometry 4.0.0rc1 (`pip install --pre phonometry==4.0.0rc1`), pyrato 1.1; PYRATO is the unpacked source
of pyrato, whose tests hold a measured response and its modulation transfer by WinMF; without it that row is left out.

The cases are closed forms of phonometry's tests (room/test_acoustics.py, test_auditorium.py, test_auditorium_lateral.py,
speech/test_sti.py) and of pyrato's (tests/test_parameters.py, test_parameters_rt.py), written again here. pyrato's are decay curves; a
response with that decay is made of each. Some of phonometry's are of the full band, where we read the quantity in octaves only: the same
figure is then expected of each octave that the case leaves whole, and the row says which. The peers read the same samples, phonometry as
its own test calls it. One row a case: the number of figures, the largest difference of each program from what the case prints, and our bound.
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
from phonometry import room, speech
from phonometry.speech import sti as ph_sti

HERE = os.path.dirname(os.path.abspath(__file__))
OURS = sys.argv[1] if len(sys.argv) > 1 else os.path.join(HERE, "..", "..", "..", "target/release/sabine")
PYRATO = sys.argv[2] if len(sys.argv) > 2 else None
RATE = 48000
A60 = 6.0 * np.log(10.0)
OCTAVES = [125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0]
GAP = [np.nan]
ROWS = []


def sabine(*channels, rate=RATE, files=None, options=(), low="125", high="4000"):
    """Our figures of a response of one or two channels; `files` are responses beside it, by option."""
    with tempfile.TemporaryDirectory() as folder:
        paths = {}
        for name, data in {"main": np.stack(channels, 1), **(files or {})}.items():
            paths[name] = os.path.join(folder, name.strip("-") + ".wav")
            soundfile.write(paths[name], np.asarray(data, dtype=np.float32), rate, subtype="FLOAT")
        beside = [word for name in files or {} for word in (name, paths[name])]
        result = os.path.join(folder, "ours.json")
        command = [OURS, "measure", paths["main"], *beside, *options, "--from", low, "--to", high, "--json", result]
        done = subprocess.run(command, capture_output=True, text=True)
        if done.returncode:
            raise SystemExit(f"{' '.join(command)}: {done.stderr}")
        with open(result, encoding="utf-8") as file:
            return json.load(file)[0]


def numbers(values):
    return np.array([np.nan if v is None else v for v in np.atleast_1d(np.array(values, dtype=object))], dtype=float)


def row(quantity, case, wanted, ours, phonometry=None, pyrato_=None, bound=None, relative=False):
    wanted = np.atleast_1d(np.array(wanted, dtype=float))
    found = []
    for values in (ours, phonometry, pyrato_):
        if values is None:
            found.append(None)
            continue
        off = np.abs(numbers(values) - wanted)
        found.append(100.0 * off / np.abs(wanted) if relative else off)
    ROWS.append((quantity, case, wanted.size, found, bound, " %" if relative else ""))


def exponential(t60, seconds, rate=RATE):
    t = np.arange(round(seconds * rate)) / rate
    return np.exp(-0.5 * A60 * t / t60)


def multitone(t60, seconds):
    """A tone in each octave, all under the same envelope, or each under its own."""
    t = np.arange(round(seconds * RATE)) / RATE
    times = np.broadcast_to(t60, len(OCTAVES))
    return sum(np.sin(2 * np.pi * f * t) * np.exp(-0.5 * A60 * t / each) for f, each in zip(OCTAVES, times))


def noise(t60, seconds, seed, rate=RATE):
    t = np.arange(round(seconds * rate)) / rate
    return np.random.default_rng(seed).standard_normal(t.size) * np.exp(-0.5 * A60 * t / t60)


def pulses(seconds, **at):
    """Pulses by time: `pulses(0.3, p100=1.0)` is one at sample 100."""
    samples = np.zeros(round(seconds * RATE))
    for index, amplitude in at.items():
        samples[int(index[1:])] += amplitude
    return samples


def clarity_db(t60, limit_s):
    return 10 * np.log10(np.exp(A60 * limit_s / t60) - 1)


def full(samples, name, rate=RATE):
    return sabine(samples, rate=rate)["full_band"][name]


def by_pyrato(samples, what, rate=RATE, **options):
    """One of pyrato's parameters of the response from its start on."""
    curve = pyrato.edc.schroeder_integration(pyfar.Signal(np.asarray(samples, float), rate))
    curve.time = curve.time / curve.time[..., :1]
    return float(np.squeeze(getattr(pyrato.parameters, what)(curve, **options)))


def decays():
    """phonometry: test_rt_exponential_broadband, test_clarity_closed_form, test_definition_and_centre_time_closed_form."""
    times = (0.5, 1.0, 2.0)
    responses = [exponential(t, 3 * t) for t in times]
    ours = [sabine(r)["full_band"] for r in responses]
    theirs = [room.room_parameters(r, RATE, limits=None) for r in responses]
    case = "exponential decays of 0.5, 1, 2 s, full band (phonometry)"
    wanted = {
        "edt_s": times, "t20_s": times, "t30_s": times,
        "c80_db": [clarity_db(t, 0.08) for t in times], "c50_db": [clarity_db(t, 0.05) for t in times],
        "d50": [1 - np.exp(-A60 * 0.05 / t) for t in times], "centre_time_s": [t / A60 for t in times],
    }
    third = {
        **{f"{k}_s": lambda r, k=k: by_pyrato(r, "reverberation_time_linear_regression", T=k.upper()) for k in ("edt", "t20", "t30")},
        "c80_db": lambda r: by_pyrato(r, "clarity", early_time_limit=80), "c50_db": lambda r: by_pyrato(r, "clarity", early_time_limit=50),
        "d50": lambda r: by_pyrato(r, "definition", early_time_limit=50), "centre_time_s": lambda r: by_pyrato(r, "center_time"),
    }
    bounds = {"edt_s": 1.0, "t20_s": 1.0, "t30_s": 1.0, "c80_db": 0.05, "c50_db": 0.05, "d50": 0.005, "centre_time_s": 0.0005}
    names = {"edt_s": "EDT", "t20_s": "T20", "t30_s": "T30", "c80_db": "C80 (dB)", "c50_db": "C50 (dB)", "d50": "D50", "centre_time_s": "Ts (s)"}
    attribute = {"edt_s": "edt", "t20_s": "t20", "t30_s": "t30", "c80_db": "c80", "c50_db": "c50", "d50": "d50", "centre_time_s": "ts"}
    for key, want in wanted.items():
        row(names[key], case, want, [o[key] for o in ours], [getattr(t, attribute[key])[0] for t in theirs],
            [third[key](r) for r in responses], bounds[key], relative=key in ("edt_s", "t20_s", "t30_s"))
    shifted = np.concatenate([np.zeros(RATE // 20), exponential(1.0, 3.0)])
    moved, plain, theirs = sabine(shifted)["full_band"], ours[1], room.room_parameters(shifted, RATE, limits=None)
    for key, bound in (("c80_db", 0.05), ("centre_time_s", 0.0005)):
        row(names[key], "50 ms of silence before it change nothing (phonometry)", [plain[key]], [moved[key]],
            [getattr(theirs, attribute[key])[0]], None, bound)


def octave_decays():
    """phonometry: test_rt_exponential_per_octave_band, with its bounds; the bass ratio has no case in either program: its definition."""
    response = multitone(1.0, 3.0)
    ours, theirs = sabine(response), room.room_parameters(response, RATE)
    case = "a tone in each octave under a decay of 1 s (phonometry)"
    for name, key in (("EDT", "edt"), ("T20", "t20"), ("T30", "t30")):
        row(name, case, np.ones(6), ours[f"{key}_s"], getattr(theirs, key), None, 1.0, relative=True)
    row("C80 (dB)", case, np.full(6, clarity_db(1.0, 0.08)), ours["c80_db"], theirs.c80, None, 0.7)
    times = np.array([1.3, 1.2, 1.0, 1.1, 0.9, 0.8])
    found = sabine(multitone(times, 4.0), options=("--sti",), high="4000")["single_numbers"]["bass_ratio"]
    row("BR", "tones under decays of 1.3, 1.2, 1.0, 1.1 s; neither has the ratio", [times[:2].sum() / times[2:4].sum()], [found], None, None, 0.01)


def noisy_decays():
    """phonometry: test_decay_validity_thresholds_account_for_tail_compensation (5 %), test_short_ir_yields_nan_and_invalid."""
    for name, key, sigma in (("T20", "t20", 0.0025), ("T30", "t30", 0.0016)):
        response = exponential(1.0, 3.0) + sigma * np.random.default_rng(0).standard_normal(3 * RATE)
        theirs = getattr(room.room_parameters(response, RATE, limits=None), key)
        row(name, f"decay of 1 s, noise of {sigma} of its peak, full band (phonometry)", [1.0], [full(response, f"{key}_s")], theirs, None, 5.0, True)
    short = sabine(exponential(2.0, 0.3))["full_band"]
    answered = 0.0 if short["t30_s"] is None else 1.0
    theirs = room.room_parameters(exponential(2.0, 0.3), RATE, limits=None)
    row("T30", "0.3 s of a decay of 2 s: no answer (phonometry)", [0.0], [answered], [float(np.isfinite(theirs.t30[0]))], None, 0.0)
    t = np.arange(4 * RATE) / RATE
    double = np.sqrt(np.exp(-A60 * t / 0.4) + 1e-2 * np.exp(-A60 * t / 2.0))
    found, theirs = sabine(double)["full_band"], room.room_parameters(double, RATE, limits=None)
    rises = float(found["edt_s"] < found["t20_s"] < found["t30_s"])
    row("T30", "two slopes: EDT < T20 < T30 (phonometry)", [1.0], [rises], [float(theirs.edt[0] < theirs.t20[0] < theirs.t30[0])], None, 0.0)


def pyrato_decays():
    """pyrato: test_rt_from_edc_mulitchannel, test_clarity_..., test_definition_..., test_center_time_exponential_decay_analytical."""
    times = (1.0, 2.0, 1.5)
    responses = [exponential(t, 3.0) for t in times]
    ours = [sabine(r)["full_band"] for r in responses]
    for name in ("EDT", "T20", "T30"):
        row(name, "exponential decays of 1, 2, 1.5 s (pyrato)", times, [o[f"{name.lower()}_s"] for o in ours], None,
            [by_pyrato(r, "reverberation_time_linear_regression", T=name) for r in responses], 1.0, relative=True)
    two = np.sqrt(pulses(1.0, p480=1.0, p4800=0.5))
    row("C80 (dB)", "a pulse and half its energy 90 ms later (pyrato)", [10 * np.log10(2)], [full(two, "c80_db")],
        room.room_parameters(two, RATE, limits=None).c80, [by_pyrato(two[480:], "clarity", early_time_limit=80)], 0.05)
    row("D50", "a pulse and half its energy 90 ms later (pyrato)", [1 / 1.5], [full(two, "d50")], room.room_parameters(two, RATE, limits=None).d50,
        [by_pyrato(two[480:], "definition", early_time_limit=50)], 0.005)
    slow = exponential(2.0, 5.0)
    theirs = room.room_parameters(slow, RATE, limits=None)
    ours = sabine(slow)["full_band"]
    row("C80 (dB)", "exponential decay of 2 s (pyrato)", [clarity_db(2.0, 0.08)], [ours["c80_db"]], theirs.c80,
        [by_pyrato(slow, "clarity", early_time_limit=80)], 0.05)
    row("Ts (s)", "exponential decay of 2 s (pyrato)", [2.0 / A60], [ours["centre_time_s"]], theirs.ts, [by_pyrato(slow, "center_time")], 0.0005)


def strength():
    """phonometry: test_a_scaled_response..., test_it_does_not_grow_with_the_length...; pyrato: test_strength_matches_known_reference_ratio."""
    reference = pulses(0.3, p1440=1.0)
    for factors, case in (((2.0, 10.0, 0.5), "the reference times 2, 10, 0.5 (phonometry)"), ((np.sqrt(2),), "twice the reference's energy (pyrato)")):
        wanted = np.concatenate([np.full(6, 20 * np.log10(f)) for f in factors])
        ours = np.concatenate([numbers(sabine(f * reference, files={"--reference": reference})["g_db"]) for f in factors])
        theirs = np.concatenate([room.sound_strength(f * reference, reference, RATE).strength for f in factors])
        curve = [pyrato.edc.schroeder_integration(pyfar.Signal(f * reference, RATE)) for f in (1.0, *factors)]
        third = [float(np.squeeze(pyrato.parameters.sound_strength(c, curve[0]))) for c in curve[1:]]
        row("G (dB)", case + ", octaves", wanted, ours, theirs, np.repeat(third, 6), 0.1)
    t = np.arange(8 * RATE) / RATE
    rng = np.random.default_rng(3382)
    recorded = 0.1 * (rng.standard_normal(t.size) * np.exp(-0.5 * A60 * t / 1.2) + 3e-3 * rng.standard_normal(t.size))
    short, long = (numbers(sabine(recorded[: cut * RATE], files={"--reference": reference})["g_db"]) for cut in (2, 8))
    theirs = [room.sound_strength(recorded[: cut * RATE], reference, RATE).strength for cut in (2, 8)]
    row("G (dB)", "noisy decay of 1.2 s, 8 s of it against 2 s (phonometry), octaves", short, long, theirs[1] - theirs[0] + short, None, 0.1)


def lateral():
    """phonometry: one reflection at 20 ms at 0, 45, 60 degrees, mirror images, L_J; pyrato: JLF 0.5, LJ, JLF of exponential decays."""
    for name, key, weighting, power in (("J_LF", "j_lf", "squared", 2), ("J_LFC", "j_lfc", "cosine", 1)):
        wanted, ours, theirs = [], [], []
        for angle in (0.0, 45.0, 60.0):
            cosine = np.cos(np.deg2rad(angle))
            omni, eight = pulses(0.3, p100=1.0, p1060=0.5), pulses(0.3, p1060=0.5 * cosine)
            wanted += [0.2 * cosine**power] * 4
            ours += sabine(omni, files={"--lateral": eight}, low="1000", high="8000")[key]
            found = room.early_lateral_energy_fraction(omni, eight, RATE, weighting=weighting, limits=(1000.0, 8000.0))
            theirs += list(found.energy_fraction)
        row(name, "one reflection from 0, 45, 60 degrees (phonometry), octaves from 1 to 8 kHz", wanted, ours, theirs, None, 0.01)
    cosine = np.cos(np.pi / 4)
    omni, eight = pulses(0.3, p100=1.0, p1060=0.5, p1540=0.5), pulses(0.3, p1060=0.5 * cosine, p1540=-0.5 * cosine)
    theirs = room.early_lateral_energy_fraction(omni, eight, RATE, weighting="cosine", limits=(1000.0, 8000.0)).energy_fraction
    row("J_LFC", "mirror images do not cancel (phonometry), octaves from 1 to 8 kHz", np.full(4, 0.5 * cosine / 1.5),
        sabine(omni, files={"--lateral": eight}, low="1000", high="8000")["j_lfc"], theirs, None, 0.01)
    for at, case in ((244, "a reflection at 3 ms"), (4420, "a reflection at 90 ms")):
        omni, eight = pulses(0.3, p100=1.0, **{f"p{at}": 0.5}), pulses(0.3, **{f"p{at}": 0.5 * cosine})
        theirs = room.early_lateral_energy_fraction(omni, eight, RATE, limits=(1000.0, 8000.0)).energy_fraction
        row("J_LF", case + " counts nothing (phonometry), octaves from 1 to 8 kHz", np.zeros(4),
            sabine(omni, files={"--lateral": eight}, low="1000", high="8000")["j_lf"], theirs, None, 0.01)
    omni, eight = pulses(0.5, p100=1.0), pulses(0.5, p1060=np.sqrt(0.5))
    theirs = room.early_lateral_energy_fraction(omni, eight, RATE).energy_fraction
    row("J_LF", "half the direct energy from the side (pyrato), octaves", np.full(6, 0.5), sabine(omni, files={"--lateral": eight})["j_lf"], theirs, None, 0.01)
    reference = pulses(0.2, p480=1.0)
    for amplitude, case in ((0.25, "a quarter at 120 ms (phonometry)"), (np.sqrt(0.5), "half the energy at 120 ms (pyrato)")):
        omni, eight = pulses(0.5, p100=1.0, p1060=0.5), pulses(0.5, p5860=amplitude)
        theirs = room.late_lateral_sound_level(omni, eight, reference, RATE).level
        row("L_J (dB)", case + ", octaves", np.full(6, 20 * np.log10(amplitude)),
            sabine(omni, files={"--lateral": eight, "--reference": reference})["l_j_db"], theirs, None, 0.1)
    a, b = A60 / 2.0, A60 / 2.2
    wanted = (np.exp(-0.005 * b) - np.exp(-0.08 * b)) / (1 - np.exp(-0.08 * a))
    # One tone at a time: where a window cuts another octave's tone, the edge is heard in this one.
    ours, theirs, t = [], [], np.arange(5 * RATE) / RATE
    for k, hz in enumerate(OCTAVES):
        tone = np.sin(2 * np.pi * hz * t)
        omni, eight = tone * np.exp(-0.5 * a * t), tone * np.exp(-0.5 * b * t) * np.sqrt(2.0 / 2.2)
        ours.append(sabine(omni, files={"--lateral": eight})["j_lf"][k])
        theirs.append(room.early_lateral_energy_fraction(omni, eight, RATE).energy_fraction[k])
    row("J_LF", "decays of 2 and 2.2 s of equal energy (pyrato), a tone in each octave", np.full(6, wanted), ours, theirs, None, 0.01)


def ears():
    """phonometry: TestInterauralCrossCorrelation, in octaves."""
    names = ("iacc", "iacc_early", "iacc_late")
    windows = ((0.0, None), (0.0, 0.08), (0.08, None))

    def theirs(left, right):
        return np.concatenate([room.interaural_cross_correlation(left, right, RATE, window=w).coefficient for w in windows])

    def mine(left, right):
        found = sabine(0.1 * left, 0.1 * right, options=("--binaural",))
        return np.concatenate([numbers(found[n]) for n in names])

    x, shift = noise(1.0, 0.5, 31), round(0.0005 * RATE)
    for right, case in ((x, "both ears equal"), (-x, "in opposite phase"), (4.0 * x, "one four times as loud")):
        row("IACC", f"{case} (phonometry), octaves, whole, early, late", np.ones(18), mine(x, right), theirs(x, right), None, 0.01)
    y = noise(1.0, 0.5, 34)
    late = np.concatenate([np.zeros(shift), y])[: y.size]
    ours, phonometry = mine(y, late), theirs(y, late)
    row("IACC", "one 0.5 ms later (phonometry: above 0.99), octaves, whole", np.ones(6), ours[:6], phonometry[:6], None, 0.01)
    # No case of theirs: the windows cut the two ears at other places of the same sound, so 1 is not due.
    row("IACC", "one 0.5 ms later, early and late (no case)", np.ones(12), ours[6:], phonometry[6:])


def speech_transmission():
    """phonometry: A.2.2, A.3.1.2, delta, decays with and without noise; pyrato: unit impulse."""
    delta = pulses(1.7, p100=1.0)

    def mine(samples, *options, rate=RATE):
        return sabine(samples, rate=rate, options=("--sti", *options))["sti"]["value"]

    def third(samples, rate=RATE):
        return float(np.squeeze(pyrato.parameters.speech_transmission_index_indirect(pyfar.Signal(np.asarray(samples, float), rate))))

    row("STI", "a pulse (phonometry, pyrato)", [1.0], [mine(delta)], [speech.sti_from_impulse_response(delta, RATE).sti], [third(delta)], 0.01)
    pairs, snrs = [0.127, 0.279, 0.398, 0.531, 0.486, 0.302], []
    for k in range(6):
        snr = np.full(7, -100.0)
        snr[k : k + 2] = 100.0
        snrs.append(snr)
    row("STI", "pairs of octaves, IEC 60268-16, A.2.2 (phonometry)", pairs, [mine(delta, "--snr", ",".join(map(str, s))) for s in snrs],
        [speech.sti_from_impulse_response(delta, RATE, snr=s).sti for s in snrs], None, 0.01)
    depths = np.array([0.059351, 0.11182, 0.20076, 0.33386, 0.5, 0.66614, 0.79924, 0.88818, 0.94065])
    snrs = 10 * np.log10(depths / (1 - depths))
    row("STI", "uniform modulation 0.059 to 0.941, A.3.1.2 (phonometry)", np.arange(1, 10) / 10, [mine(delta, "--snr", str(s)) for s in snrs],
        [speech.sti_from_impulse_response(delta, RATE, snr=s).sti for s in snrs], None, 0.01)
    rate, frequencies = 24000, ph_sti._MOD_FREQS
    for snr in (None, 30.0, 0.0):
        wanted, ours, theirs, last = [], [], [], []
        for t60 in (0.5, 1.0, 2.0, 4.0):
            n = int(2 * t60 * rate)
            response = np.random.default_rng(0).standard_normal(n) * np.exp(-3 * np.log(10) * np.arange(n) / rate / t60)
            depth = 1 / np.sqrt(1 + (2 * np.pi * frequencies * t60 / 13.8) ** 2)
            depth = depth if snr is None else depth / (1 + 10 ** (-snr / 10))
            wanted.append(ph_sti._sti_from_mtf(np.tile(depth, (7, 1))).sti)
            ours.append(mine(0.1 * response, *(() if snr is None else ("--snr", str(snr))), rate=rate))
            theirs.append(speech.sti_from_impulse_response(response, rate, snr=snr).sti)
            # pyrato wants 1.6 s of the response at least.
            last.append(third(response, rate) if snr is None and t60 > 0.5 else np.nan)
        noise_text = "no noise" if snr is None else f"SNR {snr:.0f} dB"
        row("STI", f"decays of 0.5, 1, 2, 4 s, {noise_text} (phonometry)", wanted, ours, theirs, last if snr is None else None, 0.01)
    if PYRATO:
        data = os.path.join(PYRATO, "tests", "test_data")
        response = np.loadtxt(os.path.join(data, "room_impulse_response_with_noise.csv"))
        levels, ambient = np.array([56, 60, 59, 51, 43, 32, 24.0]), np.array([52, 45, 40, 36, 34, 33, 32.0])
        for name, case, snr in (("mtf_ir_WINMF.csv", "no noise", None), ("mtf_ir_level_snr_WINMF.csv", "with noise", levels - ambient)):
            matrix = np.loadtxt(os.path.join(data, name), delimiter=";").T
            options = () if snr is None else ("--snr", ",".join(map(str, snr)))
            quiet = {} if snr is None else {"snr": snr, "level": levels, "ambient_noise_correction": False}
            last = pyrato.parameters.modulation_transfer_function(pyfar.Signal(response, RATE), rir_type="acoustical", **({"level": None, "snr": np.inf, "ambient_noise_correction": False} | quiet))
            row("STI", f"a measured response against WinMF, {case} (pyrato)", [ph_sti._sti_from_mtf(matrix).sti], [mine(response, *options)],
                [speech.sti_from_impulse_response(response, RATE, snr=snr).sti], [ph_sti._sti_from_mtf(np.squeeze(last)).sti], 0.01)


def text(off, unit):
    if off is None:
        return "-"
    if np.all(np.isnan(off)):
        return "no answer"
    unanswered = int(np.isnan(off).sum())
    return f"{np.nanmax(off):.4f}{unit}" + (f", {unanswered} without answer" if unanswered else "")


def main():
    warnings.simplefilter("ignore")
    for part in (decays, octave_decays, noisy_decays, pyrato_decays, strength, lateral, ears, speech_transmission):
        part()
    print(f"phonometry {ph.__version__}, pyrato {pyrato.__version__}\n")
    print("| quantity | case (whose) | figures | ours | phonometry | pyrato | bound | |\n|---|---|---|---|---|---|---|---|")
    for quantity, case, count, found, bound, unit in sorted(ROWS, key=lambda r: r[0]):
        figures = " | ".join(text(off, unit) for off in found)
        met = "-" if bound is None else "met" if not np.any(np.isnan(found[0])) and found[0].max() <= bound else "**missed**"
        print(f"| {quantity} | {case} | {count} | {figures} | {'-' if bound is None else f'{bound}{unit}'} | {met} |")


if __name__ == "__main__":
    main()
