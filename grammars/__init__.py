"""Grammars (Lark): the spec language."""
