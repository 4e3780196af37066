# SPDX-License-Identifier: GPL-3.0-or-later
"""Writes docs/examples/dam_break_front.npz: how far a collapsing column of water reached.

    make_dam_sample.py

J. C. Martin, W. J. Moyce: An Experimental Study of the Collapse of Liquid Columns on a Rigid Horizontal
Plane. Phil. Trans. R. Soc. A 244, 1952: a square-law column n² = 2 of width a = 57.15 mm, T = t √(2g/a) and
Z = front/a.
"""

import numpy as np
from parts import ROOT

WIDTH = 0.05715
GRAVITY = 9.81
MEASURED = [(0.0, 1.0), (0.832, 1.217), (1.219, 1.474), (1.997, 2.292), (2.547, 2.995), (3.345, 4.134),
            (4.034, 4.944), (4.418, 5.881)]

if __name__ == "__main__":
    times = np.array([t * np.sqrt(WIDTH / (2.0 * GRAVITY)) for t, _ in MEASURED])
    front = np.array([[[z * WIDTH, 0.0, 0.0]] for _, z in MEASURED])
    np.savez(ROOT / "docs" / "examples" / "dam_break_front.npz", positions=front, times=times)
