"""Reads and runs KRL (KUKA KSS 8)."""
