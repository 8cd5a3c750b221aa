"""Motor, gear and controller, and the torque with which the arm answers: equations (10) and (11) of the paper."""
