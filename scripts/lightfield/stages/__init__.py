"""The stages of a build: what each reads, writes, and can be told. The rooms below do the work."""
