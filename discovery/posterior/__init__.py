"""The posterior of a fitted model: its density, the sampling, the noise models, evidence, and what is looked at.

Here belongs what holds for one given set of effects. What adds or removes an effect does not.
"""
