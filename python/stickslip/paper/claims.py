"""What a run must show of Tables I and II; `stickslip paper --check` fails where it does not."""

from __future__ import annotations

from stickslip.paper.methods import TASKS

_HALLEY_SPEEDUP = 5  # over bisection
_HALLEY_NS = 100  # per sliding contact, CPU time
_FEWER_AT_IMPACT = 5  # sweeps than PGS, in hang and drop


def missed(results: dict) -> list[str]:
    """A sentence for each claim that this run's numbers do not keep; empty if they keep all."""
    return [*_table1(results["table1"]["tasks"]), *_table2(results["table2"]["tasks"])]


def _table1(tasks: dict) -> list[str]:
    out = []
    for task, name in TASKS.items():
        methods = tasks[task]["methods"]
        if not methods:
            out.append(f"Table I, {name}: no sliding contact was found")
            continue
        ns = {m: found["ns_per_solve"] for m, found in methods.items()}
        if not ns["bisection"] >= _HALLEY_SPEEDUP * ns["halley"]:
            out.append(
                f"Table I, {name}: Halley is {ns['bisection'] / ns['halley']:.2f} times faster than bisection, "
                f"not {_HALLEY_SPEEDUP}"
            )
        if not ns["halley"] <= _HALLEY_NS:
            out.append(f"Table I, {name}: Halley takes {ns['halley']:.0f} ns per contact, more than {_HALLEY_NS}")
        if not ns["bisection"] < ns["golden_section"]:
            out.append(
                f"Table I, {name}: bisection takes {ns['bisection']:.0f} ns, golden section {ns['golden_section']:.0f}"
            )
        out += [
            f"Table I, {name}: {m} fails on {100 * methods[m]['failures']:.3g} % of the contacts"
            for m in ("halley", "bisection")
            if methods[m]["failures"] != 0
        ]
    return out


def _table2(tasks: dict) -> list[str]:
    out = []
    for task, name in TASKS.items():
        ours, pgs = tasks[task]["bisection"], tasks[task]["pgs"]
        if not ours["mean"] < pgs["mean"]:
            out.append(
                f"Table II, {name}: per-contact iteration sweeps {ours['mean']:.2f} times, PGS {pgs['mean']:.2f}"
            )
    for task in ("hang", "drop"):
        ours, pgs = tasks[task]["bisection"]["at_impact"], tasks[task]["pgs"]["at_impact"]
        if not 0 < _FEWER_AT_IMPACT * ours <= pgs:
            out.append(
                f"Table II, {TASKS[task]}: at impact per-contact iteration sweeps {ours:.1f} times, PGS {pgs:.1f}: "
                f"not {_FEWER_AT_IMPACT} times fewer"
            )
    return out
