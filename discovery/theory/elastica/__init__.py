"""The static elastica: a clamped, inextensible rod bent by a force at its tip, equations (1) to (6) of the paper.

`beam` and `force_map` are its two directions, from force to tip and back; both stand on the elliptic integrals of
`integrals`. `series` and `small_deflection` are its limits, `static_law` its best cubic spring and radius law.
The names below load what they need when they are first used.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from discovery.foundation.lazy import lazy_names as _lazy_names

if TYPE_CHECKING:
    from discovery.theory.elastica.beam import perpendicular_law as perpendicular_law
    from discovery.theory.elastica.beam import shape_under_load as shape_under_load
    from discovery.theory.elastica.beam import tip_under_load as tip_under_load
    from discovery.theory.elastica.force_map import force_components as force_components
    from discovery.theory.elastica.force_map import load_at_tip as load_at_tip
    from discovery.theory.elastica.reach import radius_limits as radius_limits
    from discovery.theory.elastica.series import elastica_series as elastica_series
    from discovery.theory.elastica.small_deflection import small_deflection_shape as small_deflection_shape
    from discovery.theory.elastica.small_deflection import small_deflection_tip as small_deflection_tip
    from discovery.theory.elastica.static_law import radius_law as radius_law
    from discovery.theory.elastica.static_law import static_law as fit_static_law

# A public name never equals a module's, which would hide it once that module is imported: hence fit_static_law.
_HOMES = {
    "elastica_series": "discovery.theory.elastica.series:elastica_series",
    "fit_static_law": "discovery.theory.elastica.static_law:static_law",
    "force_components": "discovery.theory.elastica.force_map:force_components",
    "load_at_tip": "discovery.theory.elastica.force_map:load_at_tip",
    "perpendicular_law": "discovery.theory.elastica.beam:perpendicular_law",
    "radius_law": "discovery.theory.elastica.static_law:radius_law",
    "radius_limits": "discovery.theory.elastica.reach:radius_limits",
    "shape_under_load": "discovery.theory.elastica.beam:shape_under_load",
    "small_deflection_shape": "discovery.theory.elastica.small_deflection:small_deflection_shape",
    "small_deflection_tip": "discovery.theory.elastica.small_deflection:small_deflection_tip",
    "tip_under_load": "discovery.theory.elastica.beam:tip_under_load",
}

__all__ = list(_HOMES)
__getattr__, __dir__ = _lazy_names(__name__, _HOMES)
