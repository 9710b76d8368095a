"""Renders views, a shard in one process."""
