"""From text to a Job: source, grammar, units, tables, names. Knows no controller."""
