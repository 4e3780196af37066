#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Makes the sample captures docs/examples/beam_*.npz from the original C3D files.

    /usr/bin/python3 scripts/make_beam_sample.py .../beam_gravity_V2_a.c3d …

Reads only what this file needs of C3D: Intel byte order, floating-point points. The numbers are
carried over as they are; of the labels the blanks are dropped ("Tip - 1" becomes "Tip-1").
Source and licence: docs/examples/beam_recordings.txt.
"""
import pathlib
import struct
import sys

import numpy

FOLDER = pathlib.Path(__file__).resolve().parent.parent / "docs/examples"


def parameters(data, block):
    """{(group, name): raw bytes} of the parameter section."""
    start = 512 * (block - 1)
    if data[start + 3] != 84:
        raise SystemExit("not Intel byte order; this script reads only what the beam files are")
    groups, found = {}, {}
    at = start + 4
    while True:
        length, group = struct.unpack_from("bb", data, at)
        if length == 0:
            break
        length = abs(length)
        name = data[at + 2:at + 2 + length].decode("ascii").strip().upper()
        after = at + 2 + length
        (step,) = struct.unpack_from("<h", data, after)
        if group < 0:
            groups[-group] = name
        else:
            size, dimensions = struct.unpack_from("bB", data, after + 2)
            shape = list(data[after + 4:after + 4 + dimensions])
            count = abs(size)
            for extent in shape:
                count *= extent
            raw = data[after + 4 + dimensions:after + 4 + dimensions + count]
            found[group, name] = (size, shape, raw)
        if step == 0:
            break
        at = after + step
    return {(groups[group], name): value for (group, name), value in found.items()}


def convert(path):
    output = FOLDER / (path.stem + ".npz")
    data = path.read_bytes()
    block, magic, points, analogue, first, last, _, scale, start, _, rate = struct.unpack_from(
        "<BBHHHHHfHHf", data, 0)
    if magic != 0x50 or scale >= 0 or analogue != 0:
        raise SystemExit("not a C3D file with floating-point points and no analogue samples")
    frames = last - first + 1
    raw = numpy.frombuffer(data, "<f4", frames * points * 4, 512 * (start - 1))
    raw = raw.reshape(frames, points, 4)
    if (raw[:, :, 3] < 0).any():
        raise SystemExit("some samples are missing; this script has no rule for them")
    found = parameters(data, block)
    if found["POINT", "UNITS"][2].strip() != b"m":
        raise SystemExit("the unit is not metres")
    _, (width, count), text = found["POINT", "LABELS"]
    labels = [text[width * i:width * (i + 1)].decode("ascii").replace(" ", "")
              for i in range(count)][:points]
    numpy.savez_compressed(
        output,
        positions=numpy.ascontiguousarray(raw[:, :, :3]),
        times=numpy.arange(frames) / float(rate),
        labels=numpy.array(labels))
    print(f"{output}: {frames} frames, {points} points at {rate:g} Hz: {', '.join(labels)}")


def main():
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    for path in sys.argv[1:]:
        convert(pathlib.Path(path))


if __name__ == "__main__":
    main()
