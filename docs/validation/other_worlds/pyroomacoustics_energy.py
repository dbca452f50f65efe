"""What pyroomacoustics' ray tracing makes of the energy and of scattering, in a box whose energies are known.

Prints two tables: energy by time of image sources, of rays alone and of both joined, against the sum of the energies of all images
(no interference); and T30 by scattering coefficient, against Eyring's formula, which holds where enough is scattered.
"""

import numpy as np
import pyroomacoustics as pra
from scipy.signal import butter, sosfiltfilt

RATE_HZ = 16000
SIDES_M = [7.0, 5.0, 3.0]
SOURCE_M = [1.5, 1.2, 1.4]
RECEIVERS_M = np.array(
    [[5.1, 3.3, 1.6], [3.0, 2.0, 1.2], [6.0, 1.0, 2.0], [2.0, 4.2, 0.9], [4.4, 0.8, 1.9], [5.9, 4.1, 1.1]]
)
WINDOWS_MS = [(0, 10), (10, 20), (20, 30), (30, 50), (50, 80), (80, 150)]
BAND = butter(4, [700, 5600], "bandpass", fs=RATE_HZ, output="sos")  # where a room of this size has many modes


def room(absorption, scattering, order, rays):
    walls = pra.Material(energy_absorption=absorption, scattering=scattering or None)
    made = pra.ShoeBox(SIDES_M, fs=RATE_HZ, materials=walls, max_order=order, ray_tracing=rays > 0, air_absorption=False)
    if rays:
        np.random.seed(1)  # the phases of the late part
        made.set_ray_tracing(n_rays=rays, receiver_radius=0.3, hist_bin_size=0.004)
    made.add_source(SOURCE_M)
    for place in RECEIVERS_M:
        made.add_microphone(place)
    return made


def responses(made):
    made.compute_rir()
    return [np.asarray(made.rir[m][0], dtype=float) for m in range(len(RECEIVERS_M))]


def t30_s(response):
    left = np.cumsum(response[::-1] ** 2)[::-1]
    decay_db = 10 * np.log10(left / left[0])
    used = (decay_db < -5) & (decay_db > -35)
    return -60 / np.polyfit(np.arange(len(response))[used] / RATE_HZ, decay_db[used], 1)[0]


def energies():
    images = room(0.3, 0.0, 40, 0)
    exact = responses(images)
    kinds = {
        "images": exact,
        "rays alone": responses(room(0.3, 0.0, -1, 300_000)),
        "images to order 3, then rays": responses(room(0.3, 0.0, 3, 300_000)),
    }
    pulse = np.zeros(4096)
    pulse[2048] = 1
    passed = np.sum(sosfiltfilt(BAND, pulse) ** 2)
    print("| ms after the direct sound | " + " | ".join(f"{kind} (dB)" for kind in kinds) + " |")
    print("|---|" + "---|" * len(kinds))
    for low, high in WINDOWS_MS:
        expected, found = 0.0, {kind: 0.0 for kind in kinds}
        for m, place in enumerate(RECEIVERS_M):
            distances = np.linalg.norm(images.sources[0].images - place[:, None], axis=0)
            after_ms = 1e3 * (distances - distances.min()) / images.c
            within = (after_ms >= low) & (after_ms < high)
            expected += passed * np.sum((images.sources[0].damping[0][within] / distances[within]) ** 2)
            direct = int(np.argmax(np.abs(exact[m])))
            window = slice(direct + low * RATE_HZ // 1000, direct + high * RATE_HZ // 1000)
            for kind, all_responses in kinds.items():
                found[kind] += np.sum(sosfiltfilt(BAND, all_responses[m])[window] ** 2)
        row = [f"{10 * np.log10(energy / expected):.1f}" for energy in found.values()]
        print(f"| {low} to {high} | " + " | ".join(row) + " |")


def scattering():
    x, y, z = SIDES_M
    eyring_s = 0.161 * x * y * z / (-2 * (x * y + x * z + y * z) * np.log(1 - 0.1))
    print(f"\n| scattering | T30 (s) | Eyring: {eyring_s:.2f} s |\n|---|---|---|")
    for coefficient in [0.0, 0.05, 0.1, 0.3, 0.6]:
        mean = np.mean([t30_s(h) for h in responses(room(0.1, coefficient, 3, 60_000))])
        print(f"| {coefficient} | {mean:.2f} | {mean / eyring_s:.2f} |")


energies()
scattering()
