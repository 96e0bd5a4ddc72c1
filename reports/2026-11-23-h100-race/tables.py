#!/usr/bin/env python3
"""Prints the race's table from race_*.json and peers.csv: rays of all views over the sum of the launches' medians."""

import csv
import json
import pathlib
import statistics

HERE = pathlib.Path(__file__).parent


def rate(point, first, last):
    """Million rays a second of bounces `first` to `last`, all views together."""
    rays = milliseconds = 0
    for view in point["views"]:
        samples = view["samples"]
        for depth in range(first, min(last + 1, *(len(sample["depths"]) for sample in samples))):
            launches = [sample["depths"][depth] for sample in samples]
            rays += launches[0]["rays"]
            milliseconds += statistics.median(launch["milliseconds"] for launch in launches)
    return rays / milliseconds / 1e3


def name(point):
    own = point["parameters"]
    packets = own.get("trace.primary_packets", 0)
    shared = own.get("groups.share_triangles", False)
    return point["variant"] + (f", packets of {32 * packets}" if packets else "") + (", shared triangles" if shared else "")


peers = {}
for row in csv.DictReader((HERE / "peers.csv").open()):
    for column in ("primary_mrps", "secondary_mrps"):
        peers.setdefault((row["scene"], column), []).append((float(row[column]), row["peer"]))

points = [point for path in HERE.glob("race_*.json") for point in json.loads(path.read_text())["results"]]
# By variant, scene, and whether of primary rays.
rates = {(name(p), p["scene"]["name"], i == 0): rate(p, *(0, 0) if i == 0 else (1, 7)) for p in points for i in (0, 1)}
scenes = list(dict.fromkeys(scene for scene, _ in peers))
for title, column, primary in (("primary", "primary_mrps", True), ("bounces 1 to 7", "secondary_mrps", False)):
    print(f"\n| {title} | " + " | ".join(scenes) + " |\n|---|" + "---:|" * len(scenes))
    best = {}
    for variant in sorted({variant for variant, _, _ in rates}):
        cells = []
        for scene in scenes:
            its = rates[variant, scene, primary]
            cells.append(f"{its:.0f}")
            best[scene] = max(best.get(scene, 0), its)
        print(f"| {variant} | " + " | ".join(cells) + " |")
    cuda = {scene: max(peers[scene, column])[0] for scene in scenes}
    print("| best CUDA | " + " | ".join(f"{cuda[scene]:.0f}" for scene in scenes) + " |")
    print("| our best by it | " + " | ".join(f"{best[scene] / cuda[scene]:.2f}" for scene in scenes) + " |")

clocks = [s.get("sm_clock_mhz") for p in points for v in p["views"] for s in v["samples"]]
print(f"\nclocks: {min(clocks)} to {max(clocks)} MHz")
