"""Machines declared in their own equations, each with one effect that its declaration lacks.

Every recording is simulated by scipy, in equations written here by hand, and shares nothing with the package. The loop
is run as a user would: a rig file and two CSV files, through the command line.
"""
