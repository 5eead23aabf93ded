"""Reads and runs RAPID (ABB)."""
