"""Sets Cycles up for the views of a scene: cameras, passes, and what is left out."""
