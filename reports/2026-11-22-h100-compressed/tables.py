#!/usr/bin/env python3
"""Prints what each point of the records beside this script came to: million rays a second from each view, primary / all
bounces, and of all views together, by the medians of launches at 1881 MHz or more; a dash where fewer than two were. With --by-clock, of all
launches, each as if the clock that was read after it had been 1980 MHz: for comparisons where the clock slept."""
import json
import pathlib
import statistics
import sys

by_clock = "--by-clock" in sys.argv
names = [name for name in sys.argv[1:] if name != "--by-clock"]
for path in sorted(pathlib.Path(__file__).parent.glob("*.json")):
    if names and path.stem not in names:
        continue
    print(path.stem)
    for point in json.load(path.open())["results"]:
        cells, total = [], [[0, 0], [0, 0]]
        for view in point["views"]:
            samples = [s for s in view["samples"] if by_clock or s["sm_clock_mhz"] >= 1881]
            if len(samples) < 2:
                cells.append("–")
                continue
            rays = [depth["rays"] for depth in samples[0]["depths"]]
            scale = lambda s: s["sm_clock_mhz"] / 1980 if by_clock else 1
            launch = lambda s, b: s["depths"][b]["milliseconds"] * scale(s)
            ms = [statistics.median_high(launch(s, b) for s in samples) for b in range(len(rays))]
            rate = lambda b: f"{sum(rays[b]) / sum(ms[b]) / 1e3:.0f}" if rays[b] else "–"
            for sums, part in zip(total, (slice(0, 1), slice(1, None))):
                sums[0] += sum(rays[part])
                sums[1] += sum(ms[part])
            cells.append(f"{rate(slice(0, 1))} / {rate(slice(1, None))}")
        if "–" not in cells:
            cells.append("together " + " / ".join(f"{r / t / 1e3:.0f}" if r else "–" for r, t in total))
        print(" ", point["scene"]["name"], point["variant"], point["parameters"], *cells, sep=" | ")
