"""How large the error of a render is, what it costs, and which settings reach a target."""
