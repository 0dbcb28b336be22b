"""Motion in the gate: braking, rollouts, certificates, safe twists."""
