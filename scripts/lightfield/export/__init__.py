"""The files with which each trainer opens a dataset: one module a format, registered here.

Each module has a ``MANIFEST`` of the files that it writes, which validation checks.
"""

from lightfield.export import instant_ngp

EXPORTERS = {"instant_ngp": instant_ngp}

MANIFESTS = [exporter.MANIFEST for exporter in EXPORTERS.values()]
