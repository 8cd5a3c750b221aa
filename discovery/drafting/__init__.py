"""Before any model: a rig file drafted from recordings, and what a data set holds as it was understood.

Nothing here decides anything later: a draft is read, corrected and kept by its user.
"""
