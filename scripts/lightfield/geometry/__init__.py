"""Where cameras are and through which lens they look: rigs, lenses, depth."""
