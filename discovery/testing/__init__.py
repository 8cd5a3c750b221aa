"""What every effect must fulfil: a pytest class that another package can run over its own effects."""

from discovery.testing.contract import EffectContract

__all__ = ["EffectContract"]
