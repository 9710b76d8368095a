"""The files that are made from finished views and scenes: exports, flow, splits and surfaces."""
