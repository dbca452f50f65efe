#!/usr/bin/env python3
"""Makes the files of this folder: made-up responses (CC0) as other programs write them.

    python3 make.py     # Python 3.11, sofar 1.3.0, netCDF4 1.7.2, h5py, numpy

Every sample is a fraction of small powers of two, so that 32-bit floats hold it: the tests of `sofa_files` compute the same.
"""

import os
from pathlib import Path

import h5py
import numpy as np
import sofar

HERE = Path(__file__).parent
RATE = 8000
STAMP = "2026-11-24 12:00:00"


def response(m, r, e, length, onset):
    """Silence, then a decay by 6 dB every 50 samples."""
    n = np.arange(length)
    since = n - onset
    value = ((7 * n + 3 * m + 5 * r + 11 * e) % 17 - 8) / 16.0 * 0.5 ** np.floor(np.maximum(since, 0) / 50)
    value[since == 0] = 1.0
    value[since < 0] = 0.0
    return value


def write(name, sofa, compression):
    sofa.GLOBAL_License = "CC0-1.0"
    sofa.GLOBAL_Title = "made up"
    sofa.protected = False
    sofa.GLOBAL_DateCreated = sofa.GLOBAL_DateModified = STAMP
    sofa.ReceiverDescriptions = np.array([[f"receiver {k}"] for k in range(sofa.Data_IR.shape[1])])
    sofa.EmitterDescriptions = np.array([[f"emitter {k}"] for k in range(sofa.Data_IR.shape[3] if sofa.Data_IR.ndim == 4 else 1)])
    sofa.verify()
    sofar.write_sofa(HERE / name, sofa, compression=compression)


def pairs():
    """Two loudspeakers, two microphones, one of which is measured twice: with its head turned."""
    sofa = sofar.Sofa("SingleRoomSRIR")
    length = 600
    sofa.Data_IR = np.stack([[response(m, 0, 0, length, 40 + 10 * m)] for m in range(4)])
    sofa.Data_SamplingRate = float(RATE)
    sofa.Data_Delay = np.array([[0.0], [3.0], [0.0], [0.0]])
    sofa.SourcePosition = np.array([[1, 2, 1.5], [1, 2, 1.5], [4.25, 1, 1.5], [4.25, 1, 1.5]])
    sofa.SourceView = np.array([[1, 0, 0], [1, 0, 0], [-1, 0, 0], [-1, 0, 0]])
    sofa.SourceUp = np.tile([0, 0, 1], (4, 1))
    sofa.ListenerPosition = np.array([[3, 3, 1.25], [2, 3.5, 1.25], [3, 3, 1.25], [3, 3, 1.25]])
    sofa.ListenerView = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0]])
    sofa.ListenerUp = np.tile([0, 0, 1], (4, 1))
    # Half a metre to the left of where the listener looks.
    sofa.ReceiverPosition = np.array([[90.0, 0.0, 0.5]])
    sofa.RoomTemperature = np.array([294.15, 294.15, 295.15, 295.15])
    sofa.MeasurementDate = np.zeros(4)
    sofa.RoomCornerA, sofa.RoomCornerB = np.array([[0, 0, 0]]), np.array([[6, 5, 3]])
    return sofa


def grid():
    """Three loudspeakers, two microphones, one measurement."""
    sofa = sofar.Sofa("SingleRoomMIMOSRIR")
    length, r, e = 400, 2, 3
    ir = np.zeros((1, r, length, e))
    for i in range(r):
        for k in range(e):
            ir[0, i, :, k] = response(0, i, k, length, 30)
    sofa.Data_IR = ir
    sofa.Data_SamplingRate = float(RATE)
    sofa.Data_Delay = np.zeros((1, r, 1))
    sofa.ListenerPosition, sofa.SourcePosition = np.array([[1, 1, 1]]), np.array([[0, 0, 0]])
    sofa.ReceiverPosition = np.array([[0, 1, 0.5], [2, 1, 0.5]]).reshape(r, 3, 1)
    sofa.ReceiverPosition_Type, sofa.ReceiverPosition_Units = "cartesian", "metre"
    sofa.EmitterPosition = np.array([[4, 1, 1], [4, 2, 1], [4, 3, 1]]).reshape(e, 3, 1)
    sofa.EmitterPosition_Type, sofa.EmitterPosition_Units = "cartesian", "metre"
    for part, count in (("Receiver", r), ("Emitter", e)):
        setattr(sofa, part + "View", np.tile(np.array([1, 0, 0]).reshape(1, 3, 1), (count, 1, 1)))
        setattr(sofa, part + "Up", np.tile(np.array([0, 0, 1]).reshape(1, 3, 1), (count, 1, 1)))
    sofa.MeasurementDate = np.zeros(1)
    return sofa


def old(source, name):
    """The same in the oldest form of HDF5 (superblock 0, symbol tables, B-trees of version 1), as MATLAB writes it."""
    with h5py.File(HERE / source) as new, h5py.File(HERE / name, "w", libver=("earliest", "v108")) as file:
        for key, value in new.attrs.items():
            file.attrs[key] = np.bytes_(value) if not isinstance(value, h5py.Empty) else np.bytes_("")
        for key in new:
            if new[key].dtype.kind != "f" or len(key) == 1:
                continue
            chunks = tuple(max(1, (n + 1) // 2) for n in new[key].shape)
            made = file.create_dataset(key, data=new[key][...], chunks=chunks, compression="gzip", shuffle=True, track_times=False)
            for name in ("Type", "Units"):
                if name in new[key].attrs:
                    made.attrs[name] = new[key].attrs[name]


def head():
    sofa = sofar.Sofa("SimpleFreeFieldHRIR")
    sofa.Data_IR = np.zeros((1, 2, 16))
    sofa.Data_IR[..., 0] = 1.0
    sofa.GLOBAL_License = "CC0-1.0"
    sofa.GLOBAL_DateCreated = sofa.GLOBAL_DateModified = STAMP
    sofar.write_sofa(HERE / "head.sofa", sofa)


write("pairs.sofa", pairs(), 4)
write("pairs_plain.sofa", pairs(), 0)
write("grid.sofa", grid(), 4)
old("pairs.sofa", "pairs_old.sofa")
head()
for file in sorted(HERE.glob("*.sofa")):
    print(file.name, os.path.getsize(file))
