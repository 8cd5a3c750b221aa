"""Motor, gear and controller that move an arm, equation (10) of the paper.

`motor` is what drives, `driven_arm` moves motor and arm together, `study` says when the encoder's angle is a given
input. The torque with which the arm answers is in `benchmarks.paper.theory.coupling`.
"""
