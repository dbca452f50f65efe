"""Makes the seeds: small files of each kind that the readers take, for fuzzing to start from.

    python3 make.py            # in this folder; a room file and the pretrained weights come from the repository
"""

import json
import shutil
import struct
from pathlib import Path

HERE = Path(__file__).parent
REPOSITORY = HERE.parents[3]


def write(name, data):
    path = HERE / name
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(data)


def wav(kind, channels, rate, bits, data, extensible=False):
    frame = channels * bits // 8
    fmt = struct.pack("<HHIIHH", 0xFFFE if extensible else kind, channels, rate, rate * frame, frame, bits)
    if extensible:
        fmt += struct.pack("<HHI", 22, bits, 0) + struct.pack("<H", kind) + bytes.fromhex("000000001000800000aa00389b71")
    body = b"WAVE" + b"fmt " + struct.pack("<I", len(fmt)) + fmt + b"data" + struct.pack("<I", len(data)) + data
    return b"RIFF" + struct.pack("<I", len(body)) + body


def gltf(buffer):
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": [1, 2, 3], "scale": [1, 1, 2], "children": [1]}, {"rotation": [0, 0, 0, 1]}],
        "materials": [{"name": "cloth"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0, "mode": 4}]}],
        "buffers": [buffer],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 24},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [4, 4, 4]},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
    }


def main():
    write("wav/int16.wav", wav(1, 1, 8000, 16, bytes(range(64))))
    write("wav/int8_stereo.wav", wav(1, 2, 44100, 8, bytes(range(40))))
    write("wav/int24.wav", wav(1, 1, 48000, 24, bytes(range(60)), extensible=True))
    write("wav/float32.wav", wav(3, 1, 16000, 32, struct.pack("<16f", *[i / 16 for i in range(16)])))
    write("obj/tent.obj", b"# tent\nv 0 0 0\nv 4 0 0\nv 0 4 0\nv 0 0 4\nusemtl ground\nf 1 3 2\nusemtl cloth\nf 1/1 2/2 4/3\nf -3 -2 -1\nf 3//1 1//1 4//1\n")
    write("obj/concave.obj", b"v 0 0 0\nv 2 0 0\nv 2 2 0\nv 1 0.5 0\nv 0 2 0\no x\ng y\nf 1 2 \\\n 3 4 5\n")
    points = struct.pack("<12f", 0, 0, 0, 4, 0, 0, 0, 4, 0, 0, 0, 4) + struct.pack("<12H", 0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3)
    import base64

    uri = "data:application/octet-stream;base64," + base64.b64encode(points).decode()
    write("gltf/tent.gltf", json.dumps(gltf({"byteLength": len(points), "uri": uri})).encode())
    text = json.dumps(gltf({"byteLength": len(points)})).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(points), 0x004E4942) + points
    write("gltf/tent.glb", b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)
    write(
        "room_toml/tent.toml",
        b"""[room]
mesh = "room.obj"
[air]
temperature_c = 20.0
relative_humidity_percent = 50
pressure_kpa = 101.325
[measurement]
time_zero = "emission"
levels = "absolute"
[bands]
centres_hz = [125, 250.0, 500]
[materials.ground]
absorption = [0.1, 0.2, 0.3]
absorption_sd = [0.1, 0.1, 0.1]
scattering = [0.1, 0.2, 0.3]
[materials.cloth]
[[sources]]
id = "s"
position_m = [0.5, 0.5, 0.5]
orientation = [1.0, 0.0, 0.0]
[[receivers]]
id = "r"
position_m = [0.7, 0.5, 0.5]
[[responses]]
source = "s"
receiver = "r"
file = "response.wav"
temperature_c = 21.5
session = "one"
""",
    )
    shutil.copy(REPOSITORY / "fixtures/room/room.toml", HERE / "room_toml/fixture.toml")
    (HERE / "sofa").mkdir(exist_ok=True)
    shutil.copy(REPOSITORY / "crates/scene/tests/sofa/pairs_plain.sofa", HERE / "sofa/pairs_plain.sofa")
    columns = b"file,source_x_m,source_y_m,source_z_m,receiver,receiver_x_m,receiver_y_m,receiver_z_m\n"
    write("tables/positions.csv", columns + b"a.wav,1,2,1.5,seat,3,2,1.2\n")
    rew = b"* Impulse Response data saved by REW V5.31\n3 // Response length\n2,083333E-5 // Sample interval (seconds)\n* Data start\n0\n1\n0,5\n"
    write("tables/rew.txt", rew)
    write("tables/room.geo", b"ABS floor = <1 2 3 4 5 6 : 7 8> L <10 11 12 13 14 15 : 16 17> {255 0 10}\nABS1 w = <.1 .2 .3 .4 .5 1>\n")
    # The header of the pretrained weights with the first kilobytes of its arrays: the whole file slows mutation down, and is
    # given to the fuzzer by name instead.
    weights = (REPOSITORY / "crates/estimator/weights/room.safetensors").read_bytes()
    (length,) = struct.unpack("<Q", weights[:8])
    write("weights/header.safetensors", weights[: 8 + length + 1024])


if __name__ == "__main__":
    main()
