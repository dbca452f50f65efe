"""Measured rooms for `diagnose` out of published responses that come without a room file.

    python3 -m venv scratch && scratch/bin/pip install numpy scipy
    scratch/bin/python docs/validation/real_rooms/make_rooms.py ../shared/data OUT

Writes OUT/double_slope, OUT/surrey_a, OUT/bbc, OUT/bras_cr2_other_air, OUT/bras_cr2_two and OUT/arni_2, arni_2_again, arni_50. What
their publishers do not say (sizes, where in the room it was) is assumed here, as a user would have to: the comments say which.
"""
import shutil
import sys
from math import cos, radians, sin
from pathlib import Path

import numpy as np
from scipy.io import wavfile

CENTRES = [125, 250, 500, 1000, 2000, 4000, 8000]
FACES = {  # corners of a box by their bits x, y, z
    "walls": [(0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3)],
    "floor": [(0, 2, 3, 1)],
    "ceiling": [(4, 5, 7, 6)],
}
PANELLED = {"panels": FACES["walls"] + FACES["ceiling"], "floor": FACES["floor"]}


def box(folder, size, faces_of):
    lines = [f"v {' '.join(str(size[k] * (i >> k & 1)) for k in range(3))}" for i in range(8)]
    for name, faces in faces_of.items():
        lines.append(f"usemtl {name}")
        lines += ["f " + " ".join(str(i + 1) for i in face) for face in faces]
    (folder / "room.obj").write_text("\n".join(lines) + "\n")


def room(folder, size, air, time_zero, centres, sources, receivers, responses, faces_of=FACES):
    """`responses`: (source, receiver, rate, samples)."""
    (folder / "ir").mkdir(parents=True)
    box(folder, size, faces_of)
    text = ['[room]\nmesh = "room.obj"\n']
    if air:
        text.append(f"[air]\ntemperature_c = {air[0]}\nrelative_humidity_percent = {air[1]}\npressure_kpa = 101.325\n")
    text.append(f'[measurement]\ntime_zero = "{time_zero}"\nlevels = "per_response"\n')
    text.append(f"[bands]\ncentres_hz = {centres}\n")
    for name in faces_of:  # nothing is known of them but that they are surfaces of a furnished room
        n = len(centres)
        text.append(f"[materials.{name}]\nabsorption = {[0.2] * n}\nabsorption_sd = {[0.15] * n}\nscattering = {[0.2] * n}\n")
    for kind, places in (("sources", sources), ("receivers", receivers)):
        for name, place in places.items():
            axis = f"orientation = {place[3:]}\n" if len(place) > 3 else ""
            text.append(f'[[{kind}]]\nid = "{name}"\nposition_m = {place[:3]}\n{axis}')
    for source, receiver, rate, samples in responses:
        name = f"ir/{source}_{receiver}.wav"
        wavfile.write(folder / name, rate, np.asarray(samples, dtype=np.float32))
        text.append(f'[[responses]]\nsource = "{source}"\nreceiver = "{receiver}"\nfile = "{name}"\n')
    (folder / "room.toml").write_text("\n".join(text))


def read(path):
    rate, samples = wavfile.read(path)
    scale = float(np.iinfo(samples.dtype).max) if samples.dtype.kind == "i" else 1.0
    return rate, samples.reshape(len(samples), -1) / scale


def around(head, azimuth, elevation, distance):
    """A loudspeaker that looks at the head; azimuth counts to the left from straight ahead (+y)."""
    a, e = radians(azimuth), radians(elevation)
    out = [-sin(a) * cos(e), cos(a) * cos(e), sin(e)]
    place = [round(h + distance * o, 3) for h, o in zip(head, out)]
    return place + [round(-o, 6) for o in out]


def ears(head):
    return {"left": [round(head[0] - 0.09, 3), *head[1:]], "right": [round(head[0] + 0.09, 3), *head[1:]]}


def main(data, out):
    # DecayFitNet's double slope: two rooms joined by a door, 2 m from it. Neither size nor place is published with it: a box.
    rate, x = read(data / "rir/decayfitnet/doubleslope_RIR_200cm.wav")
    room(out / "double_slope", [6.2, 5.1, 3.1], None, "common", CENTRES, {"s1": [1.7, 1.9, 1.5]},
         {"r1": [4.1, 3.2, 1.5]}, [("s1", "r1", rate, x[:, 0])])

    # Surrey room A: 5.72 x 6.64 x 2.31 m, loudspeaker at 1.5 m (C. Hummersone, PhD thesis, University of Surrey, 2011). The head's
    # place is assumed.
    head = [2.86, 2.6, 1.3]
    sources, responses = {}, []
    for k in range(0, 37, 6):
        name = f"az{5 * k - 90:+d}".replace("+", "p").replace("-", "m")
        sources[name] = around(head, -(5 * k - 90), 0, 1.5)
        rate, x = read(data / f"rir/surrey_roomA/brir_{k:02d}.wav")
        responses += [(name, ear, rate, x[:, i]) for i, ear in enumerate(("left", "right"))]
    room(out / "surrey_a", [5.72, 6.64, 2.31], None, "common", CENTRES[:6], sources, ears(head), responses)

    # BBC listening room: loudspeakers aligned to 2 m, capsules at 1.18 m (C. Pike and M. Romanov, AES 142nd convention, 2017). The room's
    # size is not in the data: that of a room by ITU-R BS.1116 for this array is assumed.
    head = [2.8, 2.9, 1.18]
    sources, responses = {}, []
    for azimuth in (-135, -90, -30, 0, 30, 90, 135):
        name = f"az{azimuth:+04d}".replace("+", "p").replace("-", "m")
        sources[name] = around(head, azimuth, 0, 2.0)
        rate, x = read(data / f"rir/bbc_listening_room/BBCRD_LR_M{azimuth:+04d}.wav")
        responses += [(name, ear, rate, x[:, i]) for i, ear in enumerate(("left", "right"))]
    room(out / "bbc", [5.6, 5.8, 2.9], None, "common", CENTRES, sources, ears(head), responses)

    # BRAS CR2 with the climate that one would guess, not the measured one.
    shutil.copytree(data / "rooms/bras_cr2", out / "bras_cr2_other_air")
    path = out / "bras_cr2_other_air/room.toml"
    text = path.read_text()
    for measured, guessed in (("temperature_c = 19.5", "temperature_c = 20.0"),
                              ("relative_humidity_percent = 41.7", "relative_humidity_percent = 50.0")):
        assert measured in text
        text = text.replace(measured, guessed)
    path.write_text(text)

    # BRAS CR2 with both published responses.
    shutil.copytree(data / "rooms/bras_cr2", out / "bras_cr2_two")
    shutil.copy(data / "rooms_more/bras_cr2_second/LS2_MP2.wav", out / "bras_cr2_two/ir/LS2_MP2.wav")
    with (out / "bras_cr2_two/room.toml").open("a") as file:
        file.write('\n[[responses]]\nsource = "LS2"\nreceiver = "MP2"\nfile = "ir/LS2_MP2.wav"\n')

    # Arni, Aalto: 2 and 50 of 55 panels on walls and ceiling closed, so reflecting. About 8.9 x 6.3 x 3.6 m and 4.37 m from loudspeaker
    # to microphone (rooms_more/arni/SOURCE.md); where in the room they stood is assumed.
    for name, state in (("arni_2", "2_numComb_200_mic_1_sweep_1"), ("arni_2_again", "2_numComb_200_mic_1_sweep_5"),
                        ("arni_50", "50_numComb_5000_mic_1_sweep_1")):
        rate, x = read(data / f"rooms_more/arni/panels/IR_numClosed_{state}.wav")
        room(out / name, [8.9, 6.3, 3.6], None, "common", CENTRES, {"s1": [2.0, 3.0, 1.5]}, {"r1": [6.35, 3.4, 1.3]},
             [("s1", "r1", rate, x[:, 0])], PANELLED)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
