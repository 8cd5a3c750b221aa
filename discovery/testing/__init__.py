"""What every effect must fulfil: a pytest class that another package can run over its own effects.

A test module subclasses it, with the ids of registered effects; without ids, the whole catalogue is tested::

    from discovery.testing import EffectContract

    class TestMyEffects(EffectContract):
        effects = ("my_effect",)

Each law runs for every effect on every base on which it means something. Random states and parameters come from fixed
seeds, in units where times, angles and lengths are of order one. All cases of a base share one compiled kernel, in
which the effects that are not under test are at their defaults, that is absent.
"""

from discovery.testing.contract import EffectContract

__all__ = ["EffectContract"]
