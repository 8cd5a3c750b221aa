"""A measured system as its experimenter knows it before any recording is opened, and its rig file.

Here belongs what a rig file may say. What reads a recording does not.
"""
