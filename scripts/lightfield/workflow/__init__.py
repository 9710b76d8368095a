"""What the rules use: datasets, their shards, records of finished work, the terminal's display."""
