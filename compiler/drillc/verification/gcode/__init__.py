"""Reads and runs G-code as LinuxCNC does (RS274/NGC)."""
