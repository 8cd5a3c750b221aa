"""Measured sets side by side: each rig file's result beside what is known of its recordings.

Rig files and known figures lie in a folder of data sets, results in a folder of runs; a rig is called after its rig
file in both, for example ``emps/rig``.
"""
