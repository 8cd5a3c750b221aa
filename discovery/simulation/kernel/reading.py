"""Text of what is read between the ends of a step: interpolated, observed, and what it misses."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from discovery.simulation.kernel.straight_line import received

#: Rows of the flat array by what they hold, then by name.
Layout = Mapping[str, Mapping[str, int]]
#: Returns the lines of a loop over the lanes, of its body.
OverLanes = Callable[[Sequence[str]], Sequence[str]]

_HERMITE, _CUBIC = [f"b{k}" for k in range(6)], [f"g{k}" for k in range(4)]
#: Where a reading finds what its body is given.
_SOURCES = {"t": "out_time[j]", **{f"r_{k}": f"out_drive[j, {k}]" for k in range(3)}}
#: Weights of a late lane, as `_hermite` and `_cubic` give them; by Taylor from the nearer end before the first and
#: after the last step.
_LATE_WEIGHTS = (
    "f3 = f * f * f",
    "p1 = f3 * (10.0 + f * (-15.0 + 6.0 * f))",
    "b0 = 1.0 - p1",
    "b1 = p1",
    "b2 = h * (f + f3 * (-6.0 + f * (8.0 - 3.0 * f))) + before",
    "b3 = h * f3 * (-4.0 + f * (7.0 - 3.0 * f)) + after",
    "b4 = 0.5 * h * h * (f * f + f3 * (-3.0 + f * (3.0 - f))) + 0.5 * before * before",
    "b5 = 0.5 * h * h * f3 * (1.0 + f * (-2.0 + f)) + 0.5 * after * after",
    "c1 = f * f * (3.0 - 2.0 * f)",
    "g0 = 1.0 - c1",
    "g1 = c1",
    "g2 = h * f * (1.0 - f) * (1.0 - f) + before",
    "g3 = h * f * f * (f - 1.0) + after",
)


def _interpolated(coordinates: Sequence[tuple[str, str]], sampled: Sequence[str], rows: Layout) -> dict[str, str]:
    """Return the text of coordinates, each given with its rate, and of other states, from both ends of a step."""
    found = {}
    for q, rate in coordinates:
        terms = [f"b{k} * w[{rows[label][q]} + i]" for k, label in enumerate("YSFK")]
        terms += [f"b{k} * w[{rows[label][rate]} + i]" for k, label in enumerate("FK", start=4)]
        found[q] = " + ".join(terms)
    for z in sampled:
        found[z] = " + ".join(f"g{k} * w[{rows[label][z]} + i]" for k, label in enumerate("YSFK"))
    return found


def _reading(head: str, said: str, loop: Sequence[str], body: Sequence[str], after: Sequence[str] = ()) -> str:
    """Return a function that interpolates at output `j`; it fetches what the body of its loop is given."""
    needed = received(body)
    before = []
    for names, call in ((_HERMITE, "_hermite"), (_CUBIC, "_cubic")):
        if not {*names}.isdisjoint(needed):
            before.append(f"{', '.join(names)} = {call}(out_fraction[j], h)")
    before += [f"{name} = {source}" for name, source in _SOURCES.items() if name in needed]
    for k in range(len(needed)):
        if f"goal_{k}" in needed:
            before += [f"goal_{k}, share_{k} = target[j, {k}], weight[j, {k}]"]
    text = [f'"""{said}"""', "_rolled()", *before, *loop, "_barrier()", *after]
    return f"@_inner\ndef {head}:\n" + "".join(f"    {line}\n" for line in text)


def reading(over_lanes: OverLanes, coordinates: Sequence[tuple[str, str]], sampled: Sequence[str], rows: Layout) -> str:
    """Return a function that interpolates, then observes in loops of its own.

    `over_lanes`: returns the lines of a loop over the lanes, of its body. `coordinates`: names of the coordinates, each
    with that of its rate. `sampled`: names of other states that the reading needs. `rows`: rows of the states Y, S, F,
    K, of their interpolated values Q, of drive and time D.
    """
    body = [f"w[{rows['Q'][x]} + i] = {text}" for x, text in _interpolated(coordinates, sampled, rows).items()]
    body += [f"w[{row} + i] = {name}" for name, row in rows["D"].items()]
    return _reading(
        "_read(w, on, h, j, out_fraction, out_time, out_drive)",
        "Readings R at output `j`, in every lane.",
        over_lanes(body),
        body,
        ["_observe(w, on)"],
    )


def fused_reading(
    over_lanes: OverLanes,
    loads: Mapping[str, int],
    coordinates: Sequence[tuple[str, str]],
    sampled: Sequence[str],
    body: Sequence[str],
    rows: Layout,
) -> str:
    """Return functions that read in one loop: one gives readings, one what they miss, and adds it up.

    Parameters
    ----------
    over_lanes : callable
        Returns the lines of a loop over the lanes, of its body.
    loads : mapping of str to int
        Row of every number that does not change.
    coordinates : sequence of (str, str)
        Names of the coordinates in `body`, each with that of its rate.
    sampled : sequence of str
        Names of other states that the reading needs.
    body : sequence of str
        Lines that compute the readings.
    rows : mapping
        Rows of the states Y, S, F, K, of the readings R, of the sums of squares C and the largest miss M.
    """
    inner = [f"{name} = w[{row} + i]" for name, row in loads.items()]
    inner += [f"{name} = {text}" for name, text in _interpolated(coordinates, sampled, rows).items()]
    inner += body
    kept = [*inner, *(f"w[{row} + i] = {name}" for name, row in rows["R"].items())]
    (largest,) = rows["M"].values()
    scored = [*inner, f"_top = w[{largest} + i]"]
    for k, (name, row) in enumerate(zip(rows["R"], rows["C"].values(), strict=True)):
        scored += [f"_miss = share_{k} * ({name} - goal_{k})", f"w[{row} + i] += _miss * _miss"]
        scored.append(f"w[{rows['R'][name]} + i] = _miss")
        scored += ["_size = abs(_miss)", "_top = _size if _size > _top else _top"]
    scored.append(f"w[{largest} + i] = _top")
    return (
        _reading(
            "_read(w, on, h, j, out_fraction, out_time, out_drive)",
            "Readings R at output `j`, in every lane.",
            over_lanes(kept),
            kept,
        )
        + "\n\n"
        + _reading(
            "_score(w, h, j, out_fraction, out_time, out_drive, target, weight)",
            "Put what the readings miss in their place, add its squares to the sums C, its size to the largest miss M.",
            over_lanes(scored),
            scored,
        )
    )


def late_interpolation(
    over_lanes: OverLanes, coordinates: Sequence[tuple[str, str]], sampled: Sequence[str], rows: Layout, last: int
) -> list[str]:
    """Return lines that interpolate in every lane at the time of its own output, that of T before by the age L.

    `over_lanes`, `coordinates`, `sampled`: see `reading`. `rows`: rows of the states Y, S, F, K, of their interpolated
    values Q, of drive and time D, of times T and ages L. `last`: which node of the drive lies at the end of a step. The
    lines know by `moves` whether there is motion before the first step, 1 or 0.
    """
    (time,), (age,) = rows["T"].values(), rows["L"].values()
    body = [f"read = w[{time} + i] - w[{age} + i]", "past = read - t", "early = past if past < 0.0 else 0.0"]
    body += ["before = moves * early", "after = past - h if past > h else 0.0"]
    body += ["f = (past - early - after) / h", *_LATE_WEIGHTS]
    body += [f"w[{rows['Q'][x]} + i] = {text}" for x, text in _interpolated(coordinates, sampled, rows).items()]
    drive, *_, when = rows["D"].values()
    ends = [f"{e}{k}" for k in range(3) for e in "uv"]
    body.append(f"w[{drive} + i] = " + " + ".join(f"b{k} * {name}" for k, name in enumerate(ends)))
    body.append(f"w[{when} + i] = read")
    nodes = [f"drive[n, {node}, {k}]" for k in range(3) for node in (0, last)]
    return [f"{', '.join(ends)} = {', '.join(nodes)}", *over_lanes(body)]


def misses(over_lanes: OverLanes, k: int, rows: Layout, late: str) -> list[str]:
    """Return lines that weigh what channel `k` misses at output `j`, add it up, and store it where it is wanted.

    `over_lanes`: see `reading`. `k`: channel. `rows`: rows of the readings R, of the sums of squares C and the largest
    miss M. `late`: condition under which lanes are late; they are read at other times.
    """
    row, total = ([*rows[label].values()][k] for label in "RC")
    (largest,) = rows["M"].values()
    weigh = [f"w[{row} + i] = share * (w[{row} + i] - goal)"]
    tally = [f"_miss = w[{row} + i]", f"w[{total} + i] += _miss * _miss", f"_top = w[{largest} + i]"]
    tally += ["_size = abs(_miss)", f"w[{largest} + i] = _size if _size > _top else _top"]
    prompt = [*over_lanes(tally), "if stored:", f"    _store(w, _AT, _CHANNELS[{k}], out, j, place)"]
    lines = [f"goal, share = target[j, {k}], weight[j, {k}]", *over_lanes(weigh)]
    if late == "False":
        lines += prompt
    else:
        lines += [f"if {late}:", f"    _score_prompt(w, _AT, _LAGS, _CHANNELS[{k}], out, j, place)", "else:"]
        lines += [f"    {line}" for line in prompt]
    return [f"if {k} < n_channels:", *(f"    {line}" for line in lines), "_barrier()"]
