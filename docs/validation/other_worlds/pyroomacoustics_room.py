"""One measured room simulated by pyroomacoustics, in the on-disk form of docs/measured-room.md, with truth.json beside room.toml.

What is simulated shares no code and no random numbers with this project: image sources of positive sign (Allen and Berkley), or
image sources of low order joined to ray tracing. The room file states what a careful user knows: the mesh, tables that are off by
their stated deviation, places that are off by theirs. An effect is planted by simulating another room than the file describes.
"""

import argparse
import json
import pathlib

import numpy as np
import pyroomacoustics as pra
import soundfile

CENTRES_HZ = [125, 250, 500, 1000, 2000, 4000]
RATE_HZ = 16000
TABLE_SD = 0.03  # how far tables are off, and how far the file says that they may be
PLACE_SD_M = 0.01
GAIN_SD_DB = 0.3  # of each microphone
LENGTH = 1.6  # of responses, in reverberation times of the slowest octave (Eyring): boxes of smooth walls decay more slowly than that
NOISE_DB = -63.0  # energy of the recorder's white noise over a response, relative to the mean energy of the responses
MARGIN_M = 0.6  # places to walls
APART_M = 0.8
MAX_IMAGE_ORDER = 130  # 3 million images
MATERIALS = {
    "west": "brick",
    "east": "plaster",
    "south": "brick",
    "north": "plaster",
    "inner_east": "plaster",  # of an L: where the corner that is cut out begins
    "inner_north": "plaster",
    "floor": "carpet",
    "ceiling": "board",
}
SHAPES = {"brick": [0, 0, 0, 0, 0, 0], "plaster": [3, 1, 0, -1, -1, 0], "carpet": [-4, -2, 0, 2, 3, 4], "board": [2, 1, 0, 0, 1, 1]}
EFFECTS = ["null", "position", "surface", "temperature", "latency", "gain", "wall", "warming", "swell", "agc", "tables"]
WARMING_DB = 6.0  # by which a loudspeaker that has warmed up is quieter, in the end
SWELL_DB = 3.0  # by which a gain that swells and sinks goes up and down
AGC_DB = 9.0  # by which an automatic gain control that a loud first sound has turned down comes up again
TABLE_FACTOR_SD = 0.35  # of the logarithm of the factor by which each table is off with --effect tables
BEFORE_M = 0.35  # a displaced wall stays this far from all places


class Prism:
    """A floor polygon with sides along x and y, counter-clockwise, and a height."""

    def __init__(self, polygon, names, low, high):
        self.polygon, self.names, self.low, self.high = np.array(polygon, dtype=float), names, low, high

    @staticmethod
    def of(sides, cut):
        """A box, or an L: a box whose corner of the greatest x and y is cut out, at these two shares of its sides."""
        x, y, z = sides
        if cut is None:
            return Prism([[0, 0], [x, 0], [x, y], [0, y]], ["south", "east", "north", "west"], 0.0, z)
        at_x, at_y = cut[0] * x, cut[1] * y
        names = ["south", "east", "inner_north", "inner_east", "north", "west"]
        return Prism([[0, 0], [x, 0], [x, at_y], [at_x, at_y], [at_x, y], [0, y]], names, 0.0, z)

    def is_box(self):
        return len(self.polygon) == 4

    def edges(self):
        return list(zip(self.names, self.polygon, np.roll(self.polygon, -1, axis=0)))

    def faces(self):
        """Of each face: name, outward normal, area."""
        height = self.high - self.low
        found = []
        for name, one, other in self.edges():
            along = other - one
            length = np.linalg.norm(along)
            found.append((name, np.array([along[1], -along[0], 0.0]) / length, length * height))
        x, y = self.polygon.T
        area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
        return found + [("floor", np.array([0, 0, -1.0]), area), ("ceiling", np.array([0, 0, 1.0]), area)]

    def volume(self):
        return self.faces()[-1][2] * (self.high - self.low)

    def moved(self, face, offset):
        """The same with a face farther out."""
        found = Prism(self.polygon.copy(), self.names, self.low, self.high)
        if face == "floor":
            found.low -= offset
        elif face == "ceiling":
            found.high += offset
        else:
            index = self.names.index(face)
            normal = dict((name, normal) for name, normal, _ in self.faces())[face][:2]
            for corner in (index, (index + 1) % len(self.polygon)):
                found.polygon[corner] += offset * normal
        return found

    def clearance(self, place):
        """Distance of a place from the nearest wall; negative outside."""
        inside = False
        nearest = min(place[2] - self.low, self.high - place[2])
        for _, one, other in self.edges():
            along = other - one
            share = np.clip(np.dot(place[:2] - one, along) / np.dot(along, along), 0, 1)
            nearest = min(nearest, float(np.linalg.norm(place[:2] - one - share * along)))
            if (one[1] > place[1]) != (other[1] > place[1]):
                crossing = one[0] + (place[1] - one[1]) / (other[1] - one[1]) * along[0]
                inside ^= bool(crossing > place[0])
        return nearest if inside else -abs(nearest)


def draw(random, receivers, with_cut, uneven):
    """A room: its shape, tables, places, climate."""
    sides = [random.uniform(4.0, 7.5), random.uniform(3.5, 6.0), random.uniform(2.4, 3.3)]
    level = {name: random.uniform(0.15, 0.4) for name in SHAPES}
    absorption = {
        name: np.clip(level[name] * 10 ** (uneven * (0.05 * np.array(SHAPES[name]) + random.normal(0, 0.06, 6))), 0.03, 0.7)
        for name in SHAPES
    }
    if with_cut:
        sides[:2] = [random.uniform(6.0, 9.0), random.uniform(5.0, 8.0)]
    prism = Prism.of(sides, random.uniform(0.4, 0.65, 2) if with_cut else None)
    places = []
    while len(places) < receivers + 1:
        place = np.array([random.uniform(MARGIN_M, side - MARGIN_M) for side in sides])
        if prism.clearance(place) >= 0.99 * MARGIN_M and all(np.linalg.norm(place - other) > APART_M for other in places):
            places.append(place)
    climate = {"temperature_c": random.uniform(16, 26), "relative_humidity_percent": random.uniform(30, 65)}
    return prism, absorption, places, climate


def planted(effect, random, prism, absorption, places, climate):
    """What is true in place of what the file will say, and what of it is hidden."""
    absorption = {name: table.copy() for name, table in absorption.items()}
    places = [place.copy() for place in places]
    climate = dict(climate)
    recorder = {"latency_s": 0.0, "gain_db": np.zeros(len(places) - 1)}
    hidden = {}
    if effect == "position":
        index = int(random.integers(1, len(places)))
        direction = random.normal(size=3)
        offset = 0.15 * direction / np.linalg.norm(direction)
        places[index] = places[index] + offset
        hidden = {"receiver": f"r{index}", "offset_m": offset.tolist()}
    elif effect == "surface":
        name = str(random.choice(["carpet", "board"]))
        absorption[name] = np.clip(absorption[name] + 0.3, 0.0, 0.95)
        hidden = {"material": name, "added": 0.3}
    elif effect == "temperature":
        climate["temperature_c"] -= 9.0
        hidden = {"true_c": climate["temperature_c"]}
    elif effect == "latency":
        recorder["latency_s"] = 0.003
        hidden = {"latency_ms": 3.0}
    elif effect == "gain":
        index = int(random.integers(1, len(places)))
        recorder["gain_db"][index - 1] = 5.0
        hidden = {"receiver": f"r{index}", "gain_db": 5.0}
    elif effect == "wall":
        stated = prism
        while prism is stated or any(prism.clearance(place) < BEFORE_M for place in places):
            face, normal, _ = stated.faces()[int(random.integers(len(stated.faces())))]
            offset = float(random.uniform(0.2, 0.45) * random.choice([-1, 1]))
            prism = stated.moved(face, offset)
        hidden = {"face": face, "outward_normal": normal.tolist(), "offset_m": offset}
    return prism, absorption, places, climate, recorder, hidden


def order_of_recordings(seed, receivers):
    """When each receiver was recorded, from 1 on: random numbers of its own, so that the room of a seed stays the same."""
    return 1 + np.random.default_rng([seed, 1]).permutation(receivers)


def warming_db(order):
    """Level of each recording, the first being 0: power compression, the voice coil warming exponentially (Button, JAES 40, 1992)."""
    warmed = 1 - np.exp(-(order - 1) / (0.4 * len(order)))
    return -20 * np.log10(1 + (10 ** (WARMING_DB / 20) - 1) * warmed)


def gain_course(effect, seed):
    """What the recorder's gain does over the file, in dB at times in s; None if it stays. Drawn apart: rooms stay what they were."""
    random = np.random.default_rng([seed, 2])
    if effect == "swell":
        period_s, phase = random.uniform(0.2, 0.5), random.uniform(0, 2 * np.pi)
        course = lambda t: SWELL_DB * np.sin(2 * np.pi * t / period_s + phase)
        return course, {"swell_db": SWELL_DB, "period_s": period_s, "phase_rad": phase}
    if effect == "agc":
        release_s = random.uniform(0.1, 0.3)
        return lambda t: -AGC_DB * np.exp(-t / release_s), {"agc_db": AGC_DB, "release_s": release_s}
    return None, {}


def stated_tables(absorption, random, seed, effect, together):
    """What the file says of absorption. Factors are drawn apart: rooms stay what they were."""
    one = (lambda: np.full(6, random.normal(0, TABLE_SD))) if together else (lambda: random.normal(0, TABLE_SD, 6))
    off = {name: one() for name in absorption}
    factors = {name: 1.0 for name in absorption}
    if effect == "tables":
        apart = np.random.default_rng([seed, 3])
        factors = {name: float(np.exp(apart.normal(0, TABLE_FACTOR_SD))) for name in absorption}
    stated = {name: np.clip(factors[name] * table + off[name], 0.01, 0.95) for name, table in absorption.items()}
    return stated, {"table_over_truth": factors} if effect == "tables" else {}


def eyring_s(prism, absorption):
    """Longest reverberation time of the octaves, without air."""
    total = sum(area for _, _, area in prism.faces())
    mean = sum(area * absorption[MATERIALS[face]] for face, _, area in prism.faces()) / total
    return float(np.max(0.161 * prism.volume() / (-total * np.log(1 - mean))))


def simulate(method, prism, absorption, places, climate, rays, scattering, seed):
    """Responses of all receivers, sample 0 at the emission."""
    table = lambda name: {"coeffs": absorption[name].tolist(), "center_freqs": CENTRES_HZ}
    traced = method == "rays"
    scatters = {"coeffs": [scattering] * 6, "center_freqs": CENTRES_HZ} if scattering else None
    walls = {face: pra.Material(table(MATERIALS[face]), scatters) for face, _, _ in prism.faces()}
    length_s = LENGTH * eyring_s(prism, absorption)
    # Its own formula for the speed of sound, 331.4 + 0.6 T + 0.0124 H, is up to 1 m/s above that of dry air: nobody planted that.
    speed = 331.3 * np.sqrt(1 + climate["temperature_c"] / 273.15)
    # Every image that is heard in time, or what takes the place of rays early on.
    corner = np.array([*prism.polygon.min(axis=0), prism.low])
    sides = np.array([*prism.polygon.max(axis=0), prism.high]) - corner
    order = 3 if traced else int(np.ceil(length_s * speed / min(sides)))
    if order > MAX_IMAGE_ORDER:
        raise SystemExit(f"images of order {order} would be needed: take another seed")
    settings = dict(
        fs=RATE_HZ,
        max_order=order,
        temperature=climate["temperature_c"],
        humidity=climate["relative_humidity_percent"],
        air_absorption=True,
        ray_tracing=traced,
    )
    if prism.is_box():
        room = pra.ShoeBox(sides, materials=walls, **settings)
    else:
        own = [walls[name] for name in prism.names]
        room = pra.Room.from_corners((prism.polygon - corner[:2]).T, materials=own, **settings)
        room.extrude(sides[2], materials={"floor": walls["floor"], "ceiling": walls["ceiling"]})
    room.set_sound_speed(speed)
    if traced:
        np.random.seed(seed)  # the phases of its late part
        room.set_ray_tracing(n_rays=rays, receiver_radius=0.3, hist_bin_size=0.004, time_thres=length_s)
    room.add_source(places[0] - corner)
    room.add_microphone_array((np.array(places[1:]) - corner).T)
    room.compute_rir()
    # Its fractional delays are filters of this length: what comes before sample 0 of the emission is theirs.
    lead = pra.constants.get("frac_delay_length") // 2
    samples = int(length_s * RATE_HZ)
    responses = [np.asarray(room.rir[m][0], dtype=float)[lead : lead + samples] for m in range(len(places) - 1)]
    return responses, order, speed


def recorded(responses, recorder, random):
    """What the recorder makes of them."""
    late = int(round(recorder["latency_s"] * RATE_HZ))
    gains = 10 ** ((recorder["gain_db"] + random.normal(0, GAIN_SD_DB, len(responses))) / 20)
    kept = [gain * np.concatenate([np.zeros(late), response]) for gain, response in zip(gains, responses)]
    if recorder.get("course"):
        kept = [response * 10 ** (recorder["course"](np.arange(len(response)) / RATE_HZ) / 20) for response in kept]
    power = np.mean([np.mean(response**2) for response in kept])
    noise = 10 ** (NOISE_DB / 20) * np.sqrt(power)
    return [response + noise * random.normal(size=len(response)) for response in kept]


def mesh(prism):
    """As OBJ; floor and ceiling of an L as two convex faces each."""
    count = len(prism.polygon)
    lines = [f"v {x:.6f} {y:.6f} {z:.6f}" for z in (prism.low, prism.high) for x, y in prism.polygon]
    faces = {"floor": [[1, 4, 3, 2]] if count == 4 else [[1, 6, 5, 4], [1, 4, 3, 2]]}
    faces["ceiling"] = [[corner + count for corner in reversed(face)] for face in faces["floor"]]
    for i, name in enumerate(prism.names):
        after = (i + 1) % count
        faces[name] = [[i + 1, after + 1, after + 1 + count, i + 1 + count]]
    for name, own in faces.items():
        lines.append(f"usemtl {MATERIALS[name]}")
        lines += ["f " + " ".join(map(str, face)) for face in own]
    return "\n".join(lines) + "\n"


def room_file(absorption, places, climate, scattering, order):
    """What a careful user would write."""
    numbers = lambda values: "[" + ", ".join(f"{value:.4f}" for value in values) + "]"
    lines = ['[room]\nmesh = "room.obj"\n', "[air]"]
    lines += [f"{key} = {value:.2f}" for key, value in climate.items()] + ["pressure_kpa = 101.325\n"]
    lines += ['[measurement]\ntime_zero = "emission"\nlevels = "common"', f"position_sd_m = {PLACE_SD_M}\n"]
    lines += [f"[bands]\ncentres_hz = {CENTRES_HZ}\n"]
    for name, table in absorption.items():
        lines += [f"[materials.{name}]", f"absorption = {numbers(table)}"]
        lines += [f"absorption_sd = {numbers([TABLE_SD] * 6)}", f"scattering = {numbers([scattering] * 6)}\n"]
    lines += [f'[[sources]]\nid = "s1"\nposition_m = {numbers(places[0])}\n']
    for i, place in enumerate(places[1:], 1):
        lines += [f'[[receivers]]\nid = "r{i}"\nposition_m = {numbers(place)}\n']
    for i in range(1, len(places)):
        lines += [f'[[responses]]\nsource = "s1"\nreceiver = "r{i}"\nfile = "ir/s1_r{i}.wav"']
        lines += [f"recorded_at = {order[i - 1]}\n"] if order is not None else [""]
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--method", choices=["images", "rays"], required=True)
    parser.add_argument("--effect", choices=EFFECTS, default="null")
    parser.add_argument("--shape", choices=["box", "l"], default="box", help="l needs --method rays")
    parser.add_argument("--receivers", type=int, default=8)
    parser.add_argument("--order", action="store_true", help="the file says in which order was recorded, as it does with --effect warming")
    parser.add_argument("--uneven", type=float, default=1.0, help="how much absorption differs from octave to octave; 0 for the same in all")
    parser.add_argument("--together", action="store_true", help="tables are off by the same in all octaves, as far as is stated")
    parser.add_argument("--rays", type=int, default=100_000, help="of pyroomacoustics")
    parser.add_argument(
        "--scattering",
        type=float,
        default=0.0,
        help="of all walls, with --method rays, stated as it is: this program means something else by it (README)",
    )
    parser.add_argument("--out", type=pathlib.Path, required=True)
    arguments = parser.parse_args()
    if arguments.scattering and arguments.method != "rays":
        parser.error("--scattering needs --method rays")
    if arguments.shape == "l" and arguments.method != "rays":
        parser.error("--shape l needs --method rays: images of every order are those of a box")

    random = np.random.default_rng(arguments.seed)
    prism, absorption, places, climate = draw(random, arguments.receivers, arguments.shape == "l", arguments.uneven)
    true = planted(arguments.effect, random, prism, absorption, places, climate)
    true_prism, true_absorption, true_places, true_climate, recorder, hidden = true
    order = None
    if arguments.order or arguments.effect == "warming":
        order = order_of_recordings(arguments.seed, arguments.receivers)
    if arguments.effect == "warming":
        recorder["gain_db"] = recorder["gain_db"] + warming_db(order)
        hidden = {"warming_db": WARMING_DB, "recorded_at": order.tolist()}
    course, of_course = gain_course(arguments.effect, arguments.seed)
    recorder, hidden = {**recorder, "course": course}, {**hidden, **of_course}
    # Nobody knows tables and places exactly: the file is off, the truth is what was drawn.
    stated, of_tables = stated_tables(absorption, random, arguments.seed, arguments.effect, arguments.together)
    hidden = {**hidden, **of_tables}
    stated_places = [place + random.normal(0, PLACE_SD_M, 3) for place in places]
    responses, image_order, speed = simulate(
        arguments.method,
        true_prism,
        true_absorption,
        true_places,
        true_climate,
        arguments.rays,
        arguments.scattering,
        arguments.seed,
    )
    responses = recorded(responses, recorder, random)

    (arguments.out / "ir").mkdir(parents=True)
    for i, response in enumerate(responses, 1):
        soundfile.write(arguments.out / "ir" / f"s1_r{i}.wav", response.astype(np.float32), RATE_HZ, subtype="FLOAT")
    (arguments.out / "room.obj").write_text(mesh(prism))
    (arguments.out / "room.toml").write_text(room_file(stated, stated_places, climate, arguments.scattering, order))
    truth = {
        "program": f"pyroomacoustics {pra.__version__}",
        "method": arguments.method,
        "effect": arguments.effect,
        "hidden": hidden,
        "seed": arguments.seed,
        "image_order": image_order,
        "speed_of_sound_m_s": speed,
        "rays": arguments.rays if arguments.method == "rays" else 0,
        "floor_m": true_prism.polygon.tolist(),
        "heights_m": [true_prism.low, true_prism.high],
        "absorption": {name: table.tolist() for name, table in true_absorption.items()},
        "source_m": true_places[0].tolist(),
        "receivers_m": [place.tolist() for place in true_places[1:]],
        "climate": true_climate,
    }
    (arguments.out / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
