"""Draws what `cargo run -p sabine-with-bevy` leaves: docs/img/bevy_walls.png.

    cargo run -p sabine-with-bevy
    scratch/bin/python examples/integrations/bevy/draw_heard.py out/with_bevy/heard.wav docs/img/bevy_walls.png   # numpy, scipy, matplotlib
"""
import sys

import matplotlib
import numpy as np
from scipy.io import wavfile

matplotlib.use("Agg")
import matplotlib.pyplot as plt

WINDOW_S = 0.02
WALLS = [(0, "brick all around"), (4, "carpet on the floor"), (8, "and plaster and a curtain")]


def main(heard, picture):
    rate_hz, samples = wavfile.read(heard)
    left = samples[:, 0].astype(float)
    window = round(WINDOW_S * rate_hz)
    energy = (left[: len(left) // window * window].reshape(-1, window) ** 2).mean(axis=1)
    level_db = 10 * np.log10(np.maximum(energy, 1e-12) / energy.max())
    figure, axis = plt.subplots(figsize=(8, 3), dpi=110)
    axis.plot(WINDOW_S * np.arange(len(level_db)), level_db, color="#2b5f8a", linewidth=1.2)
    for begin_s, text in WALLS:
        axis.axvline(begin_s, color="#b8860b", linewidth=1)
        axis.text(begin_s + 0.1, 2, text, color="#7a5a08", fontsize=10)
    axis.set(xlim=(0, 12), ylim=(-40, 8), xlabel="time (s)", ylabel="level at the left ear (dB)")
    axis.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(picture)


if __name__ == "__main__":
    main(*sys.argv[1:3])
