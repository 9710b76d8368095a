"""Packages, shards, cards and descriptions of finished datasets, for those who download them."""
