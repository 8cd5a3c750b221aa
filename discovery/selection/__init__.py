"""Which effects a model lacks: one log evidence compares sets of them, one rule decides, and the verdict follows.

A set is linearised (`linearise`) and weighed with its priors (`belief`, `evidence`). As a `contender` it is offered to
the `search` (`offers`), judged by its `odds` and kept as a `decision`. `final` fits the answer, `verdict` names it, and
`sentences` puts it into words. The numbers that decide are in `settings`; docs/ATTRIBUTION.md explains them.

Here belongs what decides between sets of effects. What simulates or fits one set does not.
"""
