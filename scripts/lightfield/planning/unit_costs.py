"""The unit costs of planning: seconds of one core, and bytes.

They were measured on one core of a 2-core x86-64 machine, most of them in the garden. This module
imports nothing, because every job reads it with the rules.
"""

# Path tracing of one sample of one pixel.
SECONDS_PER_SAMPLE = 6e-6
# A moving camera makes the rendering of a view longer by this part of it: 0.09 to 0.26 of it were
# measured in the three scenes, in views of 64² with 4 and 16 samples.
CAMERA_MOTION_PART = 0.2
# Start-up of bpy, the scene, and Cycles' acceleration structures.
START_UP_SECONDS = 3.0
# Start-up of a job without Blender.
JOB_SECONDS = 1.0
# Reading a pixel of an imported view: EXR with depth, by benchmarks/reprojection.py with batches of
# 16 views of 2048².
READ_SECONDS = 4e-8
# Computing a pixel of a reprojected view, measured in the same way.
REPROJECTION_SECONDS = 1.5e-7
# A sensor's noise and response for a pixel, with and without the weights of a bracket. It was
# measured on one core of a 2-core x86-64 machine that also did other work, in an image of 512².
SENSOR_SECONDS = 4e-7
BRACKET_SECONDS = 7e-7
# For each pixel of the views and their reprojections: each export, and the validation.
CHECK_SECONDS = 1e-7
# The same for the figures, and for the page. They show at most so many views.
REPORT_SECONDS = 4e-7
MOST_SHOWN_VIEWS = 120
# Denoising a pixel costs as much as this many samples of it: 18 µs against 6. It was measured on
# one core of an EPYC, in views of the garden of 256² and more. In small windows it costs up to
# twice as much.
DENOISING_SAMPLES = 3
# Bytes of a pixel's codes of 8 bits with noise, which a PNG cannot compress. Weights take 12 more,
# before compression.
NOISY_BYTES = 3
WEIGHT_BYTES = 12
# An EXR's size as a part of its uncompressed size, measured in the three scenes.
COMPRESSED = 0.75
