"""Writes files of weights whose headers cannot be right: each field in turn zero, negative, huge, empty or of another type; impossible
shapes and lengths.

    python3 hostile_weights.py FOLDER      # then: cargo +nightly fuzz run --fuzz-dir .. weights FOLDER -- -runs=0
"""

import json
import struct
import sys
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[4]
VALUES = [0, 1, 2, 3, -1, 127, 1000, 65536, 10**6, 10**9, 2**53, 2**63 - 1, 2**64 - 1, 1e300, -1e300, 1e-320, 0.5]
VALUES += [None, "x", True, [], {}]
SHAPES = [[0], [10**9, 10**9], [2**63], [2**32, 2**32, 2**32], [1] * 40]
LENGTHS = [0, 1, 2**31, 2**40, 2**63, 2**64 - 1]


def fields(value, path=()):
    """Paths to everything that is neither a table nor a list."""
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if items is None:
        yield path
        return
    for key, inner in items:
        yield from fields(inner, path + (key,))


def changed(value, path, new):
    value = json.loads(json.dumps(value))
    place = value
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = new
    return value


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    weights = (REPOSITORY / "crates/estimator/weights/room.safetensors").read_bytes()
    (length,) = struct.unpack("<Q", weights[:8])
    header, arrays = json.loads(weights[8 : 8 + length]), weights[8 + length :]
    own = json.loads(header["__metadata__"]["sabine"])
    headers = [
        changed(header, ("__metadata__", "sabine"), json.dumps(changed(own, path, value)))
        for path in fields(own)
        for value in VALUES
    ]
    tensors = [name for name in list(header)[:8] if name != "__metadata__"]
    headers += [changed(header, (name, "shape"), shape) for name in tensors for shape in SHAPES]
    files = []
    for text in (json.dumps(h).encode() for h in headers):
        files.append(struct.pack("<Q", len(text)) + text + arrays)
    files += [struct.pack("<Q", claim) + weights[8:] for claim in LENGTHS]
    for number, content in enumerate(files):
        (folder / f"{number:05}.safetensors").write_bytes(content)
    print(len(files))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
