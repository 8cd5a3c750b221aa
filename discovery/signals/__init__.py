"""What recorded signals say by themselves: derivatives, periods, spectra and decay.

Here belongs analysis that needs no model. Candidate terms and parameters do not.
"""
