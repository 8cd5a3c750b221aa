"""Motions of many parameter sets at once: methods of integration, grids of steps, and the simulator.

Here belongs what moves a program on a given input. What knows a rig, a recording or a fit does not.
"""
