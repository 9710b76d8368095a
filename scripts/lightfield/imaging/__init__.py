"""Images in and out, and from scene-linear light to pixels that a person looks at."""
