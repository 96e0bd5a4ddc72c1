"""Values of SciPy and statsmodels that compare's own statistics are held against, on fixed data.

    python3 -m venv venv && venv/bin/pip install scipy==1.17.1 statsmodels==0.15.0
    venv/bin/python compare/tests/data/statistics.py > compare/tests/data/statistics.json

Nothing here is shared with the code under test: the permutation test is SciPy's where there is one group and a plain
loop over all exchanges where there are several, which SciPy's does not know; the interval is SciPy's BCa.
"""

import itertools
import json
import math

import numpy as np
import scipy
import statsmodels
from scipy import stats
from statsmodels.stats.multitest import multipletests
from statsmodels.stats.power import NormalIndPower

rng = np.random.default_rng(20250501)


def group(old, new):
    return np.round(old, 3), np.round(new, 3)


def normal(n, m, change, deviation=1.0, mean=100.0):
    return group(rng.normal(mean, deviation, n), rng.normal(mean * change, deviation, m))


CASES = {
    "one view": [normal(6, 6, 1.01)],
    "unequal numbers": [normal(5, 9, 1.015)],
    "unequal scatter": [group(rng.normal(100, 0.3, 8), rng.normal(101, 2.0, 6))],
    "skewed": [group(100 + rng.lognormal(0, 1, 20), 101 + rng.lognormal(0, 1, 20))],
    "few samples of three views": [normal(3, 3, 1.01, 0.5, mean) for mean in (50, 100, 400)],
    "eight views": [normal(15, 15, 1.002, 1.0, mean) for mean in np.linspace(80, 300, 8)],
    "no change": [normal(4, 4, 1.0), normal(4, 3, 1.0)],
}


def log_ratio(groups, axis=-1):
    old = sum(np.mean(old, axis=axis) for old, _ in groups)
    new = sum(np.mean(new, axis=axis) for _, new in groups)
    return np.log(new / old)


def parts(groups):
    """Variance and degrees of freedom that each group and side adds."""
    old = sum(np.mean(old) for old, _ in groups)
    new = sum(np.mean(new) for _, new in groups)
    return [
        (np.var(side, ddof=1) / len(side) / figure**2, len(side) - 1)
        for pair in groups
        for side, figure in zip(pair, (old, new))
    ]


def studentized(groups):
    return abs(log_ratio(groups)) / math.sqrt(sum(variance for variance, _ in parts(groups)))


def p_value(groups):
    """And whether it is exact; nothing of groups with too many ways to exchange."""
    ways = math.prod(math.comb(len(old) + len(new), len(old)) for old, new in groups)
    if len(groups) == 1:
        found = stats.permutation_test(
            groups[0],
            lambda old, new: studentized([(old, new)]),
            permutation_type="independent",
            vectorized=False,
            alternative="greater",
            n_resamples=np.inf if ways < 20_000 else 20_000,
            rng=np.random.default_rng(1),
        )
        return found.pvalue, ways < 20_000
    if ways > 20_000:
        return None, False
    measured = studentized(groups) * (1 - 1e-9)

    def splits(old, new):
        pooled = np.concatenate([old, new])
        for chosen in itertools.combinations(range(len(pooled)), len(old)):
            rest = [index for index in range(len(pooled)) if index not in chosen]
            yield pooled[list(chosen)], pooled[rest]

    extreme = sum(studentized(one) >= measured for one in itertools.product(*(splits(*pair) for pair in groups)))
    return extreme / ways, True


def interval(groups):
    variances = parts(groups)
    freedom = sum(v for v, _ in variances) ** 2 / sum(v**2 / f for v, f in variances)
    tail = stats.norm.cdf(-stats.t.ppf(0.975, freedom))

    def widened(values):
        n = len(values)
        return np.mean(values) + math.sqrt(n / (n - 1)) * (values - np.mean(values))

    sides = [widened(old) for old, _ in groups] + [widened(new) for _, new in groups]
    half = len(groups)

    def statistic(*sides, axis=-1):
        return log_ratio(list(zip(sides[:half], sides[half:])), axis)

    found = stats.bootstrap(
        sides,
        statistic,
        n_resamples=200_000,
        batch=2_000,
        confidence_level=1 - 2 * tail,
        method="BCa",
        rng=np.random.default_rng(1),
    ).confidence_interval
    return freedom, [math.exp(found.low), math.exp(found.high)]


def case(groups):
    freedom, ends = interval(groups)
    p, exact = p_value(groups)
    return {
        "groups": [{"old": list(old), "new": list(new)} for old, new in groups],
        "log_ratio": log_ratio(groups),
        "variance": sum(variance for variance, _ in parts(groups)),
        "freedom": freedom,
        "p": p,
        "exact": exact,
        "interval": ends,
    }


raw = [0.0001, 0.04, 0.03, 0.005, 0.8, 0.012, 0.012, 0.3]
power = NormalIndPower()
print(
    json.dumps(
        {
            "versions": {"scipy": scipy.__version__, "statsmodels": statsmodels.__version__},
            "cases": {name: case(groups) for name, groups in CASES.items()},
            "holm": {"p": raw, "adjusted": list(multipletests(raw, method="holm")[1])},
            "samples": [
                {"effect": effect, "tests": tests, "number": power.solve_power(effect, alpha=0.05 / tests, power=0.8)}
                for effect in (0.2, 0.5)
                for tests in (1, 40)
            ],
        },
        indent=1,
    )
)
