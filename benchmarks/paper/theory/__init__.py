"""The paper's mechanics beyond what the package needs: statics, massless arm, torque on the motor, drivetrain.

Each is derived, solved and tested here, and only the studies of the paper use it.
"""
