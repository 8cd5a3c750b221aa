"""Simulators of recordings that are held out, on steps that follow from those of training."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

from discovery.equations.model import Model
from discovery.estimation.bench import Bench
from discovery.estimation.held_states import fitted_states, known_problem
from discovery.estimation.local_steps import resolving
from discovery.estimation.natural_units import NaturalUnits
from discovery.estimation.step import choose_step
from discovery.foundation.errors import ComputationError
from discovery.foundation.start_names import is_start
from discovery.recordings.experiment import Experiment

#: Models with their values, on one bench.
Models = Sequence[tuple[Model, Mapping[str, float]]]


class HeldSimulators:
    """Simulators of held-out recordings, each made once.

    `separate`: all of these recordings. `tolerance`: of their trajectories, as that of training.
    """

    def __init__(self, separate: Sequence[Experiment], units: NaturalUnits, tolerance: float) -> None:
        self.separate, self.units, self.tolerance = separate, units, tolerance
        self._benches: dict[Hashable, Bench] = {}
        self._shares: dict[Hashable, float] = {}
        self._wild: set[Hashable] = set()

    def of(self, bench: Bench, models: Models, experiments: Sequence[Experiment]) -> Bench:
        """Return simulators of some of the recordings with the base and the effects of a bench.

        Their steps are those that these recordings need by the first of the models that moves through them; where those
        of training are shorter where a motion bends, so are they, where theirs does.
        """
        local = not bench.has_rod and bench.shortest < bench.step
        step = self._share(bench, models) * (bench.step if local else bench.shortest)
        laws = (bench.shortest, frozenset(model.effects for model, _ in models)) if local else ()
        recorded = tuple((e.recording.name, e.recording.time.size) for e in experiments)
        key = (bench.base, bench.effects, step, recorded, laws)
        if key not in self._benches:
            even = Bench(bench.base, bench.effects, experiments, step)
            alone = [known_problem(model, values, even, self.units) for model, values in models if local]
            self._benches[key] = resolving(even, [*zip(alone, fitted_states(alone), strict=True)]) if local else even
        return self._benches[key]

    def _share(self, bench: Bench, models: Models) -> float:
        """Return how much finer steps the held-out recordings need than the fitted ones, over these.

        The first set that moves through them decides: later ones do not ask again.
        """
        # Of two paces of an arm the shortest steps differ; those of other systems follow the motion of a set.
        kernel = bench.base, bench.effects, bench.shortest / bench.step if bench.has_rod else 1.0
        for model, values in models:
            asked = kernel, model.effects, frozenset(values.items())
            if kernel in self._shares:
                break
            if asked in self._wild:
                continue
            try:
                own = {n: v for n, v in values.items() if not is_start(n)}
                step = choose_step(model, self.separate, self.units, own, self.tolerance, bench.effects)
            except ComputationError:
                # A model that is good for the fitted recordings may blow up beyond them, whatever the step.
                self._wild.add(asked)
            else:
                self._shares[kernel] = min(step / (bench.shortest if bench.has_rod else bench.step), 1.0)
        return self._shares.get(kernel, 1.0)
