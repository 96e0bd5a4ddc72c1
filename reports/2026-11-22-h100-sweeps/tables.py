#!/usr/bin/env python3
"""Prints the tables of this page from the journals beside it."""
import json
import os

HERE = os.path.dirname(os.path.abspath(__file__))
SCENES = ["bistro_exterior", "kitchen"]
SIZES = [2, 4, 8, 12, 16, 20, 24, 28, 32]
VARIANTS = ["Binary"] + [
    f"Wide{arity}{quantized}{cbtc}"
    for arity in (4, 6, 8)
    for quantized in ("", " Quantized")
    for cbtc in ("", " CBTC")
]


def points(*folders):
    """By scene, variant and values of axes; of what was measured twice, the first."""
    found = {}
    for folder in folders:
        with open(os.path.join(HERE, folder, "journal.jsonl"), encoding="utf-8") as lines:
            next(lines)
            for entry in map(json.loads, lines):
                if entry["key"]:
                    scene, variant, *axes = entry["key"].split(" | ")
                    values = tuple(float(axis.split("=")[1]) for axis in ", ".join(axes).split(", ") if axis)
                    found.setdefault((scene, variant, values[:1]), entry["point"])
    return found


def rate(point, rays):
    """MRps: the mean over views of the mean over samples that count, as in the record's documentation."""
    depths = {"primary": slice(0, 1), "secondary": slice(1, None), "all": slice(0, None)}[rays]
    views = []
    for view in point["views"]:
        launches = [s["depths"][depths] for s in view["samples"] if "excluded" not in s]
        rates = [sum(l["rays"] for l in all) / sum(l["milliseconds"] for l in all) / 1e3 for all in launches]
        views.append(sum(rates) / len(rates))
    return sum(views) / len(views)


def sampling(point):
    """Milliseconds of tracing sample rays: the smaller of two repetitions, the mean over views."""
    times = [min(view["adaptation"]["sampling_milliseconds"]) for view in point["views"]]
    return sum(times) / len(times)


def row(*cells):
    print("|", " | ".join(cells), "|")


def mean(values):
    return sum(values) / len(values)


found = points("workgroup")
for rays in ("primary", "secondary"):
    print(f"\nWorkgroup size, {rays} rays")
    for variant in VARIANTS:
        rates = [[rate(found[scene, variant, (size,)], rays) for size in SIZES] for scene in SCENES]
        relative = [[scene[i] / max(scene) for scene in rates] for i in range(len(SIZES))]
        best = max(range(len(SIZES)), key=lambda i: (round(min(relative[i]), 3), mean(relative[i])))
        chosen = [[scene[i] / scene[best] for scene in rates] for i in range(len(SIZES))]
        bold = lambda i, text: f"**{text}**" if i == best else text
        row(variant, "min", *(bold(i, f"{min(values):.2f}") for i, values in enumerate(chosen)))
        row("", "avg", *(f"{mean(values):.2f}" for values in chosen))

print("\nTraversal cost")
found = points("traversal-cost")
for variant in VARIANTS:
    for scene in SCENES if "CBTC" not in variant else []:
        rates = {cost: rate(found[scene, variant, (cost,)], "all")
                 for cost in range(1, 7) if (scene, variant, (cost,)) in found}
        row(variant, scene, *(f"{rates[c] / max(rates.values()):.3f}" if c in rates else "–" for c in range(1, 7)))

for folder, reference in (("cbtc-threshold", 0), ("depth-limit", 7), ("subsampling", 1)):
    print(f"\n{folder}")
    found = points(folder)
    pairs = sorted({(scene, variant) for scene, variant, values in found if values})
    for value in sorted({values[0] for _, _, values in found if values}):
        cells = [f"{value:.0f}"]
        for rays in ("primary", "secondary"):
            all = [rate(found[p + ((value,),)], rays) / rate(found[p + ((reference,),)], rays) for p in pairs]
            cells.append(f"{mean(all):.3f} ({min(all):.3f} to {max(all):.3f})")
        time = mean([sampling(found[p + ((value,),)]) for p in pairs])
        whole = mean([sampling(found[p + ((reference,),)]) for p in pairs])
        row(*cells, f"{time:.1f} ms ({100 * time / whole:.1f}%)")
    without = [(scene, variant.removesuffix(" CBTC")) for scene, variant in pairs]
    for rays in ("primary", "secondary"):
        all = [rate(found[w + ((),)], rays) / rate(found[p + ((reference,),)], rays) for w, p in zip(without, pairs)]
        print(f"without CBTC, {rays}: {mean(all):.3f}")
