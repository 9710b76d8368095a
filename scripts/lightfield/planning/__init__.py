"""Time, memory and disk space of a build, estimated before it runs."""
