"""Prints the tables of README.md from the records in the folder given, which measure.sh has written."""

import json
import pathlib
import statistics
import sys

FOLDER = pathlib.Path(sys.argv[1])
BOUNCES = [0, 1, 4]


def points(name):
    return json.loads((FOLDER / f"{name}.json").read_text())["results"]


def tests(name):
    """Node and triangle tests a ray of bounces 0, 1 and 4, as means over the scenes."""
    rows = []
    for point in points(name):
        sums = [[0, 0, 0] for _ in range(5)]
        for view in point["views"]:
            for at, depth in enumerate(view["counters"]["depths"]):
                for k, key in enumerate(["rays", "nodes", "triangles"]):
                    sums[at][k] += depth[key]
        rows.append([sums[b][k] / sums[b][0] for k in (1, 2) for b in BOUNCES])
    return [statistics.fmean(column) for column in zip(*rows)]


def shape(name):
    """Nodes, children a node and triangles a leaf, over the scenes: geometric mean and means."""
    trees = [point["tree"] for point in points(name)]
    return (
        statistics.geometric_mean(tree["nodes"] for tree in trees),
        statistics.fmean(tree["average_children"] for tree in trees),
        statistics.fmean(tree["average_triangles_per_leaf"] for tree in trees),
    )


def table(title, names, head="ray-node tests, bounce 0 | 1 | 4 | ray-triangle tests, bounce 0 | 1 | 4"):
    print(f"\n{title}\n\n| | {head} |\n|---|" + "---|" * (head.count("|") + 1))
    for label, name in names:
        print(f"| {label} | " + " | ".join(f"{value:.2f}" for value in tests(name)) + " |")


table(
    "Table 1",
    [("full precision", "exact")] + [(f"{bits} bits", f"bits-{bits}") for bits in (8, 7, 6, 5, 4)],
)
table(
    "Table 2",
    [("distance", "order-distance"), ("octant", "usual"), ("random", "order-random")],
)
print("\nTable 6\n\n| scene | triangles | references | `Binary` | `Wide8 Compressed` | ratio |\n|---|---|---|---|---|---|")
for binary, wide in zip(points("binary"), points("usual")):
    triangles = wide["scene"]["triangles"]
    references = wide["tree"]["triangle_bytes"] // 48
    sizes = [point["tree"]["node_bytes"] / triangles for point in (binary, wide)]
    print(
        f"| {wide['scene']['name']} | {triangles:,} | {references:,} | {sizes[0]:.2f} | {sizes[1]:.2f} | "
        f"{sizes[1] / sizes[0]:.2f} |"
    )
print(
    "\nTable 8\n\n| | ray-node tests, bounce 0 | 1 | 4 | ray-triangle tests, bounce 0 | 1 | 4 | nodes | "
    "children a node | triangles a leaf |\n|---|" + "---|" * 9
)
usual = shape("usual")
rows = [("optimal, auction, c_prim 0.3", "usual")]
rows += [(method, f"contract-{method}") for method in ("afra", "wald", "fixed")]
rows += [(assignment, f"assignment-{assignment}") for assignment in ("greedy", "random")]
rows += [(f"c_prim {cost}", f"c_prim-{cost}") for cost in ("0.0", "0.1", "0.2", "0.4", "0.5", "1.0")]
rows += [("on PLOC's tree", "ploc")]
for label, name in rows:
    nodes, children, triangles = shape(name)
    cells = [f"{value:.2f}" for value in tests(name)]
    cells += [f"{100 * nodes / usual[0]:.0f}%", f"{children:.2f}", f"{triangles:.2f}"]
    print(f"| {label} | " + " | ".join(cells) + " |")
