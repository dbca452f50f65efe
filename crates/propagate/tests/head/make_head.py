"""Writes head.sofa, 42 made-up head responses by a library that shares no code with the reader (pip install sofar==1.3.0).

Left ear: one impulse of height 1 + y / 2 after 3 samples; right ear: 1 - y / 2 after 5 samples and a delay of 2 samples more,
y being the sine of the angle to the left. Directions: elevations -60, -30, 0, 30, 60 degrees, eight azimuths each, and both poles.
"""
import numpy as np
import sofar

directions = [(azimuth, elevation) for elevation in (-60, -30, 0, 30, 60) for azimuth in range(0, 360, 45)]
directions += [(0, 90), (0, -90)]
file = sofar.Sofa("SimpleFreeFieldHRIR")
positions = np.array([(azimuth, elevation, 1.5) for azimuth, elevation in directions], dtype=float)
radians = np.radians(positions[:, :2])
y = np.sin(radians[:, 0]) * np.cos(radians[:, 1])
responses = np.zeros((len(directions), 2, 16))
responses[:, 0, 3] = 1 + 0.5 * y
responses[:, 1, 5] = 1 - 0.5 * y
file.Data_IR = responses
file.Data_Delay = np.array([[0.0, 2.0]])
file.Data_SamplingRate = 48000.0
file.SourcePosition = positions
file.ListenerView_Type = "cartesian"
file.GLOBAL_DatabaseName = "made up"
file.GLOBAL_DateCreated = file.GLOBAL_DateModified = "2026-01-01 00:00:00"
file.verify()
sofar.write_sofa("head.sofa", file)
