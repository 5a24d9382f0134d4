#!/usr/bin/env python3
"""Reads a run's event files with TensorBoard's own reader and compares every number with metrics.csv.

    pip install tensorboard
    python3 python/check_tensorboard.py runs/RUN
"""

import csv
import pathlib
import struct
import sys

from tensorboard.backend.event_processing.event_file_loader import EventFileLoader
from tensorboard.util import tensor_util


def single(x):
    """As TensorBoard keeps it: 32 bits."""
    return struct.unpack("f", struct.pack("f", x))[0]


def main():
    run = pathlib.Path(sys.argv[1])
    found = {}
    files = sorted((run / "tb").glob("events.out.tfevents.*"))
    for file in files:
        for event in EventFileLoader(str(file)).Load():
            for value in event.summary.value:
                found[(event.step, value.tag)] = float(tensor_util.make_ndarray(value.tensor))
    compared = wrong = 0
    with open(run / "metrics.csv", newline="") as table:
        for row in csv.DictReader(table):
            step = int(float(row["time/total_timesteps"]))
            for tag, text in row.items():
                if tag.startswith("time/total") or not text:
                    continue
                compared += 1
                if found.get((step, tag)) != single(float(text)):
                    wrong += 1
                    print(f"step {step}, {tag}: {text} in metrics.csv, {found.get((step, tag))} in tb/")
    print(f"{len(files)} event files, {len(found)} values; {compared} of metrics.csv compared, {wrong} differ")
    if wrong or not compared:
        sys.exit(1)


if __name__ == "__main__":
    main()
