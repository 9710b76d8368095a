"""Opens scenes, and walks through what they hold at a frame."""
