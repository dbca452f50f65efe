"""Absorption fitted by Sabine and by its peers to the same simulated room, in one run. Prints the table of docs/validation/optimize.md.

    cargo build --release -p sabine-cli
    pip install numpy acoustic-spaces misuka
    python docs/validation/peers/optimize_peers.py [one|three] [sabine] [acoustic_spaces] [misuka]

The truth is a box of 7 x 5 x 3 m, scattering 0.3, whose energies come from the particles in this file: neither Sabine's code nor a
peer's. They also judge: the T30 error is theirs, with the absorption that was found and with other random numbers. One material is
fitted to the T30 of one position, three (walls, floor, ceiling) to what two positions give each program: Sabine gets responses,
acoustic-spaces their T30, EDT and C80, misuka the energies in bins of 20 ms, by Adam on the logarithms of the energies.
Every program starts from an absorption of 0.1 and runs in a process of its own, on one thread; seconds are of the processor, start and
compilation included. misuka knows no air: its energies are given the air's share afterwards.
misuka (PolyForm Noncommercial) compiles through LLVM and needs a newer one than 15 (DRJIT_LIBLLVM_PATH names the library).
"""

import itertools
import json
import os
import subprocess
import sys
import tempfile
import time
import wave
from pathlib import Path

os.environ.update({"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "1"})

import numpy as np  # noqa: E402  (after the number of threads is set)

ROOT = Path(__file__).resolve().parents[3]
SIZE_M, SOURCE_M, RECEIVERS_M = [7.0, 5.0, 3.0], [1.5, 1.5, 1.5], [[5.0, 3.5, 1.2], [2.6, 3.9, 1.7]]
SCATTERING, SPEED_M_S, DURATION_S, BIN_S, START = 0.3, 343.2, 1.2, 1e-3, 0.1
OCTAVES_HZ = np.array([62.5, 125.0, 250.0, 500.0, 1000.0, 2000.0, 4000.0, 8000.0])
# Walls, floor, ceiling; the first row is the case of one material.
ONE = np.array([[0.15, 0.16, 0.18, 0.2, 0.22, 0.25, 0.27, 0.3]] * 3)
# Alike in all octaves: in Sabine's responses an octave filter lets pass what rings longer beside it.
THREE = np.array([[0.12] * 8, [0.35] * 8, [0.25] * 8])
CASES = {"one": (ONE, 1), "three": (THREE, 2)}
# Specular paths of up to so many reflections are pulses in the responses that Sabine gets.
ORDER = 6
ADAM_STEPS, ADAM_RATE, SAMPLES, SLICE_S = 60, 0.06, 1000, 0.02


def air_per_m():
    """Exponent of energy in air per metre at 20 C, 50 %, 101.325 kPa (ISO 9613-1)."""
    kelvin, relative = 293.15, 1.0
    saturation = 10 ** (-6.8346 * (273.16 / kelvin) ** 1.261 + 4.6151)
    h = 50.0 * saturation
    oxygen = 24 + 4.04e4 * h * (0.02 + h) / (0.391 + h)
    nitrogen = relative**-0.5 * (9 + 280 * h * np.exp(-4.170 * (relative ** (-1 / 3) - 1)))
    f2 = OCTAVES_HZ**2
    decibels = 8.686 * f2 * (
        1.84e-11 * relative**0.5
        + relative**-2.5
        * (0.01275 * np.exp(-2239.1 / kelvin) / (oxygen + f2 / oxygen) + 0.1068 * np.exp(-3352.0 / kelvin) / (nitrogen + f2 / nitrogen))
    )
    return decibels * np.log(10) / 10


def particles(receiver, seed, count=100_000, radius=0.5):
    """Lengths, hits of walls, floor and ceiling, shares of energy, and number of scatterings of all crossings of a sphere, free of
    absorption and air."""
    random = np.random.default_rng(seed)
    size, centre = np.array(SIZE_M), np.array(receiver)

    def isotropic(n):
        v = random.normal(size=(n, 3))
        return v / np.linalg.norm(v, axis=1, keepdims=True)

    at, way = np.tile(SOURCE_M, (count, 1)).astype(float), isotropic(count)
    travelled, hits, scatterings = np.zeros(count), np.zeros((count, 3)), np.zeros(count, int)
    found = []
    alive = np.arange(count)
    while len(alive):
        p, v = at[alive], way[alive]
        with np.errstate(divide="ignore"):
            steps = np.where(v > 0, (size - p) / v, np.where(v < 0, -p / v, np.inf))
        axis = steps.argmin(axis=1)
        length = steps[np.arange(len(p)), axis]
        nearest = np.einsum("ij,ij->i", centre - p, v)
        miss2 = np.einsum("ij,ij->i", centre - p, centre - p) - nearest**2
        half = np.sqrt(np.clip(radius**2 - miss2, 0, None))
        chord = np.clip(np.minimum(nearest + half, length) - np.maximum(nearest - half, 0), 0, None)
        inside = np.flatnonzero(chord > 0)
        lengths = travelled[alive][inside] + np.clip(nearest[inside], 0, None)
        found.append((lengths, hits[alive][inside], chord[inside], scatterings[alive][inside]))
        travelled[alive] += length
        high = v[np.arange(len(p)), axis] > 0
        surface = np.where(axis < 2, 0, np.where(high, 2, 1))
        hits[alive, surface] += 1
        p = np.clip(p + v * length[:, None], 0, size)
        normal = np.zeros_like(p)
        normal[np.arange(len(p)), axis] = np.where(high, -1.0, 1.0)
        mirrored = v - 2 * np.einsum("ij,ij->i", v, normal)[:, None] * normal
        lambert = normal + isotropic(len(p))  # Lambert's law: a normal and a point of the unit sphere
        lambert /= np.linalg.norm(lambert, axis=1, keepdims=True)
        scattered = random.random(len(p)) < SCATTERING
        at[alive], way[alive] = p, np.where(scattered[:, None], lambert, mirrored)
        scatterings[alive] += scattered
        alive = alive[travelled[alive] < DURATION_S * SPEED_M_S]
    length, hits, chord, scatterings = (np.concatenate(x) for x in zip(*found))
    return length, hits, chord / (4 / 3 * np.pi * radius**3) / count, scatterings


def images(receiver):
    """The same for the image sources of up to ORDER reflections, found by mirroring."""
    per_axis = []
    for size, s, r in zip(SIZE_M, SOURCE_M, receiver):
        # Mirrored at 0 and at `size` in turn, beginning with either: distance along the axis, hits of the low and the high wall.
        axis = [(s - r, 0, 0)]
        for first in (0, 1):
            place, hits = s, [0, 0]
            for n in range(ORDER):
                high = (first + n) % 2
                place, hits[high] = 2 * size * high - place, hits[high] + 1
                axis.append((place - r, *hits))
        per_axis.append(axis)
    found = []
    for (x, *hx), (y, *hy), (z, low, high) in itertools.product(*per_axis):
        walls = sum(hx) + sum(hy)
        if walls + low + high <= ORDER:
            found.append((np.sqrt(x * x + y * y + z * z), (walls, low, high)))
    length, hits = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    share = (1 - SCATTERING) ** hits.sum(axis=1) / (4 * np.pi * length**2)
    return length, hits, share, np.zeros(len(length), int)


def path_energies(paths, absorption):
    """Energy of each path in each octave."""
    length, hits, share, _ = paths
    log = hits @ np.log1p(-absorption) - np.outer(length, air_per_m())
    return share[:, None] * np.exp(log)


def energies(paths, absorption):
    """Energy per bin and octave."""
    bins = int(DURATION_S / BIN_S)
    place = (paths[0] / SPEED_M_S / BIN_S).astype(int)
    use = place < bins
    weights = path_energies(paths, absorption)
    return np.stack([np.bincount(place[use], weights[use, b], bins) for b in range(len(OCTAVES_HZ))])


def decay_time(energy, start_db, end_db):
    remaining = energy[::-1].cumsum()[::-1]
    level = 10 * np.log10(remaining / remaining[0] + 1e-30)
    use = np.flatnonzero((level <= start_db) & (level >= end_db))
    return -60 / np.polyfit(use * BIN_S, level[use], 1)[0]


def parameters(energy, first_s):
    """T30, EDT and C80 per octave."""
    edge = int((first_s + 0.08) / BIN_S)
    c80 = [10 * np.log10(e[:edge].sum() / e[edge:].sum()) for e in energy]
    return [decay_time(e, -5, -35) for e in energy], [decay_time(e, 0, -10) for e in energy], c80


def direct_s(receiver):
    return float(np.linalg.norm(np.array(receiver) - SOURCE_M)) / SPEED_M_S


def responses(folder, absorption):
    """Pressure: a pulse of random sign for each specular path of up to ORDER reflections, and noise under the energies of all others,
    which is what a diffuse field makes of them. (Under single reflections it would give them the chance of a diffuse field.)"""
    rate = 48_000
    for i, receiver in enumerate(RECEIVERS_M):
        samples = int(DURATION_S * rate)
        random = np.random.default_rng(50 + i)
        noise = np.fft.rfft(random.normal(size=samples))
        frequency = np.fft.rfftfreq(samples, 1 / rate)
        length, hits, share, scatterings = particles(receiver, i)
        others = (scatterings > 0) | (hits.sum(axis=1) > ORDER)
        energy = energies((length[others], hits[others], share[others], scatterings[others]), absorption)
        exact = images(receiver)
        amplitudes = np.sqrt(path_energies(exact, absorption)) * np.where(exact[1].sum(axis=1) > 0, random.choice([-1, 1], len(exact[0])), 1)[:, None]
        pressure, pulses = np.zeros(samples), np.zeros(len(frequency), complex)
        for b, hz in enumerate(OCTAVES_HZ):
            low, high = (0, 88.4) if b == 0 else (hz / 2**0.5, hz * 2**0.5 if b < 7 else rate)
            band = (frequency >= low) & (frequency < high)
            octave = np.fft.irfft(np.where(band, noise, 0), samples)
            # A unit impulse has this energy in the band.
            octave *= np.sqrt((min(high, rate / 2) - low) / (rate / 2) / octave.var() / (rate * BIN_S))
            pressure += octave * np.sqrt(np.repeat(energy[b], int(rate * BIN_S))[:samples])
            for length_m, amplitude in zip(exact[0], amplitudes[:, b]):
                pulses[band] += amplitude * np.exp(-2j * np.pi * frequency[band] * length_m / SPEED_M_S)
        pressure += np.fft.irfft(pulses, samples)
        with wave.open(str(Path(folder, f"r{i}.wav")), "wb") as file:
            file.setparams((1, 3, rate, samples, "NONE", ""))
            whole = np.clip(pressure / np.abs(pressure).max() * 0.9, -1, 1) * (2**23 - 1)
            file.writeframes(whole.astype("<i4").view(np.uint8).reshape(-1, 4)[:, :3].tobytes())


def sabine(case, folder, truth):
    x, y, z = SIZE_M
    corners = [(i, j, k) for k in (0, z) for j in (0, y) for i in (0, x)]
    faces = {"floor": [(1, 2, 4, 3)], "ceiling": [(5, 7, 8, 6)], "walls": [(1, 5, 6, 2), (3, 4, 8, 7), (1, 3, 7, 5), (2, 6, 8, 4)]}
    names = {"walls": "walls", "floor": "floor", "ceiling": "ceiling"} if case == "three" else dict.fromkeys(faces, "walls")
    obj = "".join(f"v {a} {b} {c}\n" for a, b, c in corners)
    for face, quads in faces.items():
        obj += f"usemtl {names[face]}\n" + "".join(f"f {a} {b} {c}\nf {a} {c} {d}\n" for a, b, c, d in quads)
    Path(folder, "room.obj").write_text(obj)
    row = lambda value: [value] * 7  # noqa: E731
    toml = '[room]\nmesh = "room.obj"\n[air]\ntemperature_c = 20.0\nrelative_humidity_percent = 50.0\npressure_kpa = 101.325\n'
    # Levels of the files are scaled to their peaks.
    toml += '[measurement]\ntime_zero = "emission"\nlevels = "per_response"\n[bands]\n'
    toml += f"centres_hz = {OCTAVES_HZ[1:].tolist()}\n"
    for name in dict.fromkeys(names.values()):
        toml += f"[materials.{name}]\nabsorption = {row(START)}\nabsorption_sd = {row(0.2)}\nscattering = {row(SCATTERING)}\n"
    toml += f'[[sources]]\nid = "s"\nposition_m = {SOURCE_M}\n'
    for i, receiver in enumerate(RECEIVERS_M):
        toml += f'[[receivers]]\nid = "r{i}"\nposition_m = {receiver}\n'
    if case == "three":
        responses(folder, THREE)
        toml += "".join(f'[[responses]]\nsource = "s"\nreceiver = "r{i}"\nfile = "r{i}.wav"\n' for i in range(2))
    Path(folder, "room.toml").write_text(toml)
    command = [str(ROOT / "target/release/sabine"), "fit", "--room", folder, "--out", str(Path(folder, "out")), "--rays", "20000"]
    if case == "one":
        t30 = parameters(truth[0], direct_s(RECEIVERS_M[0]))[0]
        command += ["--t60", ",".join(f"{t:.5f}" for t in t30[1:])]
    else:
        command += ["--responses"]
    subprocess.run(command, check=True, stdout=sys.stderr)
    fitted = json.loads(Path(folder, "out", "fit.json").read_text())["materials"]
    rows = [fitted[names[face]]["absorption"] for face in ("walls", "floor", "ceiling")]
    return [[r[0], *r] for r in rows]  # 62.5 Hz is not fitted; it is not judged either


def acoustic_spaces(case, folder, truth):
    from acoustic_spaces import Room
    from acoustic_spaces.calibration import calibrate
    from acoustic_spaces.parameters import RoomParameters

    names = ["walls", "floor", "ceiling"] if case == "three" else ["walls"]
    material = {"absorption": [START] * 8, "scattering": SCATTERING}
    used = dict(zip(["walls", "floor", "ceiling"], names * 3 if case == "one" else names))
    scene = {
        "name": "box",
        "geometry": {"floor_plan": [[0, 0], [SIZE_M[0], 0], SIZE_M[:2], [0, SIZE_M[1]]], "height": SIZE_M[2]},
        "materials": {name: dict(material) for name in names},
        "assignments": used,
        "sources": [{"name": "s", "position": SOURCE_M}],
        "listeners": [{"name": f"r{i}", "position": r} for i, r in enumerate(RECEIVERS_M)],
        "simulation": {
            "early": {"method": "ray_tracing", "max_order": 3},
            "late": {"method": "stochastic_ray_tracing"},
            "ir_length_s": DURATION_S,
        },
        "outputs": ["mono"],
    }
    Path(folder, "scene.json").write_text(json.dumps(scene))  # JSON is YAML
    measured = {}
    for i in range(CASES[case][1]):
        t30, edt, c80 = parameters(truth[i], direct_s(RECEIVERS_M[i]))
        nothing = np.full(8, np.nan)
        measured[("s", f"r{i}")] = RoomParameters(
            edt=np.array(edt), t20=nothing, t30=np.array(t30), c50=nothing, c80=np.array(c80), d50=nothing, ts=nothing, g=nothing
        )
    room = Room.from_yaml(Path(folder, "scene.json"))
    wanted = ("t30",) if case == "one" else ("t30", "edt", "c80")
    found = calibrate(room, measured, names, parameters=wanted, threads=1).absorption
    return [found[names.index(used[face])].tolist() for face in ("walls", "floor", "ceiling")]


def misuka(case, folder, truth):
    import misuka as mi

    mi.set_variant("llvm_ad_acoustic")
    import drjit as dr

    dr.set_thread_count(1)
    spectrum = lambda value: {"type": "spectrum", "value": [(f, value) for f in OCTAVES_HZ]}  # noqa: E731
    place = mi.ScalarTransform4f
    x, y, z = SIZE_M
    bsdf = {"type": "acousticbsdf", "absorption": spectrum(START), "scattering": spectrum(SCATTERING)}
    middle = place().translate([x / 2, y / 2, z / 2])
    turned = {
        "wall_0": place().translate([0, y / 2, z / 2]).rotate([0, 1, 0], 90).scale([z / 2, y / 2, 1]),
        "wall_1": place().translate([x, y / 2, z / 2]).rotate([0, 1, 0], -90).scale([z / 2, y / 2, 1]),
        "wall_2": place().translate([x / 2, 0, z / 2]).rotate([1, 0, 0], -90).scale([x / 2, z / 2, 1]),
        "wall_3": place().translate([x / 2, y, z / 2]).rotate([1, 0, 0], 90).scale([x / 2, z / 2, 1]),
        "floor": place().translate([x / 2, y / 2, 0]).scale([x / 2, y / 2, 1]),
        "ceiling": place().translate([x / 2, y / 2, z]).rotate([1, 0, 0], 180).scale([x / 2, y / 2, 1]),
    }
    slices = int(DURATION_S / SLICE_S)
    used = CASES[case][1]
    scene = {"type": "scene", "integrator": {"type": "acoustic_prb", "max_time": DURATION_S, "speed_of_sound": SPEED_M_S,
                                             "max_depth": -1, "max_energy_loss": -1.0}}
    scene["source"] = {"type": "sphere", "center": SOURCE_M, "radius": 0.25,
                       "emitter": {"type": "area", "radiance": {"type": "uniform", "value": 1.0}}}
    if case == "one":
        scene["walls"] = {"type": "cube", "flip_normals": True, "to_world": middle.scale([x / 2, y / 2, z / 2]), "bsdf": bsdf}
        keys = {"walls": ["walls"]}
    else:
        for i, (name, at) in enumerate(turned.items()):
            # Equal materials would be merged into one.
            own = {**bsdf, "scattering": spectrum(SCATTERING + 1e-6 * i)}
            scene[name] = {"type": "rectangle", "to_world": at, "bsdf": own}
        keys = {"walls": [f"wall_{i}" for i in range(4)], "floor": ["floor"], "ceiling": ["ceiling"]}
    for i in range(used):
        scene[f"receiver_{i}"] = {
            "type": "microphone", "to_world": place().translate(RECEIVERS_M[i]),
            "film": {"type": "tape", "frequencies": ", ".join(map(str, OCTAVES_HZ)), "time_bins": slices, "rfilter": {"type": "box"}},
        }
    world = mi.load_dict(scene)
    values = mi.traverse(world)
    adam = mi.ad.Adam(lr=ADAM_RATE)
    logit = float(np.log(START / (1 - START)))
    for name in keys:
        adam[name] = dr.full(mi.Float, logit, len(OCTAVES_HZ))
    air = np.exp(-np.outer((np.arange(slices) + 0.5) * SLICE_S * SPEED_M_S, air_per_m()))
    wanted, counts = [], []
    for i in range(used):
        coarse = truth[i][:, : slices * int(SLICE_S / BIN_S)].reshape(8, slices, -1).sum(axis=2).T / air
        remaining = (coarse * air)[::-1].cumsum(axis=0)[::-1]
        # The direct sound hangs on how large source and receiver are: it is left out, and so is what lies 35 dB down.
        weight = (remaining > 10**-3.5 * remaining[0]) & (np.arange(slices)[:, None] * SLICE_S > direct_s(RECEIVERS_M[i]))
        wanted.append(mi.TensorXf(np.log(coarse + 1e-30)[..., None].astype(np.float32)))
        counts.append(mi.TensorXf(weight[..., None].astype(np.float32)))
    for step in range(ADAM_STEPS):
        for name, parts in keys.items():
            for part in parts:
                values[f"{part}.bsdf.absorption.values"] = 1 / (1 + dr.exp(-adam[name]))
        values.update()
        loss = 0
        for i in range(used):
            image = mi.render(world, values, sensor=i, spp=SAMPLES, seed=2 * step + i)
            apart = (dr.log(image + 1e-12) - wanted[i]) * counts[i]
            # Powers of source and receiver are free.
            mean = dr.sum(apart) / dr.sum(counts[i])
            loss += dr.sum(counts[i] * dr.square(apart - mean)) / dr.sum(counts[i])
        dr.backward(loss)
        adam.step()
    found = {name: (1 / (1 + np.exp(-np.array(adam[name])))).tolist() for name in keys}
    return [found.get(face, found["walls"]) for face in ("walls", "floor", "ceiling")]


def main():
    print("| case | program | T30 error % | mean absolute error of absorption | s of the processor |")
    print("|---|---|---|---|---|")
    others = [particles(r, 900 + i) for i, r in enumerate(RECEIVERS_M)]
    with tempfile.TemporaryDirectory() as folder:
        for case, (absorption, used) in CASES.items():
            if set(sys.argv) & set(CASES) and case not in sys.argv:
                continue
            truth = [energies(particles(r, i), absorption) for i, r in enumerate(RECEIVERS_M)]
            np.save(Path(folder, "truth.npy"), truth)
            exact = [np.array(parameters(e, 0.01)[0]) for e in truth]

            def judged(found):
                # 125 Hz to 8 kHz.
                t30 = [np.array(parameters(energies(p, found), 0.01)[0]) for p in others]
                return np.mean([np.abs(a / b - 1)[1:].mean() for a, b in zip(t30[:used], exact[:used])]) * 100

            print(f"| {case} | the truth itself | {judged(absorption):.2f} | 0 | - |")
            for name in [n for n in sys.argv[1:] if n not in CASES] or ["sabine", "acoustic_spaces", "misuka"]:
                work = Path(folder, f"{name}_{case}")
                work.mkdir()
                before, start = os.times(), time.perf_counter()
                command = [sys.executable, __file__, "--worker", name, case, str(work), str(Path(folder, "truth.npy"))]
                done = subprocess.run(command, capture_output=True, text=True)
                after = os.times()
                seconds = after.children_user + after.children_system - before.children_user - before.children_system
                if done.returncode != 0:
                    last = (done.stderr.strip().splitlines() or ["no message"])[-1]
                    print(f"{name}: exit status {done.returncode}: {last}", file=sys.stderr)
                    print(f"| {case} | {name} | - | - | - |")
                    continue
                found = np.array(json.loads(done.stdout.splitlines()[-1]))
                error = np.abs(found - absorption)[:, 1:].mean()
                print(f"| {case} | {name} | {judged(found):.2f} | {error:.4f} | {seconds:.1f} |", flush=True)
                print(np.round(found, 3).tolist(), f"{time.perf_counter() - start:.0f} s", file=sys.stderr)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        name, case, folder, file = sys.argv[2:]
        print(json.dumps({"sabine": sabine, "acoustic_spaces": acoustic_spaces, "misuka": misuka}[name](case, folder, np.load(file))))
    else:
        main()
