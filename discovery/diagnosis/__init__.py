"""What tells more than a named effect: contradictions with the rig, manoeuvres between rivals, the missing force.

Here belongs what questions the answer of a search. What makes that answer does not.
"""
