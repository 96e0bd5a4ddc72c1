"""Prints the tables of rates in README.md.

From language/journal.jsonl each technique at its best size of workgroup, and from default.json Slang relative to GLSL.
"""

import json
import pathlib

TECHNIQUES = {
    (False, False, 64): "as it is",
    (True, False, 64): "barrier",
    (False, True, 64): "hoisted",
    (False, False, 96): "96 entries",
    (True, True, 96): "all three",
}
VARIANTS = ["Binary", "Wide4", "Wide4 Quantized", "Wide6", "Wide6 Quantized", "Wide8", "Wide8 Quantized"]


def rate(point, depths):
    """The mean over views of the mean over samples of million rays a second (docs/record.md)."""
    views = []
    for view in point["views"]:
        rates = []
        for sample in view["samples"]:
            if not sample.get("excluded"):
                launches = sample["depths"][depths]
                time = sum(launch["milliseconds"] for launch in launches)
                rates.append(sum(launch["rays"] for launch in launches) / time / 1e3)
        views.append(sum(rates) / len(rates))
    return sum(views) / len(views)


def slang(variant):
    arity, *rest = variant.split(" ")
    return " ".join([arity, "Slang", *rest])


def main():
    lines = pathlib.Path(__file__).with_name("language").joinpath("journal.jsonl").read_text().splitlines()
    run, *entries = map(json.loads, lines)
    best = {}
    for entry in entries:
        if not entry["key"]:
            continue  # the reference point
        point = entry["point"]
        parameters = {**run["record"]["parameters"], **point["parameters"]}
        language = "slang" if "Slang" in point["variant"] else "glsl"
        technique = TECHNIQUES[
            parameters[language + ".barrier"], parameters[language + ".hoist"], parameters["trace.stack"]
        ]
        for rays, depths in [("primary", slice(1)), ("secondary", slice(1, None))]:
            found = (rate(point, depths), parameters["trace.primary_subgroups"])
            key = (point["variant"], technique, rays)
            best[key] = max(best.get(key, found), found)
    names = list(TECHNIQUES.values())
    for rays in ["primary", "secondary"]:
        print(f"\n| {rays} rays | GLSL | " + " | ".join(names[1:]) + " | Slang | " + " | ".join(names[1:]) + " |")
        print("|---|" + "---:|" * 10)
        for variant in VARIANTS:
            glsl = best[variant, names[0], rays]
            other = best[slang(variant), names[0], rays]
            cells = [f"{glsl[0]:.0f} (32×{glsl[1]})"]
            cells += [f"{100 * (best[variant, name, rays][0] / glsl[0] - 1):+.1f}%" for name in names[1:]]
            cells.append(f"{other[0]:.0f} (32×{other[1]}), {100 * (other[0] / glsl[0] - 1):+.1f}%")
            cells += [f"{100 * (best[slang(variant), name, rays][0] / other[0] - 1):+.1f}%" for name in names[1:]]
            print(f"| {variant} | " + " | ".join(cells) + " |")


def defaults():
    rates = {}
    scenes = []
    for point in json.loads(pathlib.Path(__file__).with_name("default.json").read_text())["results"]:
        scene = point["scene"]["name"]
        if scene not in scenes:
            scenes.append(scene)
        for rays, depths in [("primary", slice(1)), ("secondary", slice(1, None))]:
            rates[scene, point["variant"], rays] = rate(point, depths)
    print("\n| variant | primary | secondary |\n|---|---|---|")
    for variant in VARIANTS:
        cells = []
        for rays in ["primary", "secondary"]:
            ratios = [rates[scene, slang(variant), rays] / rates[scene, variant, rays] for scene in scenes]
            cells.append(", ".join(f"{100 * (ratio - 1):+.1f}%" for ratio in ratios))
        print(f"| {variant} | " + " | ".join(cells) + " |")


main()
defaults()
