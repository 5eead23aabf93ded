"""From a Job to a Program: postures, joints, cycles."""
