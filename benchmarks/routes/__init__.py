"""Maps made by scripts, and what routes on them cost."""
