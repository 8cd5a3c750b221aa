"""What every room stands on: exceptions, tables in files, locks, the disk cache, compiled functions and threads.

Here belongs what knows nothing of mechanics. What knows a unit, an effect or a rig does not.
"""
