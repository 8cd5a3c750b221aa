"""Bounded refits of a model with every candidate effect added: finite effects decide, all together in one batch."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from discovery.equations.model import Model
from discovery.estimation.batch import SLOW, Race, fit_problems, near_the_best, together
from discovery.estimation.least_squares import Minimum, Request, levenberg_marquardt
from discovery.estimation.problem import Problem
from discovery.foundation.arrays import FloatArray
from discovery.screening.attribution import Candidate, Start
from discovery.screening.finite import FarStart

#: Effects, their free values, sensitivities (zeros: unknown), what goes with them unless it is compensated, and the
#: starts of the effects of which recordings have values of their own.
_Start = tuple[tuple[str, ...], FloatArray, FloatArray, Mapping[str, float] | None, tuple[Start, ...]]
#: So many of the best quick refits, and of the best effects, are finished with a differenced Jacobian,
_FINISHED = 6
#: and so many of those with the largest scores.
_PROMISING = 8
#: All refits take so many steps, then only the best ones go on.
_FIRST_ROUND = 8
_IN_THE_RACE = 18
_SECOND_ROUND = 30
#: A differenced Jacobian shows within so many steps what a quick search missed; the best ones are finished later.
_CHECKED = 10


@dataclass(frozen=True, eq=False)
class Refit:
    """A model with a candidate added, refitted."""

    effect: str
    problem: Problem
    minimum: Minimum

    @property
    def chi2(self) -> float:
        """Sum of squared normalised residuals."""
        return 2 * self.minimum.cost

    @property
    def values(self) -> dict[str, float]:
        """Estimates by name, initial states included."""
        return self.problem.named(self.minimum.x)

    def predict(self) -> list[FloatArray]:
        """Return the channels of every fitted recording, each (n, c)."""
        return self.problem.predict(self.minimum.x)


def held_fixed(problem: Problem, minimum: Minimum) -> tuple[Problem, Minimum]:
    """Return a fit with what the rig knows held at its fitted value: the rod's ringing would trap a search."""
    nuisance = [n for n in problem.gaussian if n in problem.free]
    known = {**problem.model.known, **{n: float(minimum.x[problem.names.index(n)]) for n in nuisance}}
    model = Model(problem.model.base, problem.model.effects, known)
    keep = [i for i, n in enumerate(problem.names) if n not in nuisance]
    # What the rig knows stands behind the readings, before what is believed of starts, which stays.
    rows = slice(problem.bench.n_rows, problem.bench.n_rows + len(nuisance))
    residual = np.delete(minimum.residual, rows)
    return Problem(model, problem.bench, problem.units, {}), Minimum(
        minimum.x[keep],
        0.5 * float(residual @ residual),
        residual,
        np.delete(minimum.jacobian, rows, axis=0)[:, keep],
        minimum.at_bound[keep],
        minimum.converged,
        minimum.iterations,
    )


def refit(
    minimum: Minimum,
    problem: Problem,
    shortlist: Sequence[Candidate],
    *,
    finite: Sequence[FarStart] = (),
    thorough: bool = False,
) -> list[Refit]:
    """Refit the model with each candidate added, bounded, all together; the best of several starts of each.

    `minimum`, `problem`: the fit so far. `shortlist`: from `discovery.screening.attribution.screen`. `finite`:
    more starts, see `discovery.screening.finite.finite_starts`. `thorough`: finish every effect with a differenced
    Jacobian, however far behind: a quick search may stall where it begins. Returned: smallest chi-square first.
    """
    rows = problem.bench.n_rows
    starts: list[_Start] = [((c.effect,), s.values, s.columns(), None, (s,)) for c in shortlist for s in c.starts]
    starts += [((name,), vector, np.zeros((rows, vector.size)), others, ()) for name, vector, others in finite]
    return _raced(minimum, problem, starts, thorough=thorough)


def refit_pairs(minimum: Minimum, problem: Problem, pairs: Sequence[tuple[Candidate, Candidate]]) -> list[Refit]:
    """Refit the model with two candidates added at once, from their joint linear solution.

    Returned: smallest chi-square first; `effect` is the second one.
    """
    rows = problem.bench.n_rows
    known, _ = np.linalg.qr(minimum.jacobian[:rows])
    starts: list[_Start] = []
    for pair in pairs:
        vector = np.concatenate([c.starts[0].values for c in pair])
        columns = np.concatenate([c.starts[0].columns() for c in pair], axis=1)
        moving = columns.any(axis=0)
        free = columns[:, moving] - known @ (known.T @ columns[:, moving])
        size = np.maximum(np.linalg.norm(free, axis=0), 1e-300)
        solution = np.linalg.lstsq(free / size, -minimum.residual[:rows], rcond=None)[0]
        vector[moving] = solution / size
        starts.append((tuple(c.effect for c in pair), vector, columns, None, tuple(c.starts[0] for c in pair)))
    return _raced(minimum, problem, starts)


def _raced(minimum: Minimum, problem: Problem, starts: Sequence[_Start], *, thorough: bool = False) -> list[Refit]:
    """Refit from starts, all together; only the best go all the way."""
    problems: list[Problem] = []
    requests = []
    labels = [effects for effects, *_ in starts]
    n_data, rows = problem.bench.n_data, problem.bench.n_rows
    race = Race(n_data, SLOW)
    for effects, vector, columns, others, own in starts:
        extended = Problem(
            _holding(problem.model, others).with_effect(*effects), problem.bench, problem.units, problem.gaussian
        )
        old = [extended.names.index(n) for n in problem.names]
        added = [i for i, n in enumerate(extended.free) if n not in problem.free]
        lower, upper = extended.bounds
        x = extended.start({n: v for start in own for n, v in start.of_recordings(extended).items()})
        jacobian = np.zeros((rows, x.size))
        x[old], x[added] = minimum.x, np.clip(vector, lower[added], upper[added])
        jacobian[:, old] = minimum.jacobian[:rows]
        jacobian[: len(columns), added] = columns
        if others is None:
            # The fitted parameters move with the effect: first-order compensation.
            push = minimum.residual.copy()
            push[:rows] += jacobian[:, added] @ x[added]
            step, *_ = np.linalg.lstsq(minimum.jacobian, -push, rcond=None)
            x[old] = np.clip(x[old] + step, lower[old], upper[old])
        else:
            for i, name in enumerate(extended.names):
                x[i] = np.clip(others.get(name, x[i]), lower[i], upper[i])
        problems.append(extended)
        whole = np.concatenate([jacobian, extended.prior_jacobian()])
        requests.append(_quick(extended, x, whole, _FIRST_ROUND, race.enter(effects)))
    quick = together(problems, requests)
    minima = list(quick)
    # Only those go on that are still in the race.
    ahead = near_the_best([2 * m.cost for m in minima], n_data, SLOW)[:_IN_THE_RACE]
    going = [i for i in ahead if not minima[i].converged and np.isfinite(minima[i].cost)]
    race = Race(n_data, SLOW)
    further = [
        _quick(problems[i], minima[i].x, minima[i].jacobian, _SECOND_ROUND, race.enter(labels[i])) for i in going
    ]
    second = together([problems[i] for i in going], further)
    for i, found in zip(going, second, strict=True):
        minima[i] = found
    # A quick search may stall on its carried Jacobian: the best ones are finished with differences, and so are effects
    # that promise most, or that leave more than the model without them.
    order = sorted(range(len(minima)), key=lambda i: minima[i].cost)
    leading: dict[tuple[str, ...], int] = {}
    for i in order:
        leading.setdefault(labels[i], i)
    near = near_the_best([2 * m.cost for m in minima], n_data)
    nearest = [i for i in leading.values() if i in near]
    stalled = [i for i in leading.values() if not minima[i].cost <= minimum.cost]
    # Starts come in the order of their scores.
    promising = [leading[label] for label in list(dict.fromkeys(labels))[:_PROMISING]]
    all_of_them = leading.values() if thorough else ()
    chosen = list(dict.fromkeys([*near[:_FINISHED], *nearest[:_FINISHED], *promising, *stalled, *all_of_them]))
    # What ended above the model without it begins anew from that, where the effect is absent.
    ends = [_absent(problems[i], problem, minimum, minima[i].x) if i in stalled else minima[i].x for i in chosen]
    finished = settle([problems[i] for i in chosen], ends, _CHECKED)
    for i, found in zip(chosen, finished, strict=True):
        if found.cost < minima[i].cost or not np.isfinite(minima[i].cost):
            minima[i] = found
    # What any start of an effect ran into may have stopped its best one, too.
    tried = (*enumerate(quick), *zip(going, second, strict=True), *zip(chosen, finished, strict=True))
    blown = {labels[i] for i, m in tried if m.blown}
    return best_of(
        Refit(each[-1], p, replace(m, blown=each in blown)) for each, p, m in zip(labels, problems, minima, strict=True)
    )


def _absent(problem: Problem, smaller: Problem, minimum: Minimum, end: FloatArray) -> FloatArray:
    """Return the minimum of a smaller problem in one with effects more, absent, in the shapes in which they ended."""
    ended = problem.named(end) if np.isfinite(end).all() else {}
    sizes = {n: p for n in problem.free if not (p := problem.model.parameters[n]).shape}
    absent = {n: p.default * problem.units.scale(p) for n, p in sizes.items()}
    own = dict.fromkeys(problem.names[len(problem.free) :], 0.0)
    return problem.start({**ended, **absent, **own, **smaller.named(minimum.x)})


def _holding(model: Model, others: Mapping[str, float] | None) -> Model:
    """Return a model that holds what it knows at other values, if these are given."""
    known = {n: (others or {}).get(n, value) for n, value in model.known.items()}
    return Model(model.base, model.effects, known)


def _quick(
    problem: Problem, x: FloatArray, jacobian: FloatArray, iterations: int, is_behind: Callable[[float, int], bool]
) -> Request:
    """Return a search that carries its Jacobian along."""
    lower, upper = problem.bounds
    return levenberg_marquardt(
        x, lower, upper, problem.scale, iterations=iterations, tolerance=1e-3, jacobian=jacobian, is_behind=is_behind
    )


def finish(problem: Problem, quick: Sequence[Refit], *, afresh: bool = False) -> list[Refit]:
    """Refit with what the rig knows free again: a missing effect may have pushed it off what the rig states.

    `problem`: the fit so far, with what the rig knows free. `quick`: refits with it held. `afresh`: begin from the
    declared guesses as well: without its effects a fit may have gone far astray. Returned: smallest chi-square first.
    """
    nuisance = [n for n in problem.gaussian if n in problem.free]
    # What may not be negative is stated inside its bounds.
    stated = {n: mean if mean > 0 else 0.5 * sd for n, (mean, sd) in problem.gaussian.items()}
    problems, vectors = [], []
    for r in quick:
        model = Model(problem.model.base, r.problem.model.effects, problem.model.known)
        extended = Problem(model, r.problem.bench, problem.units, problem.gaussian)
        # As held, and as the rig states.
        starts = [{n: r.problem.model.known[n] for n in nuisance}]
        if any(abs(starts[0][n] - stated[n]) > problem.gaussian[n][1] for n in nuisance):
            starts.append({n: stated[n] for n in nuisance})
        for known in starts:
            problems.append(extended)
            vectors.append(extended.start({**r.values, **known}))
        if afresh:
            problems.append(extended)
            vectors.append(extended.start({n: v for n, v in r.values.items() if n not in problem.free}))
    return settled(problems, vectors)


def relaxed(fitted: Refit, model: Model) -> Refit:
    """Return the refit of a model that has less than another, fitted again from where that is.

    `fitted`: the other one. `model`: what is left of its model.
    """
    problem = fitted.problem
    smaller = Problem(model, problem.bench, problem.units, problem.gaussian)
    (minimum,) = fit_problems([smaller], [smaller.start(fitted.values)], tolerance=1e-6, rough=True)
    # A falling body needs no effect at all.
    return Refit(next(reversed(smaller.model.effects), ""), smaller, minimum)


def settle(problems: Sequence[Problem], starts: Sequence[FloatArray], iterations: int = 25) -> list[Minimum]:
    """Minimise until a differenced Jacobian finds nothing better, in so many steps at most."""
    return fit_problems(problems, starts, iterations=iterations, tolerance=1e-4, rough=True, race=True)


def settled(problems: Sequence[Problem], starts: Sequence[FloatArray]) -> list[Refit]:
    """Return the best of what `settle` finds for each set of effects, smallest chi-square first."""
    minima = settle(problems, starts)
    return best_of(Refit(p.model.effects[-1], p, m) for p, m in zip(problems, minima, strict=True))


def best_of(refits: Iterable[Refit]) -> list[Refit]:
    """Return the best refit of each set of effects, smallest chi-square first."""
    best: dict[tuple[str, ...], Refit] = {}
    for r in refits:
        label = r.problem.model.effects
        if np.isfinite(r.chi2) and (label not in best or r.chi2 < best[label].chi2):
            best[label] = r
    return sorted(best.values(), key=lambda r: r.chi2)
