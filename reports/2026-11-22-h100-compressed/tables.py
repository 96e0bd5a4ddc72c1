#!/usr/bin/env python3
"""Prints what each point of the records beside this script came to: million rays a second from each view, primary / all
bounces, by the medians of launches at 1881 MHz or more; a dash where fewer than two were."""
import json
import pathlib
import statistics
import sys

for path in sorted(pathlib.Path(__file__).parent.glob("*.json")):
    if sys.argv[1:] and path.stem not in sys.argv[1:]:
        continue
    print(path.stem)
    for point in json.load(path.open())["results"]:
        cells = []
        for view in point["views"]:
            samples = [s["depths"] for s in view["samples"] if s["sm_clock_mhz"] >= 1881]
            if len(samples) < 2:
                cells.append("–")
                continue
            rays = [depth["rays"] for depth in samples[0]]
            ms = [statistics.median_low(s[b]["milliseconds"] for s in samples) for b in range(len(rays))]
            rate = lambda b: f"{sum(rays[b]) / sum(ms[b]) / 1e3:.0f}" if rays[b] else "–"
            cells.append(f"{rate(slice(0, 1))} / {rate(slice(1, None))}")
        print(" ", point["scene"]["name"], point["variant"], point["parameters"], *cells, sep=" | ")
