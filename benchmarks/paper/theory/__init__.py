"""The paper's mechanics beyond what the package needs: statics both ways, the massless arm, the drivetrain.

Each is derived, solved and tested here, and only the studies of the paper use it.
"""
