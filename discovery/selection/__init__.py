"""Which effects a model lacks: one log evidence compares sets of them, one rule decides, and the verdict follows.

A `contender` is a set, linearised (`linearise`), with its evidence. `offers` and `neighbours` make those beside one,
the `search` judges them by their `odds` and keeps every `decision`. `final` fits the answer, `verdict` names it. The
numbers that decide are in `settings`; docs/ATTRIBUTION.md explains them.
Here belongs what decides between sets of effects. What simulates or fits one set does not.
"""
