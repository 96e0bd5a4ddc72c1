#!/usr/bin/env python3
"""Prints the race's table from race.json and peers.csv: rays of all views over the sum of the launches' medians."""

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

points = json.loads((HERE / "race.json").read_text())["results"]
scenes = list(dict.fromkeys(scene for scene, _ in peers))
for title, column, first, last in (("primary", "primary_mrps", 0, 0), ("bounces 1 to 7", "secondary_mrps", 1, 7)):
    print(f"\n| {title} | " + " | ".join(scenes) + " |\n|---|" + "---:|" * len(scenes))
    names = list(dict.fromkeys(name(point) for point in points))
    best = {}
    for variant in sorted(names):
        cells = []
        for scene in scenes:
            its = [rate(p, first, last) for p in points if name(p) == variant and p["scene"]["name"] == scene]
            cells.append(f"{statistics.median(its):.0f}" if its else "")
            if its:
                best[scene] = max(best.get(scene, 0), statistics.median(its))
        print(f"| {variant} | " + " | ".join(cells) + " |")
    cuda = {scene: max(peers[scene, column])[0] for scene in scenes}
    print("| best CUDA | " + " | ".join(f"{cuda[scene]:.0f}" for scene in scenes) + " |")
    print("| our best by it | " + " | ".join(f"{best[scene] / cuda[scene]:.2f}" for scene in scenes if scene in best) + " |")

clocks = [s.get("sm_clock_mhz") for p in points for v in p["views"] for s in v["samples"]]
print(f"\nclocks: {min(clocks)} to {max(clocks)} MHz")
